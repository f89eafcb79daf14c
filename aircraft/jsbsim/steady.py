"""Finds trims: steady flight at a given airspeed, climb and turn, balanced on the flight model itself.

The unknowns are roll, pitch above the path, yaw beside the heading [rad], elevator and aileron [-1, 1],
throttle [0, 1] and, where there is one, rudder [-1, 1]. With a rudder the flight is free of sideslip; without
one the sideslip follows from the balance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.jsbsim import shortfall
from aircraft.jsbsim.continuation import Problem, Reached, correct, follow, solve
from aircraft.jsbsim.engines import is_captive, settle
from aircraft.jsbsim.errors import FdmError, UnsteadyError
from aircraft.jsbsim.geodesy import G_MPS2
from aircraft.jsbsim.rest import Instance, Start, initialise, place
from aircraft.jsbsim.shortfall import AILERON, ELEVATOR, RUDDER, THROTTLE, balance

Array = NDArray[np.float64]

_CAPTIVE_DIFFERENCE = 1e-5  # for derivatives by unknowns: larger than what engines settle to
_LONGEST = (0.5, 0.15, 0.2, 0.5, 0.5, 0.2, 0.5)  # steps of the unknowns where engines have a state
_LEVEL_THROTTLE, _LEVEL_ALPHA_RAD = 0.4, 0.05  # of the first guess
_MORE_THROTTLE = 0.7  # of the second, where engines have a state: pistons turn little below half


@dataclass(frozen=True)
class Trim:
    """Steady flight: attitude, angles to the air [rad], commands [-1, 1] and [0, 1], airspeed [m/s]."""

    roll: float
    pitch: float
    yaw: float  # JSBSim's: clockwise from north
    alpha: float
    beta: float
    elevator: float
    aileron: float
    throttle: float
    airspeed: float
    rudder: float = 0.0


def trim(fdm: Instance, start: Start, omega: float = 0.0, near: Trim | None = None) -> Trim:
    """Steady flight at the start's place and air-relative velocity, turning at `omega` [rad/s].

    near  a trim of a flight like this one, from which the search begins

    Leaves JSBSim initialised there without wind and the commands set.
    Raises  FdmError, which says which force or moment is missing, if there is no such flight
    """
    airframe = fdm.airframe
    speed, climb, heading, problem = _stated(fdm, start)
    p = np.array([speed, climb, omega])
    speeds = airframe.speeds
    guess = None if near is None else _unknowns(near, len(problem.lowest))
    x, missing = find(fdm, problem, p, heading, (speeds.start_mps, speeds.v_min_mps, speeds.v_max_mps), guess)
    if x is None:
        raise UnsteadyError(
            f"{airframe.name} cannot fly steadily at ground speed {start.v:g} m/s, climb {start.zeta:g} m/s, "
            f"turn {omega:g} rad/s, wind {start.wind} m/s",
            missing,
        )
    return _trim_at(fdm, x, speed, climb, heading)


def attempt(fdm: Instance, start: Start, omega: float = 0.0, near: Trim | None = None) -> Trim | None:
    """`trim` without continuation, from `near` and from usual angles of attack; None if it fails.

    Quick where there is no such flight; it does not say why.
    """
    speed, climb, heading, problem = _stated(fdm, start)
    p = np.array([speed, climb, omega])
    guesses = [] if near is None else [_unknowns(near, len(problem.lowest))]
    for alpha, throttle in ((_LEVEL_ALPHA_RAD, _LEVEL_THROTTLE), (0.15, 0.7)):
        guess = first_guess(problem, p)
        guess[1], guess[THROTTLE] = alpha, throttle
        guesses.append(guess)
    for guess in guesses[:2]:
        x = correct(problem, p, guess)
        if x is None and not problem.slow:
            x = solve(problem, p, guess)
        if x is not None:
            return _trim_at(fdm, x, speed, climb, heading)
    return None


def lacking(fdm: Instance, start: Start, near: Trim | None = None) -> str:
    """What full throttle leaves unbalanced where all else is balanced as far as it can be; quick, rough."""
    speed, climb, heading, problem = _stated(fdm, start)
    p = np.array([speed, climb, 0.0])
    best: list[tuple[float, Array]] = []

    def others(at: Array, x: Array) -> Array:
        """Everything but the force along the path, at the throttle that p gives."""
        whole = np.insert(x, THROTTLE, at[3])
        problem.residuals(at[:3], whole)
        left = shortfall.in_path_axes(fdm, at, whole, heading)[1:]
        size = float(np.abs(left).max())
        if math.isfinite(size) and (not best or size < best[0][0]):
            best[:] = [(size, whole)]
        return left

    guess = first_guess(problem, p) if near is None else _unknowns(near, len(problem.lowest))
    limits = [np.delete(part, THROTTLE) for part in (problem.lowest, problem.highest)]
    longest = None if problem.longest is None else np.delete(problem.longest, THROTTLE)
    held = Problem(others, limits[0], limits[1], problem.difference, longest, problem.slow)
    correct(held, np.array([*p, problem.highest[THROTTLE]]), np.delete(guess, THROTTLE))
    return shortfall.lacking(fdm, problem, p, best[0][1], heading) if best else "its forces are not finite"


def _stated(fdm: Instance, start: Start) -> tuple[float, float, float, Problem]:
    """Airspeed, climb angle and heading of the start's velocity through the air, and the trims there."""
    air, _ = place(fdm, start)
    speed = float(np.linalg.norm(air))
    if not speed > 0:
        raise FdmError(f"{fdm.airframe.name} cannot fly at airspeed {speed:g} m/s")
    heading, climb = math.atan2(air[1], air[0]), math.asin(-air[2] / speed)
    fdm.nodes["on"].set_double_value(0.0)
    return speed, climb, heading, trim_problem(fdm, heading, speed, climb, air)


