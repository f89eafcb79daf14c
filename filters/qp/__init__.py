"""Quadratic programs of the filter: one, a batch, and proofs that one has no solution."""
