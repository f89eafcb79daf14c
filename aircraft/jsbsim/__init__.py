"""JSBSim aircraft: the wrapper, initialisation, trim, fleets, geodesy."""
