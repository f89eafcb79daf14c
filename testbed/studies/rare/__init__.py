"""How probable a rare event is over a scenario's random starts."""
