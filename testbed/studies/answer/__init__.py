"""The answer: fleets, missions, weather, remedies and guidance."""
