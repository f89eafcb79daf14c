"""Works out how far the vehicles of a scenario must know of each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.barriers.pairs import all_pairs
from filters.barriers.required_range import required_range
from testbed.components import catalogue, remedies
from testbed.environment.known_range import unseen_steps
from testbed.scenario.scenario import Scenario

NONE = "no finite range is enough: vehicles that do not turn at one rate may meet, however far apart they are"


@dataclass(frozen=True)
class Needed:
    """The range that a scenario needs.

    range_m   the largest of all pairs; inf where no finite range is enough, 0 without a pair
    vehicles  that pair, from 1
    unseen_s  longest time between a pair out of range and the first decision that knows of it
    at_once   what it would be if that time were 0
    """

    range_m: float
    vehicles: tuple[int, ...]
    unseen_s: float
    at_once: float


def needed(s: Scenario) -> Needed:
    """The range with which h >= 0 whenever two vehicles first know of each other, by the filter's barrier."""
    dt = s.rates.filter_dt_s
    unseen = unseen_steps(s.sensing.delay_s + s.network.latency_s, dt) * dt
    i, j = all_pairs(s.vehicles)
    if not i.size:
        return Needed(0.0, (), unseen, 0.0)
    barrier, limits = catalogue.barrier(remedies.scenario(s)), catalogue.limits(s)
    each = required_range(barrier, limits, unseen)
    p = int(np.argmax(each))
    at_once = float(required_range(barrier, limits, 0.0).max())
    return Needed(float(each[p]), (int(i[p]) + 1, int(j[p]) + 1), unseen, at_once)
