"""Chooses the pairs that a stretch of a large fleet's flight is judged by, so that no least value is missed.

A pair that is left out is proved to have no distance, no h and no rate of h that is less than one that is
counted: vehicles have moved by no more than they did, circles come no nearer than their centres allow
(`filters.barriers.reach`), and what is counted, so far or in this stretch, is less than those bounds. Where
that cannot be shown the stretch takes more pairs, in the end all.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from filters.barriers.pairs import FEW, Barrier, all_pairs
from filters.barriers.reach import Neighbours, Pairs, within
from filters.cbf.collision import CollisionFilter
from filters.constraints import Alpha
from filters.model import Array, Limits, State
from filters.qp.single import Status
from testbed.components import catalogue
from testbed.components.neighbours import neighbours
from testbed.measures.run_statistics import RunStatistics
from testbed.simulation.assembly import Assembled, Setting
from testbed.simulation.step_buffer import StepBuffer

# How far paths may leave the lines between samples [m]: far more than at any period that is allowed.
BENDS_M = 5.0
_GROWS = 1.5


@dataclass(frozen=True, eq=False)
class NearPairs:
    """Chooses pairs of a stretch.

    record   m, pairs are recorded whose h is at most this
    solves   whether the filter solves QPs, whose rows are judged
    dt       s, filter period
    """

    near: Neighbours
    barrier: Barrier
    alpha: Alpha
    limits: Limits
    record: float
    solves: bool
    dt: float

    def at_start(self, start: State) -> Pairs:
        """The pairs among which the nearest one is, at the start."""
        places, apart = start.position[:, :2], 10.0 * self.barrier.d_safe
        while not (found := within(places, apart))[0].size:
            apart *= 2.0
        i, j = found
        # Heights come on top: the nearest in the plane is no further than that, the nearest of all neither.
        nearest = np.linalg.norm(start.position[i] - start.position[j], axis=-1).min()
        return within(places, float(nearest))

    def of(self, steps: StepBuffer, statistics: RunStatistics) -> Pairs:
        """The pairs for the steps in `steps`, the motion after them included."""
        reach, n = self.near.reach, steps.vehicles
        truth = steps.truth[: steps.count]
        poses = [State.of(pose) for pose in truth]
        centres = np.array([reach.centres(pose) for pose in poses])
        places = np.concatenate([truth[:, :, [0, 1, 3]], steps.track[: steps.moved * steps.periods]])
        moved = _furthest(centres), _furthest(places)
        apart = reach.apart(self.record) + 2.0 * moved[0]
        rate, here = self._rate(steps, poses), poses[min(steps.seen, steps.count - 1)]
        solved = steps.status[min(steps.seen, steps.count - 1)] == Status.SOLVED
        for _ in range(64):
            i, j = within(centres[0], apart)
            if i.size == n * (n - 1) // 2:
                break
            if i.size > FEW:
                h = self.barrier.values(here, i, j).h
                sure = (h >= 0.0) & (solved[i] & solved[j] if self.solves else True)
                if self._enough(apart, moved, rate, steps, statistics, h, h[sure]):
                    return i, j
            apart *= _GROWS
        return all_pairs(n)

    def _rate(self, steps: StepBuffer, poses: list[State]) -> float:
        """No pair's h changed faster [m/s] in these steps, nor would under any input within the limits."""
        reach = self.near.reach
        low, high = self.limits.corners
        most = np.maximum(np.abs(low), np.abs(high))
        found = [reach.rate(*most.T), reach.rate(*steps.command[: steps.count].reshape(-1, 3).T)]
        for before, after in pairwise(poses):
            moved = np.linalg.norm(after.position - before.position, axis=-1) / self.dt
            turned = (after.theta - before.theta) / self.dt
            found.append(reach.rate(moved, turned, np.zeros(1)))
        return 2.0 * max(found)

    def _enough(
        self,
        apart: float,
        moved: tuple[float, float],
        rate: float,
        steps: StepBuffer,
        statistics: RunStatistics,
        h: Array,
        sure: Array,
    ) -> bool:
        """Whether no pair whose centres are `apart` or more at first has a least value in these steps.

        h     of the pairs taken, at a step that is new
        sure  of those that are counted there in every claim
        """
        least_h = self.near.reach.least_h(apart - 2.0 * moved[0])
        if not least_h >= 0.0:
            return False
        distance = apart - 2.0 * (self.near.reach.largest + moved[1] + BENDS_M)
        least_rate = float(self.alpha(np.asarray(least_h))) - rate
        claims = [statistics.admissible, statistics.condition, *([statistics.rows] if self.solves else [])]
        most = max(float(extreme.value.min(initial=np.inf)) for extreme in claims)
        if sure.size:
            # By the end of these steps its h may be larger.
            later = float(sure.min()) + rate * self.dt * steps.count
            most = min(most, float(self.alpha(np.asarray(later))) + rate)
        smallest_h = min(float(statistics.h.value.min(initial=np.inf)), float(h.min()))
        nearest = float(statistics.separation.value.min(initial=np.inf))
        return nearest <= distance and smallest_h <= least_h and most <= least_rate


def near_pairs(setting: Setting, own: Container[str]) -> NearPairs | None:
    """What chooses the near pairs of a run; None where all pairs are looked at.

    own  the parts that are a user's: of their filters and environments no bound is known
    """
    s, alpha = setting.scenario, catalogue.alpha(setting.scenario)
    found = neighbours(s, setting.barrier, alpha, setting.limits)
    if found is None or "filter" in own or "disturbance" in own:
        return None
    solves = s.filter.kind != "none"
    rest = setting.limits, found.h, solves, s.rates.filter_dt_s
    return NearPairs(found, setting.barrier, alpha, *rest)


def with_near_filter(made: Assembled, near: NearPairs | None) -> Assembled:
    """The parts, the scenario's own filter looking at near pairs where the run does."""
    if near is None or not isinstance(made.filter, CollisionFilter):
        return made
    return replace(made, filter=made.filter.looking_at(near.near))


def _furthest(places: Array) -> float:
    """m, the longest way of a vehicle from its first place: places (S, N, k)."""
    way = places - places[0]
    return float(np.sqrt((way * way).sum(axis=-1)).max(initial=0.0))
