"""Airframe folders: their schema and safe reading, and the airframes that come with the package."""
