"""The lagged study."""
