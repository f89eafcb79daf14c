"""Autopilots: equations and their compiler, gains, linear models, tuning, identification."""
