"""Guidance along a recorded track, by its times: for replaying flight logs and encounters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.model import Array, Command, Limits, View
from testbed.components.following.course import climb, turn

# Below this wanted speed [m/s] a direction means nothing: the course is kept.
STANDING = 0.1


class Track:
    """A recorded track as a function of time: cubic between rows, straight on after the last.

    rows  (R, 3) or (R, 4): t [s], x, y and z [m]; the first row is the run's begin. R >= 2
    The slopes at the rows are those of the parabola through each and its neighbours.
    """

    def __init__(self, rows: Array) -> None:
        rows = np.asarray(rows, dtype=float)
        self._t, self._place = rows[:, 0] - rows[0, 0], rows[:, 1:]
        order = 2 if len(rows) > 2 else 1
        self._slope = np.gradient(self._place, self._t, axis=0, edge_order=order)  # type: ignore[call-overload]
        self.heights = rows.shape[1] == 4

    @property
    def end(self) -> float:
        """s, the time of the last row."""
        return float(self._t[-1])

    def at(self, t: Array | float) -> tuple[Array, Array, Array]:
        """Place [m], velocity [m/s] and acceleration [m/s2] at times t (...), each (..., 2) or (..., 3)."""
        t = np.asarray(t, dtype=float)
        k = np.clip(np.searchsorted(self._t, t, side="right") - 1, 0, len(self._t) - 2)
        h = (self._t[k + 1] - self._t[k])[..., None]
        s = np.clip((t - self._t[k])[..., None] / h, 0.0, 1.0)
        a, b, da, db = self._place[k], self._place[k + 1], self._slope[k] * h, self._slope[k + 1] * h
        c2, c3 = 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db
        place = a + s * (da + s * (c2 + s * c3))
        velocity = (da + s * (2.0 * c2 + 3.0 * s * c3)) / h
        acceleration = (2.0 * c2 + 6.0 * s * c3) / h**2
        late = np.maximum(t - self.end, 0.0)[..., None]
        # Straight on after the last row, at its speed and height.
        on = velocity.copy()
        on[..., 2:] = 0.0
        return (
            place + late * on,
            np.where(late > 0.0, on, velocity),
            np.where(late > 0.0, 0.0, acceleration),
        )


@dataclass(frozen=True)
class FollowTrack:
    """Flies a track by its times.

    gain           1/s, on the course; position_gain 1/s, on the error of the position and of the height
    limits         (N,)
    Flown is the track's velocity plus `position_gain` times what the vehicle lacks of its place, and the turn
    rate of the track is added. After its last row the vehicle holds the last course, speed and height;
    without heights the climb rate is zero.
    """

    track: Track
    gain: float
    position_gain: float
    limits: Limits

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        s, (place, velocity, acceleration) = view.state, self.track.at(t)
        if t > self.track.end:
            v = np.full(len(s), np.hypot(velocity[0], velocity[1]))
            course, rate = np.full(len(s), np.arctan2(velocity[1], velocity[0])), np.zeros(len(s))
        else:
            east = velocity[0] + self.position_gain * (place[0] - s.x)
            north = velocity[1] + self.position_gain * (place[1] - s.y)
            v = np.hypot(east, north)
            course = np.where(v > STANDING, np.arctan2(north, east), s.theta)
            square = max(float(velocity[0] ** 2 + velocity[1] ** 2), STANDING**2)
            turned = (velocity[0] * acceleration[1] - velocity[1] * acceleration[0]) / square
            rate = np.where(v > STANDING, turned, 0.0)
        omega = turn(s.theta, course, rate, self.gain, self.limits)
        if not self.track.heights:
            return Command(v, omega, np.zeros(len(s)))
        zeta = climb(s.z, place[2], velocity[2], self.position_gain, self.limits)
        return Command(v, omega, zeta)
