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

# Every so many instants there is a row, and at so many phases [rad] beside the one where circles are nearest.
STRIDE = 3
PHASES = np.radians([0.0, 3.0, 8.0, 20.0, 45.0, 90.0, 180.0, -3.0, -8.0, -20.0, -45.0, -90.0])
# Programs aim at so much more than rows ask, so that what their slopes miss is nothing [m].
AIM_M, TOLERANCE_M = 5e-4, 1e-6
# Shares of the way from the plan before to the program's solution, tried in turn.
DRAWN = (1.0, 0.9, 0.7, 0.4, 0.15)
_ROUNDS = 6


def rows(base: Paths, i: Indices, j: Indices, level: float, kappa: float, reach: Reach) -> Rows:
    """The rows of pairs (i, j) about the plans before, those left out that no input can break.

    base   (N, M) paths of the plans before
    level  m, Ds + m
    """
    instants = np.unique(np.append(np.arange(0, base.z.shape[-1], STRIDE), base.z.shape[-1] - 1))
    flat = base.at[i][:, instants] - base.at[j][:, instants]
    up = base.z[i][:, instants] - base.z[j][:, instants]
    between, swing = base.centre[i] - base.centre[j], base.arm[i] - base.arm[j]
    turn = np.exp(1j * (np.angle(-between * np.conj(swing))[:, None] + PHASES))
    late = between[:, None] + swing[:, None] * turn
    high = np.repeat(up[:, -1:], PHASES.size, axis=1)
    early = _of_both(i, j, flat, up, level, kappa, reach.at[:, instants])
    later = _of_both(i, j, late, high, level, kappa, np.repeat(reach.circle[:, None], PHASES.size, axis=1))
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
        instants[early[-1]],
        turn[pair[split:], later[-1]],
    )


def _of_both(
    i: Indices, j: Indices, apart: Array, up: Array, level: float, kappa: float, reach: Array
) -> tuple[Array, ...]:
    """Of rows of either vehicle: pair, vehicle, the other, unit vector (level, up), share, sample.

    apart, up  (P, S) complex and real m, from j to i at samples
    reach      (N, S) m, how far any input can move a vehicle there
    """
    distance = np.sqrt(apart.real**2 + apart.imag**2 + up**2)
    share = 0.5 * kappa * (distance - level)
    found = []
    for vehicle, other, sign in ((i, j, 1.0), (j, i, -1.0)):
        p, k = np.nonzero(np.maximum(share, 0.0) < reach[vehicle])
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
        """Plans (V, K, 3) near the targets that keep every row on the exact flow, or those before."""
        made, plan, aim = self.rows, self.target.copy(), self.rows.least + AIM_M
        there = made.displacement(self.paths(plan), self.base)
        step = self._step()
        count = plan.shape[1]
        one = np.eye(3 * count).reshape(3 * count, 1, count, 3)
        tried = self.paths(self.before + one * step)
        group = made.vehicle * (int(made.other.max(initial=0)) + 1) + made.other
        slope, kept = np.zeros((made.vehicle.size, count, 3)), np.zeros(made.vehicle.size, dtype=bool)
        for _ in range(_ROUNDS):
            broken = np.flatnonzero(there < aim - 0.5 * AIM_M)
            if not broken.size:
                break
            # Of each vehicle and whom it meets the row that is broken most.
            worst = broken[np.argsort((there - aim)[broken], kind="stable")]
            new = np.sort(worst[np.unique(group[worst], return_index=True)[1]])
            new = new[~kept[new]]
            kept[new] = True
            moved = chosen(made, new).displacement(tried, self.base)
            slope[new] = moved.T.reshape(-1, count, 3) / step[made.vehicle[new]]
            use = np.flatnonzero(kept)
            at = plan[made.vehicle[use]]
            level = aim[use] - there[use] + np.einsum("rkc,rkc->r", slope[use], at)
            for v in np.unique(made.vehicle[broken]):
                own = made.vehicle[use] == v
                plan[v] = self._nearest(int(v), slope[use][own], level[own])
            there = made.displacement(self.paths(plan), self.base)
        return self._drawn(plan, there)

    def _step(self) -> Array:
        """By how much (V, K, 3) each command is changed for its slope: to the target, or a little."""
        ranges = (self.upper - self.lower)[:, None]
        step = self.target - self.before
        little = 0.05 * np.where(2 * self.before < (self.upper + self.lower)[:, None], ranges, -ranges)
        step = np.where(np.abs(step) > 0.05 * ranges, step, little)
        return np.where(np.abs(step) > 0, step, np.inf)

    def _nearest(self, v: int, slope: Array, level: Array) -> Array:
        """The plan (K, 3) nearest to the target with slope u >= level."""
        ranges = self.upper[v] - self.lower[v]
        scale = np.where(ranges > 0, ranges, 1.0) / np.sqrt(self.weight)[:, None]
        target, lower, upper = ((x / scale).ravel() for x in (self.target[v], self.lower[v], self.upper[v]))
        u = single.solve(target, (slope * scale).reshape(level.size, -1), level, lower, upper).u
        found = u.reshape(scale.shape) * scale
        return np.asarray(np.minimum(np.maximum(found, self.lower[v]), self.upper[v]))

    def _drawn(self, plan: Array, there: Array) -> Array:
        """The plans, drawn towards those before until every row holds."""
        made = self.rows
        fails = np.unique(made.vehicle[~(there >= made.least - TOLERANCE_M)])
        if not fails.size:
            return plan
        share = np.array(DRAWN)[:, None, None, None]
        tried = self.before + share * (plan - self.before)
        kept: NDArray[np.bool_] = made.displacement(self.paths(tried), self.base) >= made.least - TOLERANCE_M
        for v in fails:
            good = np.flatnonzero(kept[:, made.vehicle == v].all(axis=1))
            plan[v] = tried[good[0], v] if good.size else self.before[v]
        return plan
