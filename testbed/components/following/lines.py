"""Guidance along a course and along straight legs between waypoints, by a vector field."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from filters.model import Array, Command, Limits, View
from testbed.components.following.course import approach, climb, turn, wrapped

# Of the turn rate, what the corner between two legs is flown with, and the sharpest corner that is cut [rad].
CORNER_SHARE = 0.8
SHARPEST = np.radians(120.0)


@dataclass(frozen=True)
class Hold:
    """Holds course, speed and height.

    course  rad; speed m/s; height m
    gain    1/s, on the course; height_gain 1/s, on the height
    limits  (N,)
    """

    course: float
    speed: float
    height: float
    gain: float
    height_gain: float
    limits: Limits

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        s = view.state
        omega = turn(s.theta, np.full(len(s), self.course), 0.0, self.gain, self.limits)
        zeta = climb(s.z, self.height, 0.0, self.height_gain, self.limits)
        return Command(np.full(len(s), self.speed), omega, zeta)


@dataclass
class Waypoints:
    """Follows the straight legs from each waypoint to the next.

    places  (W, 3) m, W >= 2; speeds (W,) m/s, flown on the way to each
    closed  after the last the first again; otherwise the last leg is flown on for ever
    approach_m  m; None: `course.approach`

    The course wanted at e [m] left of a leg of course q is q - atan(e / approach) (Nelson et al. 2007), and
    what it turns at is added to the command, so that a unicycle inside its limits is on it exactly. A vehicle
    goes on to the next leg where its turn has to begin, R tan(corner / 2) before the waypoint, R being that
    of CORNER_SHARE of the turn rate. Each vehicle counts its own leg.
    """

    places: Array
    speeds: Array
    closed: bool
    gain: float
    height_gain: float
    limits: Limits
    approach_m: float | None = None
    leg: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        places, speeds = np.asarray(self.places, dtype=float), np.asarray(self.speeds, dtype=float)
        if self.closed:
            places, speeds = np.concatenate([places, places[:1]]), np.concatenate([speeds, speeds[:1]])
        way = np.diff(places, axis=0)
        self._begin, self._speed = places[:-1], speeds[1:]
        self._length = np.hypot(way[:, 0], way[:, 1])
        self._course = np.arctan2(way[:, 1], way[:, 0])
        self._slope = way[:, 2] / self._length
        # The corner at the end of each leg; none at the end of the last one, which is flown on.
        corner = wrapped(np.roll(self._course, -1) - self._course)
        lead = np.tan(np.minimum(np.abs(corner), SHARPEST) / 2.0)
        self._corner = lead if self.closed else np.append(lead[:-1], -np.inf)
        self.leg = np.zeros(len(self.limits), dtype=int)

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        s, leg = view.state, self._onwards(view)
        v, q = self._speed[leg], self._course[leg]
        along, aside = self._offsets(view, leg)
        reach = approach(v, self.limits) if self.approach_m is None else np.full(len(s), self.approach_m)
        wanted = q - np.arctan(aside / reach)
        rate = -v * np.sin(s.theta - q) / reach / (1.0 + (aside / reach) ** 2)
        omega = turn(s.theta, wanted, rate, self.gain, self.limits)
        along = np.minimum(np.maximum(along, 0.0), self._length[leg])
        inside = (along > 0.0) & (along < self._length[leg])
        height = self._begin[leg, 2] + self._slope[leg] * along
        zeta = climb(s.z, height, np.where(inside, self._slope[leg] * v, 0.0), self.height_gain, self.limits)
        return Command(v, omega, zeta)

    def _onwards(self, view: View) -> np.ndarray:
        """The leg (N,) of each vehicle, after those that it has done."""
        for _ in range(len(self._course)):
            along, _aside = self._offsets(view, self.leg)
            radius = self._speed[self.leg] / (CORNER_SHARE * np.maximum(self.limits.omega_max, 1e-6))
            lead = np.minimum(radius * self._corner[self.leg], 0.5 * self._length[self.leg])
            done = self._length[self.leg] - along <= lead
            if not done.any():
                break
            self.leg = np.where(done, (self.leg + 1) % len(self._course), self.leg)
        return self.leg

    def _offsets(self, view: View, leg: np.ndarray) -> tuple[Array, Array]:
        """How far along its leg each vehicle is, and how far left of it, (N,) m."""
        east, north = view.state.x - self._begin[leg, 0], view.state.y - self._begin[leg, 1]
        c, s = np.cos(self._course[leg]), np.sin(self._course[leg])
        return c * east + s * north, c * north - s * east
