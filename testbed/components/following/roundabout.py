"""Guidance around a ring, against the sense of the evading turn, on which h is the distance less Ds."""

from __future__ import annotations

import numpy as np

from filters.model import Array, Command, Limits, View
from testbed.components.following.course import climb
from testbed.components.following.loiter import Loiter
from testbed.components.following.pursuit import CIRCLE, pursue
from testbed.scenario.guidance import Roundabout as Table

# Of the turn rate limit, the most that flying the ring takes where its radius is not said.
RING_SHARE = 0.6
# What an exit may be missed by in a filter period [rad].
SLIP = 0.05


class Roundabout:
    """Flies onto the ring, around it, and straight to the goal from where that leads away from the ring.

    goal    (N, 3) m
    centre  (2,) m;  radius m;  sense +1 counter-clockwise, -1 clockwise: against the evading turn
    speed   m/s;  gain 1/s, on the course;  height_gain 1/s, on the height
    approach_m  m, as of `Loiter`

    A vehicle leaves the ring where the straight line to its goal touches it, for a goal inside the ring
    while the circle of its turn does not yet hold the goal. A vehicle whose line passes outside the ring from
    the start, in the ring's sense, does not enter it.
    """

    def __init__(
        self,
        goal: Array,
        centre: Array,
        radius: float,
        sense: float,
        speed: float,
        gain: float,
        height_gain: float,
        limits: Limits,
        approach_m: float | None = None,
    ) -> None:
        n = len(goal)
        self._goal, self._centre, self._sense = goal, centre, sense
        self._radius, self._speed = radius, np.full(n, speed)
        middle = np.concatenate([np.broadcast_to(centre, (n, 2)), goal[:, 2:]], axis=1)
        self._ring = Loiter(middle, radius, speed, sense, gain, height_gain, limits, approach_m)
        self._gains, self._limits = (gain, height_gain), limits
        self._left = np.zeros(n, dtype=bool)

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        s, radius = view.state, self._radius
        place = (s.x - self._centre[0]) + 1j * (s.y - self._centre[1])
        goal = (self._goal[:, 0] - self._centre[0]) + 1j * (self._goal[:, 1] - self._centre[1])
        to_go = np.mod(self._sense * np.angle(goal * np.conj(place)), 2 * np.pi)
        self._left = self._left | (to_go <= self._lead(np.abs(goal)) + _behind(np.abs(place), radius) + SLIP)
        around = self._ring(t, view)
        if not self._left.any():
            return around
        straight = pursue(s, self._goal[:, :2], self._speed, self._gains[0], self._limits)
        zeta = climb(s.z, self._goal[:, 2], 0.0, self._gains[1], self._limits)
        return Command(self._speed, np.where(self._left, straight, around.omega), zeta)

    def _lead(self, away: Array) -> Array:
        """The angle (N,) rad along the ring from its exit to its goal, `away` (N,) m from the centre."""
        radius = self._radius
        turn = CIRCLE * self._speed / np.maximum(self._limits.omega_max, 1e-6)
        gap = radius - turn
        share = (radius**2 + away**2 - 2.0 * turn * radius) / (
            2.0 * np.maximum(away, 1e-9) * np.where(np.abs(gap) > 1e-9, gap, 1e-9)
        )
        inside = np.where(share <= -1.0, 2 * np.pi, np.arccos(np.minimum(np.maximum(share, -1.0), 1.0)))
        return np.where(away >= radius, _behind(away, radius), inside)


def _behind(away: Array, radius: float) -> Array:
    """The angle (N,) rad at the centre between a point `away` from it and where its line touches the ring."""
    return np.asarray(np.arccos(np.minimum(radius / np.maximum(away, radius), 1.0)))


def ring_radius(table: Table, count: int, limits: Limits, d_safe: float) -> float:
    """The ring's radius [m] for `count` vehicles.

    Vehicles spread evenly on a ring of radius R, flown against gamma, have h = 2 R sin(pi / count) - Ds.
    """
    if table.radius_m is not None:
        return table.radius_m
    flown = table.speed_mps / (RING_SHARE * float(np.min(np.maximum(limits.omega_max, 1e-6))))
    spread = (d_safe + table.room_m) / (2.0 * np.sin(np.pi / count)) if count > 1 else 0.0
    return max(flown, float(spread))


def sense_against(gamma: Command) -> float:
    """+1 or -1: the sense in which a ring is flown against the evading manoeuvre gamma (N,).

    Raises  ValueError where gamma does not turn, or not all of them in one sense
    """
    sides = np.sign(gamma.omega)
    if not sides.size or sides[0] == 0 or (sides != sides[0]).any():
        raise ValueError("a roundabout is flown against the evading turn, and this manoeuvre has none")
    return float(-sides[0])
