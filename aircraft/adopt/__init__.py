"""Adopts a JSBSim aircraft: from its files alone to a folder that flies under the autopilot."""
