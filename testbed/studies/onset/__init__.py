"""The onset study."""
