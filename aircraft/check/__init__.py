"""Checks of a user's airframe folder: its files, then the model in flight."""
