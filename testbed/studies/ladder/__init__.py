"""The ladder study."""
