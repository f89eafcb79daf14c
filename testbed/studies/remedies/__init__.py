"""Remedies compared at equal seeds."""
