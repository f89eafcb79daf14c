"""Runs, their columns, run folders and checksums."""
