"""The control-barrier-function filter: constraints, the collision filter, the theorem monitor."""
