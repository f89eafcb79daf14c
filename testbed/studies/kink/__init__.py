"""The kink study."""
