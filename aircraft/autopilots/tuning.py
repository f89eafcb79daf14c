"""Step responses of an airframe under its autopilot, and their scores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin, motions, positions
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.steady import Trim

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Flight:
    """One aircraft flying one command from trim; arrays (T,), the first entry one period after t = 0."""

    t: Array  # s
    v: Array  # m/s
    omega: Array  # rad/s, the true course rate: of the ground velocity's direction
    omega_measured: Array  # rad/s, as the autopilot measures it and `Plant.achieved` gives it: low-passed
    zeta: Array  # m/s
    position: Array  # (T, 3) m, east-north-up about the start
    telemetry: dict[str, Array]


@dataclass(frozen=True)
class Score:
    """A step response: times [s], overshoot and final error as fractions of the step."""

    t63: float
    rise: float  # 10 to 90 %
    settling: float  # last time outside 5 %
    overshoot: float
    final_error: float
    crossings: int  # times the response crosses its final value by more than 2 %


def fly(
    airframe: Airframe,
    start_speed: float,
    command: Sequence[float],
    duration: float = 10.0,
    dt: float = 0.005,
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
    telemetry: Sequence[str] = (),
    near: Trim | None = None,
) -> Flight:
    """Fly (v [m/s], omega [rad/s], zeta [m/s]) for `duration` s from level trim at `start_speed`, eastwards.

    wind       m/s, east, north, up; steady, and trimmed for
    telemetry  channels of `aircraft.jsbsim.fdm` to keep
    near       a trim of a flight like this one, which makes starting quicker
    """
    fdm = Fdm(airframe, dt, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, start_speed, wind=wind), near)
    fdm.command(*command)
    track, moves, channels = [], [fdm.motion()], []
    for _ in range(round(duration / dt)):
        track += fdm.run(wind, 1)
        moves.append(fdm.motion())
        if telemetry:
            now = fdm.telemetry()
            channels.append([now[name] for name in telemetry])
    course, rates = motions(moves, fdm.origin)
    v, measured, zeta = rates[1:].T
    kept = dict(zip(telemetry, np.array(channels).T, strict=True))
    t = dt * np.arange(1.0, len(v) + 1)
    return Flight(t, v, course_rate(course, dt), measured, zeta, positions(track, fdm.origin), kept)


def course_rate(course: Array, dt: float) -> Array:
    """The course rate [rad/s], (T,), over each period of dt [s] between courses (T + 1,) [rad]."""
    turned = np.diff(course)
    rate: Array = (turned - 2 * np.pi * np.round(turned / (2 * np.pi))) / dt
    return rate


def score(t: Array, y: Array, before: float, after: float) -> Score:
    """Score a response (T,) asked to go from `before` to `after` at t = 0; times are NaN if it never does."""
    s = (y - before) / (after - before)

    def reaches(level: float) -> float:
        late = np.flatnonzero(s >= level)
        if not len(late):
            return float("nan")
        i = late[0]
        earlier, t_earlier = (s[i - 1], t[i - 1]) if i else (0.0, 0.0)
        return float(t_earlier + (t[i] - t_earlier) * (level - earlier) / (s[i] - earlier))

    outside = np.flatnonzero(np.abs(s - 1) > 0.05)
    # Sides of the final value in turn, by more than 2 %: an overshoot is one crossing, a swing back another.
    sides = np.sign(s - 1)[np.abs(s - 1) > 0.02]
    return Score(
        t63=reaches(0.632),
        rise=reaches(0.9) - reaches(0.1),
        settling=float(t[outside[-1]]) if len(outside) else 0.0,
        overshoot=float(max(s.max() - 1, 0.0)),
        final_error=float(s[-1] - 1),
        crossings=int(np.count_nonzero(np.diff(sides))),
    )
