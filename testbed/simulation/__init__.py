"""The simulation loop, its recorder and step buffer."""
