"""Filters of other authors, each in one file."""
