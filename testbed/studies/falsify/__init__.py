"""The falsify study."""
