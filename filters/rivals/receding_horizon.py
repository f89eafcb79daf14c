"""Plans some seconds ahead, flies the plan's first command, plans anew: a predictive safety filter.

Wabersich & Zeilinger, "A predictive safety filter for learning-based control of constrained nonlinear
dynamical systems", Automatica 129 (2021): the first command is the nearest to the nominal one for which a
trajectory that keeps the constraints and ends in a safe set exists; where the program has no solution, the
last plan is flown on.

The model is that of vehicles that lag. A plan is a command for one period, then blocks of `block_s`, then
gamma for ever; flying gamma for ever without coming nearer than Ds + m is the safe set at the end. Distances
are made linear about the plan of the period before: with e the unit vector from j to i on those plans and s
their clearance, vehicle i keeps e (P_i - P_i before) >= -(share / 2) max(s, 0) at instants one period apart
until the channels have settled, and on the circle after that, and j the same with -e. So each vehicle solves
a program of its own and none needs to know what the other chooses. The plan is checked on the exact flow, and
drawn back to the plan before as far as that is needed. The plan before keeps every row, so the program is
feasible again in the next period.

Premises: the vehicles follow the model; at the start all are clear of each other on gamma's flow; all
broadcast their plans once a period. Where errors have brought the plans before nearer than Ds + m, plans must
only get no nearer, and the status says INFEASIBLE.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.cbf.problem import Problem, input_set
from filters.filter import Decision, Declaration, MonitorRecord
from filters.flow.phases import Phases
from filters.flow.rollout import Begun, Flow, Paths, furthest
from filters.flow.separation import Kept, Rows, rows, samples
from filters.model import Array, Command, Limits, View
from filters.qp import single
from filters.qp.single import Status
from filters.rivals.gatekeeper import CLEAR_TO_M, plan_checks
from filters.rivals.plans import Model, covered

# Shares of the way from the plan before to the program's solution, tried in turn; the last keeps every row.
DRAWN = (1.0, 0.9, 0.7, 0.4, 0.15)
# Programs aim at so much more than rows ask, so that what their slopes miss is nothing [m].
AIM_M, TOLERANCE_M = 5e-4, 1e-6
_ROUNDS, _CORRECTIONS, _CHANGED = 8, 2, 1e-6


@dataclass(frozen=True, eq=False)
class Blocks:
    """The blocks of a plan (N, K, 3) that starts now.

    lasts   (K,) s; the first is one period, the second may have no length
    weight  (K,) of each block in the cost
    """

    lasts: Array
    weight: Array


@dataclass(frozen=True, eq=False)
class Posed:
    """The programs of V vehicles whose target plans break rows.

    rows            their rows, about the paths `base` of the plans `before` (V, K, 3)
    target          (V, K, 3) plans, inside the box
    lower, upper    (V, 3) the box
    """

    begun: Begun
    flow: Flow
    rows: Rows
    base: Paths
    blocks: Blocks
    before: Array
    target: Array
    lower: Array
    upper: Array

    def moved(self, plan: Array) -> Array:
        """Displacements (..., R) m of the exact flow of plans (..., V, K, 3)."""
        lasts = np.broadcast_to(self.blocks.lasts, plan.shape[:-1])
        return self.rows.displacement(
            self.flow.paths(self.begun, covered(self.begun, plan, lasts)), self.base
        )

    def plans(self) -> Array:
        """Plans (V, K, 3) near the targets that keep every row on the exact flow, or those before."""
        made, plan = self.rows, self.target
        slope, there = self._slopes(), self.moved(self.target)
        aim = made.least + AIM_M
        at, need = self.before, aim
        for _ in range(_CORRECTIONS):
            fails = _who(made, ~(there >= made.least - TOLERANCE_M), len(plan))
            if not fails.any():
                break
            level = need + np.einsum("rkc,rkc->r", slope, at[made.vehicle])
            found = np.stack(
                [self._nearest(v, slope, level) if fails[v] else plan[v] for v in range(len(plan))]
            )
            plan, there = found, self.moved(found)
            at, need = plan, aim - there
        return self._drawn(plan, there)

    def _drawn(self, plan: Array, there: Array) -> Array:
        """The plans, drawn towards those before until every row holds."""
        made = self.rows
        if (there >= made.least - TOLERANCE_M).all():
            return plan
        share = np.array(DRAWN)[:, None, None, None]
        tried = np.concatenate([self.before + share * (plan - self.before), self.before[None]])
        kept = self.moved(tried) >= made.least - TOLERANCE_M
        chosen = []
        for v in range(len(plan)):
            good = np.array(kept[:, made.vehicle == v].all(axis=1))
            good[-1] = True  # by construction, to rounding
            chosen.append(tried[int(np.argmax(good)), v])
        return np.stack(chosen)

    def _slopes(self) -> Array:
        """Displacements (R, K, 3) a unit of each command, as it moves towards the target, or a little."""
        ranges = (self.upper - self.lower)[:, None]
        step = self.target - self.before
        little = 0.05 * np.where(2 * self.before < (self.upper + self.lower)[:, None], ranges, -ranges)
        step = np.where(np.abs(step) > 0.05 * ranges, step, little)
        k = self.before.shape[1]
        one = np.eye(3 * k).reshape(3 * k, 1, k, 3)
        moved = self.moved(self.before + one * step)
        each = np.where(np.abs(step) > 0, step, np.inf)
        return np.asarray(moved.T.reshape(-1, k, 3) / each[self.rows.vehicle])

    def _nearest(self, v: int, slope: Array, level: Array) -> Array:
        """The plan (K, 3) nearest to the target with slope u >= level, its rows added as they are broken."""
        own = np.flatnonzero(self.rows.vehicle == v)
        ranges = self.upper[v] - self.lower[v]
        scale = np.where(ranges > 0, ranges, 1.0) / np.sqrt(self.blocks.weight)[:, None]
        matrix = (slope[own] * scale).reshape(own.size, -1)
        level, other = level[own], self.rows.other[own]
        lower, upper = (
            (np.broadcast_to(x, scale.shape) / scale).ravel() for x in (self.lower[v], self.upper[v])
        )
        target = (self.target[v] / scale).ravel()
        u, kept = target, np.zeros(own.size, dtype=bool)
        for _ in range(_ROUNDS):
            short = level - matrix @ u
            broken = np.flatnonzero((short > _CHANGED) & ~kept)
            if not broken.size:
                break
            # Of each vehicle that it meets the row that is broken most.
            worst = broken[np.argsort(-short[broken], kind="stable")]
            kept[worst[np.unique(other[worst], return_index=True)[1]]] = True
            u = single.solve(target, matrix[kept], level[kept], lower, upper).u
        found = u.reshape(scale.shape) * scale
        return np.asarray(np.minimum(np.maximum(found, self.lower[v]), self.upper[v]))


def _who(rows: Rows, which: NDArray[np.bool_], vehicles: int) -> NDArray[np.bool_]:
    """The vehicles (V,) of some rows (R,)."""
    found = np.zeros(vehicles, dtype=bool)
    found[rows.vehicle[which]] = True
    return found


class RecedingHorizonFilter:
    """Each vehicle's nearest plan to its nominal command, held, that keeps clear of the others' plans.

    model     of the vehicles; its margin is kept by all plans beyond Ds
    blocks    how many blocks of constant commands follow the first period
    block_s   s, how long each lasts, in filter periods
    later     weight of the blocks after the first period against it, in the cost
    share     how much of a pair's clearance on the plans one period may use up, in (0, 1)
    Raises    ValueError for numbers out of these ranges

    The cost divides each channel by its range.
    """

    def __init__(
        self,
        model: Model,
        blocks: int = 3,
        block_s: float = 1.0,
        later: float = 0.01,
        share: float = 0.5,
    ) -> None:
        dt = model.flow.dt
        if not (blocks >= 1 and round(block_s / dt) >= 1 and np.isfinite(block_s)):
            raise ValueError(f"a plan needs a block of a filter period ({dt:g} s) or more")
        if not (0 < later <= 1 and 0 < share < 1):
            raise ValueError(f"later must be in (0, 1] and share in (0, 1), got {later} and {share}")
        self._model, self._block, self._share = model, round(block_s / dt), share
        self._turn = float(model.flow.gamma[0, 1]) * dt
        self._phases, self._later = Phases(abs(self._turn)), later
        self._plan = np.repeat(model.flow.gamma[:, None], blocks, axis=1)
        self._gone = 0
        self.record = MonitorRecord(checks=plan_checks())

    @property
    def declaration(self) -> Declaration:
        """It solves quadratic programs over plans, and its plans are no barrier of poses."""
        return Declaration(solves_qp=True, record=self.record)

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The first commands (N,) of the plans, inside the limits.

        Raises  ValueError if a nominal command or what is seen is not finite
        """
        problem = Problem(*input_set(view, nominal, limits))
        model, n = self._model, len(problem.target)
        flow, lower, upper = model.flow, problem.lower, problem.upper
        gamma = np.minimum(np.maximum(flow.gamma, lower), upper)
        blocks = self._blocks()
        begun = model.begin(view, float(blocks.lasts.sum()), lower, upper)
        before = np.concatenate([self._plan[:, :1], self._plan], axis=1)
        before = np.minimum(np.maximum(before, lower[:, None]), upper[:, None])
        every = [
            before,
            *(np.broadcast_to(x[:, None], before.shape) for x in (lower, upper, problem.clipped)),
        ]
        lasts = np.broadcast_to(blocks.lasts, before.shape[:2])
        integrals = covered(begun, np.stack(every), lasts)
        base, wish = flow.paths(begun, integrals[0]), flow.paths(begun, integrals[3])
        moves = furthest(begun, *integrals[:3])
        turned = self._turn * (self.record.steps + begun.times.size)
        kept = Kept(model.level, self._share, self._phases, turned)
        i, j = model.seen(view)
        found = samples(base, i, j, kept, moves)
        made = rows(found, kept, moves)
        clear = found.least - model.level
        self.record.checks["plan_clear"].see(self.record.steps, clear, i, j)
        plan = np.array(every[3])
        broken = np.unique(made.vehicle[~(made.displacement(wish, base) >= made.least - TOLERANCE_M)])
        if broken.size:
            v = broken
            posed = Posed(
                begun.of(v),
                flow,
                made.of(v),
                Paths(base.at[v], base.z[v], base.centre[v], base.arm[v]),
                blocks,
                before[v],
                plan[v],
                lower[v],
                upper[v],
            )
            plan[v] = posed.plans()
        short = np.zeros(n)
        for vehicle in (i, j):
            np.maximum.at(short, vehicle, -clear)
        status = np.where(short > CLEAR_TO_M, int(Status.INFEASIBLE), int(Status.SOLVED))
        self._keep(plan, gamma)
        model.told(plan[:, 0])
        return problem.decision(plan[:, 0], status, short, None, np.zeros(0))

    def _blocks(self) -> Blocks:
        dt, count = self._model.flow.dt, self._plan.shape[1]
        lasts = np.full(count + 1, self._block * dt)
        lasts[0], lasts[1] = dt, (self._block - self._gone - 1) * dt
        weight = np.full(count + 1, self._later)
        weight[0] = 1.0
        return Blocks(lasts, weight)

    def _keep(self, plan: Array, gamma: Array) -> None:
        """Keep the rest of plans (N, K, 3), whose first commands are flown, for the next period."""
        self._gone += 1
        self._plan = plan[:, 1:].copy()
        if self._gone == self._block:
            self._gone = 0
            self._plan = np.concatenate([self._plan[:, 1:], gamma[:, None]], axis=1)
        self.record.steps += 1
