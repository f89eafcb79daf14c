"""Guidance that follows: a course, legs between waypoints, a circle, a recorded track."""
