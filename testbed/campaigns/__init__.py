"""Campaigns: many runs of one file, on as many processes or machines as there are; none lost, none twice."""
