"""Gains of an airframe's autopilot: scored, swept, optimised."""
