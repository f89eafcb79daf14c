"""One scenario on several plants, side by side."""
