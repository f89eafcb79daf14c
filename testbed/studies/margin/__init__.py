"""The margin study."""
