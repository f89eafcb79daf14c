"""Poses and solves the programs of the receding-horizon filter: each vehicle's plan nearest to its target.

Distances are linear about the plans of the period before. With e the unit vector from j to i on those plans
and s their clearance, vehicle i keeps e (P_i - P_i before) >= -(kappa / 2) max(s, 0) at each sample, and j
the same with -e. So each solves a program of its own, and the plan before keeps every row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.constraints import Indices
from filters.flow.reach import Reach
from filters.flow.rollout import Begun, Flow, Paths
from filters.flow.separation import Rows
from filters.model import Array
from filters.qp import single
from filters.rivals.plans import covered

# There is a row at every so many instants, at all where a pair's slack is less than this [m], and at so many
# phases [rad] from the one at which the circles are nearest.
STRIDE, NEAR_M = 3, 15.0
PHASES = np.radians([0.0, 3.0, 8.0, 20.0, 45.0, 90.0, 180.0, -3.0, -8.0, -20.0, -45.0, -90.0])
# Programs aim at so much more than rows ask, so that what their slopes miss is nothing [m].
AIM_M, TOLERANCE_M = 5e-4, 1e-6
# Shares of the way from the plan before to the program's solution, tried in turn.
DRAWN = (0.9, 0.7, 0.4, 0.15)
# Slopes are differences over this share of a channel's range at least.
STEP = 0.05
# Programs solved in turn, and the share of a channel's range by which each may move.
ROUNDS, TRUSTED = 4, 0.4
# Rows that a round adds of each vehicle and whom it meets.
ADDED = 8


def rows(base: Paths, i: Indices, j: Indices, level: float, kappa: float, reach: Reach) -> Rows:
    """The rows of pairs (i, j) about the plans before, those left out that no input can break.

    base   (N, M) paths of the plans before
    level  m, Ds + m
    """
    flat, up = base.at[i] - base.at[j], base.z[i] - base.z[j]
    between, swing = base.centre[i] - base.centre[j], base.arm[i] - base.arm[j]
    turn = np.exp(1j * (np.angle(-between * np.conj(swing))[:, None] + PHASES))
    late = between[:, None] + swing[:, None] * turn
    high = np.repeat(up[:, -1:], PHASES.size, axis=1)
    early = _of_both(i, j, flat, up, level, kappa, reach.at, STRIDE)
    later = _of_both(i, j, late, high, level, kappa, np.repeat(reach.circle[:, None], PHASES.size, axis=1), 1)
    pair, vehicle, other, along, rise, share = (
        np.concatenate([a, b]) for a, b in zip(early[:-1], later[:-1], strict=True)
    )
    split = early[0].size
    return Rows(
        vehicle,
        other,
        along,
        rise,
        -np.maximum(share, 0.0),
        np.maximum(-share, 0.0),
        np.asarray(early[-1], dtype=np.intp),
        turn[pair[split:], later[-1]],
    )


def _of_both(
    i: Indices, j: Indices, apart: Array, up: Array, level: float, kappa: float, reach: Array, stride: int
) -> tuple[Array, ...]:
    """Of rows of either vehicle: pair, vehicle, the other, unit vector (level, up), share, sample.

    apart, up  (P, S) complex and real m, from j to i at samples
    reach      (N, S) m, how far any input can move a vehicle there
    """
    distance = np.sqrt(apart.real**2 + apart.imag**2 + up**2)
    share = 0.5 * kappa * (distance - level)
    looked_at = (np.arange(up.shape[1]) % stride == 0) | (distance < level + NEAR_M)
    found = []
    for vehicle, other, sign in ((i, j, 1.0), (j, i, -1.0)):
        p, k = np.nonzero(looked_at & (np.maximum(share, 0.0) < reach[vehicle]))
        scale = sign / np.maximum(distance[p, k], 1e-9)
        found.append((p, vehicle[p], other[p], apart[p, k] * scale, up[p, k] * scale, share[p, k], k))
    return tuple(np.concatenate([a, b]) for a, b in zip(*found, strict=True))


def chosen(rows: Rows, which: Indices) -> Rows:
    """Some rows, by increasing index."""
    split = rows.instant.size
    early = which[which < split]
    return Rows(
        rows.vehicle[which],
        rows.other[which],
        rows.along[which],
        rows.up[which],
        rows.least[which],
        rows.back[which],
        rows.instant[early],
        rows.turn[which[early.size :] - split],
    )


@dataclass(frozen=True, eq=False)
class Programs:
    """The programs of V vehicles whose target plans break rows.

    rows            their rows, about the paths `base` of the plans `before` (V, K, 3)
    lasts, weight   (K,) s, and the weight in the cost, of the blocks
    target          (V, K, 3) plans, inside the box
    lower, upper    (V, 3) the box
    """

    begun: Begun
    flow: Flow
    rows: Rows
    base: Paths
    lasts: Array
    weight: Array
    before: Array
    target: Array
    lower: Array
    upper: Array

    def paths(self, plan: Array) -> Paths:
        """The exact flow of plans (..., V, K, 3)."""
        lasts = np.broadcast_to(self.lasts, plan.shape[:-1])
        return self.flow.paths(self.begun, covered(self.begun, plan, lasts))

    def plans(self) -> Array:
        """Plans (V, K, 3) near the targets that keep every row on the exact flow, or those before.

        From the target's first command with the plan before after it, programs with slopes about the last
        solution are solved in turn; the cheapest plan on the way that keeps every row is taken.
        """
        made, aim = self.rows, self.rows.least + AIM_M
        group = made.vehicle * (int(made.other.max(initial=0)) + 1) + made.other
        plan, best = self.before.copy(), self.before.copy()
        plan[:, 0] = self.target[:, 0]
        cheapest, kept = self._cost(best), np.zeros(made.vehicle.size, dtype=bool)
        there = made.displacement(self.paths(np.stack([plan, self.target])), self.base)
        self._add(kept, there[1] - aim, group)
        there = there[0]
        for k in range(ROUNDS + 1):
            cost = np.where(self._keeps(there), self._cost(plan), np.inf)
            better = cost < cheapest
            best[better], cheapest = plan[better], np.minimum(cost, cheapest)
            if k == ROUNDS:
                break
            self._add(kept, there - aim, group)
            use = np.flatnonzero(kept)
            slope = self._slopes(plan, use, there[use])
            level = aim[use] - there[use] + np.einsum("rkc,rkc->r", slope, plan[made.vehicle[use]])
            for v in range(len(plan)):
                own = made.vehicle[use] == v
                plan[v] = self._nearest(v, slope[own], level[own], plan[v])
            there = made.displacement(self.paths(plan), self.base)
        return self._drawn(best, cheapest, plan)

    @staticmethod
    def _add(kept: NDArray[np.bool_], spare: Array, group: Indices) -> None:
        """Keep of each vehicle and whom it meets the rows that are broken most."""
        broken = np.flatnonzero(spare < -0.5 * AIM_M)
        # By group, the worst first: of each as many as are added.
        order = broken[np.lexsort((spare[broken], group[broken]))]
        first = np.searchsorted(group[order], group[order])
        kept[order[np.arange(order.size) - first < ADDED]] = True

    def _keeps(self, there: Array) -> NDArray[np.bool_]:
        """Which vehicles (..., V) keep all their rows, of displacements (..., R) m."""
        made = self.rows
        fails = there < made.least - TOLERANCE_M
        found = np.ones((*there.shape[:-1], len(self.before)), dtype=bool)
        for v in range(len(self.before)):
            found[..., v] = ~fails[..., made.vehicle == v].any(axis=-1)
        return found

    def _cost(self, plan: Array) -> Array:
        """The costs (..., V) of plans."""
        ranges = np.maximum(self.upper - self.lower, 1e-9)[:, None]
        return np.asarray((((plan - self.target) / ranges) ** 2 * self.weight[:, None]).sum(axis=(-2, -1)))

    def _slopes(self, plan: Array, some: Indices, there: Array) -> Array:
        """Mean slopes (S, K, 3) of some rows from plans, displaced by `there` (S,) m, to those before."""
        ranges = (self.upper - self.lower)[:, None]
        # A channel at its largest rate does not hear small changes of its command.
        little = STEP * np.where(2 * plan < (self.upper + self.lower)[:, None], ranges, -ranges)
        step = self.before - plan
        step = np.where(np.abs(step) > np.abs(little), step, little)
        count = plan.shape[1]
        one = np.eye(3 * count).reshape(3 * count, 1, count, 3)
        moved = chosen(self.rows, some).displacement(self.paths(plan + one * step), self.base) - there
        each = np.where(np.abs(step) > 0, step, np.inf)
        return np.asarray(moved.T.reshape(-1, count, 3) / each[self.rows.vehicle[some]])

    def _nearest(self, v: int, slope: Array, level: Array, about: Array) -> Array:
        """The plan (K, 3) nearest to the target with slope u >= level, not far from `about`."""
        ranges = self.upper[v] - self.lower[v]
        scale = np.where(ranges > 0, ranges, 1.0) / np.sqrt(self.weight)[:, None]
        lower = np.maximum(self.lower[v], about - TRUSTED * ranges)
        upper = np.minimum(self.upper[v], about + TRUSTED * ranges)
        target, low, high = ((x / scale).ravel() for x in (self.target[v], lower, upper))
        u = single.solve(target, (slope * scale).reshape(level.size, -1), level, low, high).u
        return np.asarray(np.minimum(np.maximum(u.reshape(scale.shape) * scale, lower), upper))

    def _drawn(self, best: Array, cheapest: Array, plan: Array) -> Array:
        """The best plans (V, K, 3), or where one is cheaper: between the last solutions and those before."""
        share = np.array(DRAWN)[:, None, None, None]
        first = np.zeros(plan.shape[1:])
        first[0] = 1.0
        drawn = self.before + share * (plan - self.before)
        tried = np.concatenate([drawn, np.where(first > 0, drawn, self.before)])
        kept = self._keeps(self.rows.displacement(self.paths(tried), self.base))
        cost = np.where(kept, self._cost(tried), np.inf)
        for v in np.flatnonzero(cost.min(axis=0) < cheapest):
            best[v] = tried[int(np.argmin(cost[:, v])), v]
        return best
