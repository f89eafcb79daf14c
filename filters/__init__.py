"""What to fly: control barrier functions for fixed-wing collision avoidance (Squires et al. 2022)."""
