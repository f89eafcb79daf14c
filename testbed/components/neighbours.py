"""Makes what a large fleet's filter and judge need to know: which pairs can matter."""

from __future__ import annotations

from filters.barriers.closed_form import TurnBarrier
from filters.barriers.pairs import Barrier
from filters.barriers.reach import Neighbours
from filters.constraints import Alpha
from filters.model import Limits
from testbed.scenario.near_pairs import near_only
from testbed.scenario.scenario import Scenario


def neighbours(s: Scenario, barrier: Barrier, alpha: Alpha, limits: Limits) -> Neighbours | None:
    """Of a scenario whose runs look at near pairs only; None where they look at all."""
    if not near_only(s) or not isinstance(barrier, TurnBarrier):
        return None
    reach = barrier.reach(s.vehicles)
    if reach is None:
        return None
    return Neighbours(reach, reach.binding(alpha, limits, barrier.manoeuvre(s.vehicles)))
