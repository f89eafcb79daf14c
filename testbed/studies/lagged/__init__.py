"""The lagged plant compared with the aircraft."""
