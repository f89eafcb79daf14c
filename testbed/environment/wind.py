"""Steady wind: the mean motion of the air over the ground as a function of height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aircraft.jsbsim.geodesy import Origin
from filters.model import Array

# Of the shared origin, where z = 0, above the ground [m].
HEIGHT_M = Origin().altitude_m - Origin().ground_m


@dataclass(frozen=True)
class SteadyWind:
    """The same at every time and place but for the height.

    speed     m/s, level, at the origin's height
    towards   rad, where the air moves to, counter-clockwise from east
    updraft   m/s, the same at every height
    exponent  power law: the level wind is speed (height above ground / origin's height above ground)^exponent
    gradient  1/s: the level wind grows by so many m/s per metre; it reverses below where it vanishes
    """

    speed: float
    towards: float
    updraft: float = 0.0
    exponent: float = 0.0
    gradient: float = 0.0

    def __call__(self, z: Array) -> Array:
        """The wind (N, 3) m/s, east, north and up, at heights z (N,) m above the origin."""
        level = np.full(len(z), self.speed)
        if self.exponent:
            level = level * np.maximum((HEIGHT_M + z) / HEIGHT_M, 0.0) ** self.exponent
        level = level + self.gradient * z
        up = np.full(len(z), self.updraft)
        return np.stack([level * np.cos(self.towards), level * np.sin(self.towards), up], axis=-1)

    def mean(self) -> Array:
        """The wind (3,) m/s at the origin's height."""
        return np.asarray(self(np.zeros(1))[0])
