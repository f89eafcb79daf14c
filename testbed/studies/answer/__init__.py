"""The central table: aircraft, numbers of vehicles, weather and remedies."""
