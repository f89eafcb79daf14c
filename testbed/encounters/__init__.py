"""Encounters of other people's making, and of our own, as scenario files."""
