"""Wrappers around any filter: row margins, pose prediction, the air-mass frame."""
