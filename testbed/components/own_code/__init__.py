"""Reads a user's own code: how a part is written, its file with what it imports, its role, its arguments."""
