"""Flies an adopted aircraft's steps and measures its loops, for the search and the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.autopilots.linear_autopilot import loops
from aircraft.autopilots.margins import margins, response
from aircraft.autopilots.specification import climb_rate, duration, turn_rate
from aircraft.autopilots.tuning import Flight, fly, score
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.steady import Trim

_CHANNELS = ("v", "omega", "zeta")
_DEEPEST_M = 200.0
_SMALL = 0.4  # of the other steps in speed: one that leaves the throttle free


@dataclass(frozen=True)
class Case:
    """One step: from level flight at `start`, `command`, in which `channel` changes."""

    channel: str
    start: float
    command: tuple[float, float, float]
    duration: float

    @property
    def title(self) -> str:
        """What is asked, at which speed."""
        v, omega, zeta = self.command
        what = {
            "v": f"v {self.start:g} to {v:g} m/s",
            "omega": f"omega 0 to {math.degrees(omega):.3g} deg/s at {v:g} m/s",
            "zeta": f"zeta 0 to {zeta:.3g} m/s at {v:g} m/s",
        }
        return what[self.channel]


@dataclass(frozen=True)
class Scored:
    """A step flown: times [s], overshoot and final error as shares of the step; inf where it did not end."""

    case: Case
    t63: float
    overshoot: float
    final_error: float


def cases(airframe: Airframe) -> list[Case]:
    """The steps at the airframe's own speeds: turns, climbs and speed, at slow, middle and fast."""
    s = airframe.speeds
    slow, middle, fast = (s.within(x) for x in (0.1, 0.5, 1.0))
    climb = climb_rate(s)
    short = duration(s, 8.0)
    # Descents end above the ground, 300 m below the start.
    climbing = min(short, _DEEPEST_M / climb)
    found = [Case("omega", v, (v, turn_rate(s, v), 0.0), short) for v in (slow, middle, fast)]
    found += [Case("zeta", v, (v, 0.0, sign * climb), climbing) for v in (slow, fast) for sign in (1.0, -1.0)]
    step = s.step(middle - slow)
    found += [
        Case("v", v, (to, 0.0, 0.0), duration(s, 12.0))
        for v, to in ((slow, slow + step), (middle, middle + _SMALL * step), (middle, middle - step))
    ]
    return found


def flown(
    airframe: Airframe, case: Case, near: Callable[[float], Trim | None]
) -> tuple[Scored, Flight | None]:
    """Fly a case. What cannot be flown to its end scores infinity."""
    try:
        f = fly(airframe, case.start, case.command, case.duration, near=near(case.start))
    except FdmError:
        return Scored(case, math.inf, math.inf, math.inf), None
    k = _CHANNELS.index(case.channel)
    y = getattr(f, case.channel)
    if not np.all(np.isfinite(y)):
        return Scored(case, math.inf, math.inf, math.inf), None
    before = (case.start, 0.0, 0.0)[k]
    after = case.command[k]
    s = score(f.t, y, before, after)
    late = y[-max(len(y) // 8, 1) :]
    error = float(np.abs(late - after).max() / abs(after - before))
    return Scored(case, s.t63 if math.isfinite(s.t63) else math.inf, s.overshoot, error), f


def disk_margins(
    airframe: Airframe,
    speeds: Iterable[float],
    near: Callable[[float], Trim | None],
    seconds: float = 20.0,
    loops_: Iterable[str] | None = None,
) -> dict[tuple[float, str], float]:
    """The disk margin of every loop, or of `loops_`, measured by an impulse in flight; 0 where none is."""
    found = {}
    for v in speeds:
        for loop in loops_ or loops(airframe):
            try:
                measured = response(airframe, v, loop, duration=seconds, near=near(v))
                value = margins(measured).disk
            except (FdmError, ValueError):
                value = 0.0
            found[v, loop] = value if math.isfinite(value) else 0.0
    return found
