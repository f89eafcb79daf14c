"""The scenario file: its tables, overrides, capacity and the built-in scenarios."""
