"""How the assumed inertia and thrust of an airframe change its flights."""
