"""Finds the steady climbs and descents at a given speed and turn rate, and so where the envelope ends.

The throttle is given and the climb angle is sought: this states the balance differently from a trim, so that
the two can be compared. Among the unknowns the climb angle stands where a trim has its throttle.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.jsbsim.continuation import Problem, follow
from aircraft.jsbsim.engines import settle
from aircraft.jsbsim.rest import Instance, initialise
from aircraft.jsbsim.shortfall import AILERON, ELEVATOR, RUDDER, THROTTLE, balance
from aircraft.jsbsim.steady import Trim, bounds, trim_problem, velocity_of

Array = NDArray[np.float64]

STEEPEST_RAD = math.radians(60.0)  # climb angle; steeper flight is not sought
_SLOPE = THROTTLE  # the climb angle's place among the unknowns
_FINEST = 1e-4  # of the way from the climb known to the steepest: how exactly the last one is found


def climb_problem(fdm: Instance, heading: float) -> Problem:
    """Climbs in still air at p = (ground speed [m/s], throttle, turn rate [rad/s])."""

    def residuals(p: Array, x: Array) -> Array:
        commands = {"elevator": x[ELEVATOR], "aileron": x[AILERON], "throttle": p[1]}
        if len(x) > RUDDER:
            commands["rudder"] = x[RUDDER]
        for name, value in commands.items():
            fdm.nodes[name].set_double_value(float(value))
        slope = float(x[_SLOPE])
        velocity = velocity_of(p[0] / math.cos(slope), slope, heading)
        initialise(fdm, (x[0], slope + x[1], heading + x[2]), velocity, -p[2])
        settle(fdm)
        return balance(fdm)

    lowest, highest = bounds(fdm, -STEEPEST_RAD, STEEPEST_RAD)
    return Problem(residuals, lowest, highest)


def climb_range(fdm: Instance, v: float, omega: float, level: Trim) -> tuple[float, float]:
    """Lowest and highest steady climb rate [m/s] at ground speed v [m/s] and turn rate omega [rad/s].

    In still air. Idle and full throttle end the range where they can be flown. Where they cannot, the wing or
    the elevator ends it, or nothing does down to a dive of 60 deg: climbs are then followed as trims from the
    other end of the range. level    a trim in level flight without a turn
    Returns  NaN and NaN if neither end is found
    """
    problem = climb_problem(fdm, math.pi / 2)
    place = np.array([level.airspeed, level.throttle, 0.0])
    aside = level.yaw - math.pi / 2
    unknowns = [level.roll, level.alpha, aside, level.elevator, level.aileron, 0.0, level.rudder]
    start = np.array(unknowns[: len(problem.lowest)])
    fdm.nodes["on"].set_double_value(0.0)
    throttles = fdm.airframe.engines.idle, fdm.airframe.engines.full
    ends = [_climb_at(problem, place, start, np.array([v, full, omega])) for full in throttles]
    rates = [math.nan if x is None else v * math.tan(x[_SLOPE]) for x in ends]
    for k, other in ((0, 1), (1, 0)):
        x = ends[other]
        if ends[k] is None and x is not None:
            rates[k] = _furthest(fdm, v, omega, x, throttles[other], (-1.0, 1.0)[k])
    return rates[0], rates[1]


def _climb_at(problem: Problem, level: Array, start: Array, target: Array) -> Array | None:
    """A climb's unknowns at `target`, straight from level flight or throttle and speed first, turn last."""
    direct = follow(problem, level, start, target)
    if direct.arrived:
        return direct.x
    first = follow(problem, level, start, np.array([level[0], target[1], 0.0]))
    then = follow(problem, first.p, first.x, np.array([target[0], target[1], 0.0]))
    last = follow(problem, then.p, then.x, target)
    return last.x if last.arrived else None


def _furthest(fdm: Instance, v: float, omega: float, x: Array, throttle: float, sign: float) -> float:
    """The climb rate [m/s] at which trims end that are followed up or down (sign) from the climb x."""
    problem = trim_problem(fdm, math.pi / 2, math.nan, math.nan, np.zeros(3))
    along = Problem(
        lambda p, x: problem.residuals(np.array([math.hypot(v, p[0]), math.atan2(p[0], v), omega]), x),
        problem.lowest,
        problem.highest,
    )
    begin = np.array([v * math.tan(x[_SLOPE])])
    trimmed = x.copy()
    trimmed[THROTTLE] = throttle
    end = np.array([sign * v * math.tan(STEEPEST_RAD)])
    return float(follow(along, begin, trimmed, end, shortest=_FINEST).p[0])