def _trim_at(fdm: Instance, x: Array, speed: float, climb: float, heading: float) -> Trim:
    roll, above, aside, elevator, aileron, throttle, *rudder = map(float, x)
    alpha, beta = fdm.nodes["alpha"].get_double_value(), fdm.nodes["beta"].get_double_value()
    return Trim(
        roll, climb + above, heading + aside, alpha, beta, elevator, aileron, throttle, speed, *rudder
    )


def _unknowns(at: Trim, count: int) -> Array:
    """A trim as unknowns, its sideslip and climb taken as none."""
    found = [at.roll, at.alpha, 0.0, at.elevator, at.aileron, at.throttle, at.rudder]
    return np.array(found[:count])


def trim_problem(fdm: Instance, heading: float, speed: float, climb: float, air: Array) -> Problem:
    """Trims at p = (airspeed [m/s], climb angle [rad], turn rate [rad/s]), by default at the place last set.

    heading  of the velocity through the air [rad, clockwise from north]
    air      m/s, north-east-down: the velocity at `speed` and `climb` as the caller has it, to the last bit
    """

    def residuals(p: Array, x: Array) -> Array:
        velocity = air if p[0] == speed and p[1] == climb else velocity_of(p[0], p[1], heading)
        commands = {"elevator": x[ELEVATOR], "aileron": x[AILERON], "throttle": x[THROTTLE]}
        if len(x) > RUDDER:
            commands["rudder"] = x[RUDDER]
        for name, value in commands.items():
            fdm.nodes[name].set_double_value(float(value))
        initialise(fdm, (x[0], p[1] + x[1], heading + x[2]), velocity, -p[2])
        settle(fdm)
        return balance(fdm)

    lowest, highest = bounds(fdm, fdm.airframe.engines.idle, fdm.airframe.engines.full)
    if not is_captive(fdm):
        return Problem(residuals, lowest, highest)
    longest = np.array(_LONGEST[: len(lowest)])
    return Problem(residuals, lowest, highest, _CAPTIVE_DIFFERENCE, longest, slow=True)


def velocity_of(speed: float, climb: float, heading: float) -> Array:
    """North-east-down [m/s]."""
    level = speed * math.cos(climb)
    return np.array([level * math.cos(heading), level * math.sin(heading), -speed * math.sin(climb)])


def bounds(fdm: Instance, low: float, high: float) -> tuple[Array, Array]:
    """Of the unknowns; low and high are those of the throttle or the climb angle."""
    ends = [(-math.pi, math.pi)] * 3 + [(-1.0, 1.0), (-1.0, 1.0), (low, high)]
    ends += [(-1.0, 1.0)] * fdm.airframe.has_rudder
    lowest, highest = np.array(ends).T
    return lowest, highest


def first_guess(problem: Problem, p: Array) -> Array:
    """Where a direct solution of a trim begins: a coordinated bank and a small angle of attack."""
    bank = -math.atan(p[0] * p[2] / G_MPS2)
    guess = [bank, _LEVEL_ALPHA_RAD / math.cos(bank), 0.0, 0.0, 0.0, _LEVEL_THROTTLE, 0.0]
    return np.array(guess[: len(problem.lowest)])


def find(
    fdm: Instance,
    problem: Problem,
    p: Array,
    heading: float,
    speeds: Sequence[float],
    guess: Array | None = None,
) -> tuple[Array | None, str]:
    """A trim at p, directly or by continuation from level flight; or None, and what is missing.

    heading  as the problem has it
    speeds   m/s, of the level flights to continue from, after that at p's airspeed
    The model is left evaluated at the trim, once: forces due to accelerations remember the last evaluation.
    """
    found = None
    if is_captive(fdm):  # each evaluation waits for the engines: try what needs the fewest
        more = first_guess(problem, p)
        more[THROTTLE] = _MORE_THROTTLE
        for near in ([] if guess is None else [guess]) + [first_guess(problem, p), more]:
            found = correct(problem, p, near)
            if found is not None:
                break
    if found is None:
        found = solve(problem, p, first_guess(problem, p))
    ends: list[Array] = []
    for speed in dict.fromkeys((float(p[0]), *speeds)):
        if found is not None:
            break
        level = np.array([speed, 0.0, 0.0])
        x = solve(problem, level, first_guess(problem, level))
        if x is None:
            continue
        limits = shortfall.throttle_limits(fdm, problem, level, x, p, heading)
        if limits is not None:
            if limits.missing:
                return None, limits.missing
            found = correct(problem, p, limits.guess)
        for way in _ways(problem, level, x, p) if found is None else ():
            ends.append(way.x)
            if way.arrived:
                found = way.x
                break
    if found is None:
        return None, shortfall.missing(fdm, problem, p, [first_guess(problem, p), *ends], heading)
    return found, ""


def _ways(problem: Problem, level: Array, x: Array, p: Array) -> Iterator[Reached]:
    """Continuations from level flight to p: straight, then turning before climbing, then the reverse."""
    yield follow(problem, level, x, p)
    for corner in ([p[0], 0.0, p[2]], [p[0], p[1], 0.0]):
        first = follow(problem, level, x, np.array(corner))
        if first.arrived:
            yield follow(problem, first.p, first.x, p)
