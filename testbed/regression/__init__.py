"""Baselines of fidelity: what a project's unicycles and aircraft did, and whether they do worse today."""
