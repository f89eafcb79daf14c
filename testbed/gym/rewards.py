"""Rewards: what a vehicle is given for one filter period; the default, and the check of one of your own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from numbers import Real

import numpy as np

from filters.model import Array
from testbed.errors import UserError
from testbed.simulation.step import Step

LOSS = 100.0


@dataclass(frozen=True, eq=False)
class Transition:
    """One filter period of one vehicle.

    vehicle     its place in the arrays, from 0
    before      where the session stood
    after       where it stands now; `after.nominal` is what the vehicle asked for, `after.decision.command`
                what it was given by the filter
    goal        (3,) m
    distance_m  to the nearest other vehicle at `after`, true; inf if there is none
    d_safe_m    the scenario's Ds
    """

    vehicle: int
    before: Step
    after: Step
    goal: Array
    distance_m: float
    d_safe_m: float


Reward = Callable[[Transition], float]


def progress(t: Transition) -> float:
    """Metres that the vehicle came nearer to its goal, less 100 if another is nearer than Ds at the end."""
    far = [float(np.linalg.norm(step.state.position[t.vehicle] - t.goal)) for step in (t.before, t.after)]
    return far[0] - far[1] - (LOSS if t.distance_m < t.d_safe_m else 0.0)


def rewarded(reward: Reward, t: Transition) -> float:
    """What `reward` gives. UserError if it is no finite number."""
    value = reward(t)
    if isinstance(value, Real | np.floating | np.integer) and isfinite(value):
        return float(value)
    name = getattr(reward, "__name__", type(reward).__name__)
    raise UserError(
        f"reward {name}: it returned {value!r} for vehicle {t.vehicle + 1} at {t.after.t:.3f} s;"
        " return a finite number"
    )
