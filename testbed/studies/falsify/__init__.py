"""The search for a violation within bounds, and its reduction to the smallest one found."""
