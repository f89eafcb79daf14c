"""Datasheets: what an airframe can do."""
