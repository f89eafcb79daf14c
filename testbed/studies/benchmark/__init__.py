"""The benchmark: filters on plants in sets of encounters, all from the same starts."""
