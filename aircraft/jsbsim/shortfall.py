"""Says which force or moment is missing where an aircraft has no steady flight.

The unknowns of a trim are those of `aircraft.jsbsim.steady`. Flight at a given throttle that balances
everything but the force along the path nearly always exists; the force that idle and full throttle leave
along the path tells what is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.jsbsim.continuation import BALANCED, Problem, follow, nearest
from aircraft.jsbsim.geodesy import M_PER_FT
from aircraft.jsbsim.rest import ACCELERATIONS, Instance, rotation

Array = NDArray[np.float64]

ELEVATOR, AILERON, THROTTLE, RUDDER = 3, 4, 5, 6  # places among a trim's unknowns
_AT_LIMIT = 1e-3  # of a command's range
_MOMENTS = 3.0  # weight of moments beside forces where not everything can be balanced


def balance(fdm: Instance) -> Array:
    """Accelerations left in body axes [ft/s^2, rad/s^2] (6,); with a rudder and the sideslip (7,)."""
    names = (*ACCELERATIONS, "beta") if fdm.airframe.has_rudder else ACCELERATIONS
    return np.array([fdm.nodes[name].get_double_value() for name in names])


def in_path_axes(fdm: Instance, p: Array, x: Array, heading: float) -> Array:
    """`balance` with the forces along the path, level to its right, and upwards across both."""
    left = balance(fdm)
    to_path = rotation(0.0, p[1], heading).T @ rotation(x[0], p[1] + x[1], heading + x[2])
    forces = to_path @ left[:3]
    return np.array([*forces[:2], -forces[2], *left[3:]])


@dataclass(frozen=True)
class ThrottleLimits:
    """Why idle or full throttle rules a trim out, "" if neither does; and a guess of the trim."""

    missing: str
    guess: Array


def throttle_limits(
    fdm: Instance, problem: Problem, level: Array, x: Array, p: Array, heading: float
) -> ThrottleLimits | None:
    """Follow level flight x, at the parameters `level`, to p at idle and at full throttle.

    None where something other than the throttle ends one of the ways.
    """

    def residuals(at: Array, unknown: Array) -> Array:
        whole = np.insert(unknown, THROTTLE, at[3])
        problem.residuals(at[:3], whole)
        return in_path_axes(fdm, at, whole, heading)[1:]

    lowest, highest = np.delete(problem.lowest, THROTTLE), np.delete(problem.highest, THROTTLE)
    held = Problem(residuals, lowest, highest)
    start, unknown = np.array([*level, x[THROTTLE]]), np.delete(x, THROTTLE)
    found, left = [], []
    for throttle in (problem.lowest[THROTTLE], problem.highest[THROTTLE]):
        reached = follow(held, start, unknown, np.array([*p, throttle]))
        if not reached.arrived:
            return None
        whole = np.insert(reached.x, THROTTLE, throttle)
        problem.residuals(p, whole)
        found.append(whole)
        left.append(in_path_axes(fdm, p, whole, heading)[0])
    (idle, full), (slows, gains) = found, left
    if gains < 0:
        return ThrottleLimits(f"thrust is short by {-gains * M_PER_FT:.2g} m/s^2{_at(p, full)}", full)
    if slows > 0:
        return ThrottleLimits(f"drag is short by {slows * M_PER_FT:.2g} m/s^2{_at(p, idle)}", idle)
    share = slows / (slows - gains) if slows < gains else 0.5
    return ThrottleLimits("", idle + share * (full - idle))


def missing(fdm: Instance, problem: Problem, p: Array, guesses: Sequence[Array], heading: float) -> str:
    """The largest force or moment that the nearest flight to p leaves, and that flight's commands."""

    def weighed(at: Array, x: Array) -> Array:
        left = problem.residuals(at, x)
        return np.concatenate([left[:3], _MOMENTS * left[3:]])

    x = nearest(Problem(weighed, problem.lowest, problem.highest), p, guesses)
    return lacking(fdm, problem, p, x, heading)


def lacking(fdm: Instance, problem: Problem, p: Array, x: Array, heading: float) -> str:
    """The largest force or moment that the flight with unknowns x leaves at p, and its commands."""
    problem.residuals(p, x)
    left = in_path_axes(fdm, p, x, heading)
    along, aside, up = left[:3] * M_PER_FT
    lacks = {
        f"{'thrust' if along < 0 else 'drag'} is short by {abs(along):.2g} m/s^2": abs(along),
        f"side force is short by {abs(aside):.2g} m/s^2": abs(aside),
        f"lift is {'short' if up < 0 else 'too large'} by {abs(up):.2g} m/s^2": abs(up),
    }
    for axis, moment in zip(("rolling", "pitching", "yawing"), left[3:6], strict=True):
        lacks[f"{axis} moment is off by {abs(moment):.2g} rad/s^2"] = abs(moment)
    worst = max(lacks, key=lambda text: lacks[text])
    if lacks[worst] < BALANCED:
        worst = "no balance was found"
    return worst + _at(p, x)


def _at(p: Array, x: Array) -> str:
    """The airspeed and the commands, those named that are at their limits."""
    said = []
    for name, k, low in (
        ("elevator", ELEVATOR, -1.0),
        ("aileron", AILERON, -1.0),
        ("throttle", THROTTLE, 0.0),
    ):
        limit = " (its limit)" if min(abs(x[k] - low), abs(x[k] - 1.0)) < _AT_LIMIT else ""
        said.append(f"{name} {round(float(x[k]), 2) + 0.0:.2f}{limit}")  # never "-0.00"
    return f" at airspeed {p[0]:.2f} m/s with {', '.join(said)}"
