"""The answer study."""
