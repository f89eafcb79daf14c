"""How vehicles fly: JSBSim aircraft with autopilots, and kinematic plants, behind one interface."""
