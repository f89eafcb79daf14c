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

import numpy as np

from filters.cbf.problem import Problem, input_set
from filters.constraints import Indices
from filters.filter import Decision, Declaration, MonitorRecord
from filters.flow.reach import furthest
from filters.flow.rollout import Begun
from filters.model import Array, Command, Limits, View
from filters.qp.single import Status
from filters.rivals.gatekeeper import CLEAR_TO_M, plan_checks
from filters.rivals.plan_programs import Programs, rows
from filters.rivals.plans import Model, Tracks, covered, nearest

# Plans are found again in every period, to rounding; clearances up to the other number are recorded as they
# are, larger ones as a bound below [m].
_ROUND_OFF, _EXACT_M = 1e-6, 20.0


class RecedingHorizonFilter:
    """Each vehicle's nearest plan to its nominal command, held, that keeps clear of the others' plans.

    model     of the vehicles; its margin is kept by all plans beyond Ds
    blocks    how many blocks of constant commands follow the first period
    block_s   s, how long each lasts, in filter periods
    later     weight of the blocks after the first period against it, in the cost
    kappa     how much of a pair's clearance on the plans one period may use up, in (0, 1)
    Raises    ValueError for numbers out of these ranges

    The cost divides each channel by its range.
    """

    def __init__(
        self,
        model: Model,
        blocks: int = 2,
        block_s: float = 0.5,
        later: float = 1e-4,
        kappa: float = 0.5,
    ) -> None:
        dt = model.flow.dt
        if not (blocks >= 1 and np.isfinite(block_s) and round(block_s / dt) >= 1):
            raise ValueError(f"a plan needs a block of a filter period ({dt:g} s) or more")
        if not (0 < later <= 1 and 0 < kappa < 1):
            raise ValueError(f"later must be in (0, 1] and kappa in (0, 1), got {later} and {kappa}")
        self._model, self._block, self._kappa = model, round(block_s / dt), kappa
        self._plan = np.repeat(model.flow.gamma[:, None], blocks, axis=1)
        self._weight = np.concatenate([[1.0], np.full(blocks, later)])
        self._gone = 0
        self.record = MonitorRecord(checks=plan_checks())
        self.withdrawn = 0
        """How often a vehicle went back to its plan before because two new plans came too near."""

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
        lasts = self._lasts()
        begun = model.begin(view, float(lasts.sum()), lower, upper)
        before = np.concatenate([self._plan[:, :1], self._plan], axis=1)
        before = np.minimum(np.maximum(before, lower[:, None]), upper[:, None])
        ends = [np.repeat(x[:, None], len(lasts), axis=1) for x in (lower, upper, problem.clipped)]
        integrals = covered(begun, np.stack([before, *ends]), lasts[None, None])
        base, plan = flow.paths(begun, integrals[0]), ends[2].copy()
        moves = furthest(begun, *integrals[:3])
        i, j = model.seen(view)
        was = Tracks.of(base)
        clear = nearest(was, i, was, j, model.level + _EXACT_M) - model.level
        self.record.checks["plan_clear"].see(self.record.steps, clear, i, j)
        made = rows(base, i, j, model.level, self._kappa, moves)
        moved = made.displacement(flow.paths(begun, integrals[3]), base)
        v = np.unique(made.vehicle[~(moved >= made.least)])
        if v.size:
            own = base[v]
            each = begun.of(v), flow, made.of(v), own, lasts, self._weight
            plan[v] = Programs(*each, before[v], plan[v], lower[v], upper[v]).plans()
        plan = self._joint(begun, lasts, plan, before, i, j, np.minimum(clear, 0.0))
        short = np.zeros(n)
        for vehicle in (i, j):
            np.maximum.at(short, vehicle, -clear)
        status = np.where(short > CLEAR_TO_M, int(Status.INFEASIBLE), int(Status.SOLVED))
        self._keep(plan, np.minimum(np.maximum(flow.gamma, lower), upper))
        model.told(plan[:, 0])
        return problem.decision(plan[:, 0], status, short, None, np.zeros(0))

    def _joint(
        self, begun: Begun, lasts: Array, plan: Array, before: Array, i: Indices, j: Indices, least: Array
    ) -> Array:
        """The plans (N, K, 3), those of pairs with a clearance below `least` (P,) m put back to the last.

        Between their samples and for all time: what the rows of the programs leave open.
        """
        model = self._model
        while True:
            tracks = Tracks.of(model.flow.paths(begun, covered(begun, plan, lasts[None])))
            off = nearest(tracks, i, tracks, j, model.level) - model.level
            near = np.flatnonzero(off < least - _ROUND_OFF)
            back = np.unique(np.concatenate([i[near], j[near]]))
            back = back[(plan[back] != before[back]).any(axis=(1, 2))]
            if not back.size:
                return plan
            self.withdrawn += back.size
            plan[back] = before[back]

    def _lasts(self) -> Array:
        """How long [s] the blocks of a plan last that starts now (K,); the second may have no length."""
        dt, count = self._model.flow.dt, self._plan.shape[1]
        lasts = np.full(count + 1, self._block * dt)
        lasts[0], lasts[1] = dt, (self._block - self._gone - 1) * dt
        return lasts

    def _keep(self, plan: Array, gamma: Array) -> None:
        """Keep the rest of plans (N, K, 3), whose first commands are flown, for the next period."""
        self._gone += 1
        self._plan = plan[:, 1:].copy()
        if self._gone == self._block:
            self._gone = 0
            self._plan = np.concatenate([self._plan[:, 1:], gamma[:, None]], axis=1)
        self.record.steps += 1
