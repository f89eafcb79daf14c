"""Computes safe commands: control barrier functions for fixed-wing aircraft (Squires et al. 2022)."""
