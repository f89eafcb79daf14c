"""Measures thrust at idle, full throttle and between, at an airspeed, on engines that run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.rig import Held, Rig
from aircraft.airframes.setup import Engines
from aircraft.jsbsim.engines import running
from aircraft.jsbsim.errors import FdmError

STAGE = "engines"
_IDLES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3)
BEFORE_AFTERBURNER = 0.98  # JSBSim lights one above 99 % of throttle
_LEAST_MPS2 = 0.2  # between idle and full throttle
_SHARES = np.linspace(0.0, 1.0, 9)
_RISE = 0.01  # of the thrust range, from one throttle to the next: what the inversion needs


@dataclass(frozen=True)
class Thrust:
    """At one airspeed: least and largest thrust over mass [m/s^2], and shares of their range (7,) at each
    eighth of the throttle's range between its ends."""

    least: float
    most: float
    shares: tuple[float, ...]


def idle(rig: Rig, held: Held) -> float:
    """The least throttle at which the engines go on. Raises AdoptionError."""
    if not rig.fdm.engine_states:
        return 0.0
    for throttle in _IDLES:
        try:
            held.measure(commands={"throttle": throttle}, steady=True)
        except FdmError:
            rig.fdm.forgets = None  # start them again
            continue
        if running(rig.fdm):
            return throttle
        rig.fdm.forgets = None
    raise AdoptionError(STAGE, f"its engines stop at every throttle up to {_IDLES[-1]:g}")


def measure_thrust(held: Held, drag: float, engines: Engines) -> Thrust:
    """Thrust along the path at nine throttles; it equals `drag` [m/s^2] at the trim's."""
    at_trim = float(held.measure(steady=True)[:3] @ held.along)
    throttles = engines.idle + _SHARES * (engines.full - engines.idle)
    found = [
        float(held.measure(commands={"throttle": float(t)}, steady=True)[:3] @ held.along) for t in throttles
    ]
    thrusts = np.maximum.accumulate(np.array(found) - at_trim + drag)
    span = float(thrusts[-1] - thrusts[0])
    if not span > _LEAST_MPS2:
        raise AdoptionError(
            STAGE,
            f"full throttle adds {span:.2g} m/s^2 to idle at {held.speed:.0f} m/s: no engine that drives it",
        )
    shares = (thrusts - thrusts[0]) / span
    shares = shares + _RISE * _SHARES  # strictly rising
    shares = shares / shares[-1]
    return Thrust(float(thrusts[0]), float(thrusts[-1]), tuple(map(float, shares[1:-1])))
