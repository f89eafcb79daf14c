"""Guidance onto a circle and around it, by a vector field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.model import Array, Command, Limits, View
from testbed.components.following.course import approach, climb, turn

# Nearer to the centre than this share of the radius, the direction from the centre turns too fast to follow.
NEAREST = 0.1


@dataclass(frozen=True)
class Loiter:
    """Flies onto a circle and around it.

    centre  (3,) m, or (N, 3) one for each vehicle; radius, speed  () or (N,) m, m/s
    sense   () or (N,): +1 counter-clockwise, -1 clockwise
    gain    1/s, on the course; height_gain 1/s, on the height
    limits  (N,)
    approach_m  m; None: `course.approach`

    At distance d from the centre, in the direction phi from it, the course wanted is
    phi + sense (pi / 2 + atan((d - radius) / approach)) (Nelson et al. 2007), and what it turns at is added.
    """

    centre: Array
    radius: Array | float
    speed: Array | float
    sense: Array | float
    gain: float
    height_gain: float
    limits: Limits
    approach_m: float | None = None

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        s, centre = view.state, np.asarray(self.centre)
        v, radius = np.broadcast_to(self.speed, s.shape), np.broadcast_to(self.radius, s.shape)
        east, north = s.x - centre[..., 0], s.y - centre[..., 1]
        distance, phi = np.hypot(east, north), np.arctan2(north, east)
        reach = approach(v, self.limits) if self.approach_m is None else np.full(len(s), self.approach_m)
        off = (distance - radius) / reach
        wanted = phi + self.sense * (0.5 * np.pi + np.arctan(off))
        outwards, around = v * np.cos(s.theta - phi), v * np.sin(s.theta - phi)
        swung = around / np.maximum(distance, NEAREST * radius)
        rate = swung + self.sense * outwards / reach / (1.0 + off**2)
        omega = turn(s.theta, wanted, rate, self.gain, self.limits)
        zeta = climb(s.z, np.broadcast_to(centre[..., 2], s.shape), 0.0, self.height_gain, self.limits)
        return Command(v, omega, zeta)
