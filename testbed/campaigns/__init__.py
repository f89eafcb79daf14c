"""Flies many runs of one file, on many processes or machines, resumable at any time."""
