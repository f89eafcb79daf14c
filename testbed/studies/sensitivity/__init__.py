"""The sensitivity study."""
