"""How it flies: JSBSim aircraft with inner-loop autopilots, and kinematic plants, behind one seam."""
