"""Makes plants, filters, guidance and environments from a scenario or from the user's own code."""
