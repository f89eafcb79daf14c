"""Filters commands along the flow of a model with delays, lags and rate limits.

The barrier is the least clearance of a pair on the flow of gamma through the vehicles' channels, and the
condition is posed for the sampled system: one filter period uses up at most a share kappa of it. Flown from
a state with clearance >= 0, the model's clearance stays >= 0; see docs/guide/flow.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from filters.cbf.problem import Problem, input_set
from filters.constraints import Indices
from filters.filter import Check, Decision, Declaration, MonitorRecord
from filters.flow.belief import Belief
from filters.flow.channels import Channels, Lag
from filters.flow.choice import TOLERANCE_M, Ending, Wanted, choose
from filters.flow.phases import Phases
from filters.flow.posed import Posed
from filters.flow.reach import Reach, furthest
from filters.flow.received import Received
from filters.flow.rollout import Flow, Paths
from filters.flow.separation import Kept, Rows, Samples, rows, samples
from filters.model import Array, Command, Limits, View
from filters.qp.batch import solve_each
from filters.qp.single import Status

STEP_TOLERANCE_M = 20 * TOLERANCE_M
# A channel whose range is this small has no choice [m/s, rad/s, m/s].
_STEP = 1e-9


def flow_checks() -> dict[str, Check]:
    """What the filter watches at every step."""
    return {
        "flow_clear": Check("on the model's flow under gamma pairs stay Ds + m apart [m]", 0.0),
        "flow_step": Check(
            "a period uses up at most kappa of a pair's clearance on the flow [m]", -STEP_TOLERANCE_M
        ),
        "flow_wind": Check(
            "in this wind gamma is flown at 1 m/s and more above the autopilot's least airspeed [m/s]", 0.0
        ),
    }


class FlowFilter:
    """Keeps every pair at least d_safe + margin apart on the flow of the evading manoeuvre.

    lags     (v, omega, zeta) of every vehicle: one triple for all, or N
    gamma    (N,) the evading manoeuvre; one turn rate for all, not zero
    d_safe   m, Ds
    dt       s, the filter's period, for which a command is held
    margin   m, m
    kappa    share of the clearance that one period may use up, in (0, 1]
    trust    share of the difference between measured and modelled rates that is believed in a period
    said     numbers for the record: how the margin was found
    h_margin m, what the paper's h keeps along the flow; None: h is not kept
    slew     (3,) per second, what the commands of each channel change by at most; None: without a bound
    cost     "range" divides each channel by its range, "raw" leaves them as they stand
    Raises   ValueError for numbers out of these ranges

    Every vehicle solves a QP of its own; of the others it needs pose, rates and the commands on their way,
    which they broadcast. It must be called once every period, and what it returns be flown: it remembers the
    commands that are on their way.
    """

    def __init__(
        self,
        lags: Sequence[Sequence[Lag]],
        gamma: Command,
        d_safe: float,
        dt: float,
        margin: float = 0.0,
        kappa: float = 0.1,
        cost: Literal["range", "raw"] = "range",
        trust: float = 0.1,
        said: Mapping[str, float] | None = None,
        h_margin: float | None = None,
        slew: Array | None = None,
    ) -> None:
        if not 0 < kappa <= 1:
            raise ValueError(f"kappa is a share in (0, 1], got {kappa}")
        if not (np.isfinite(margin) and margin >= 0):
            raise ValueError(f"the margin must be finite and not negative, got {margin} m")
        if cost not in ("range", "raw"):
            raise ValueError(f"cost is 'range' or 'raw', not {cost!r}")
        channels = Channels.of(lags, len(gamma))
        self._change = np.full(3, np.inf) if slew is None else slew * dt
        self.flow = flow = Flow(channels if slew is None else channels.slewed(slew), gamma.array(), dt)
        # How far gamma turns in a period, which is also how far apart the phases looked at are.
        self._turn = float(flow.gamma[0, 1]) * dt
        self.phases = Phases(abs(self._turn))
        self.level, self.kappa, self.cost = d_safe + margin, kappa, cost
        self.circle = None if h_margin is None else d_safe + h_margin
        self._belief = Belief(flow, trust)
        self.record = MonitorRecord(checks=flow_checks(), numbers=dict(said or {}))
        self.endings = np.zeros(len(Ending), dtype=int)
        self._pairs = np.triu_indices(len(gamma), 1)
        self._every = np.arange(len(gamma))
        self._received = Received(flow)
        # The first QP loads its solver, which takes 60 ms: not in a step.
        one = np.ones((1, 3))
        solve_each(0 * one, np.zeros(1, dtype=np.intp), one, one[0], -one, one)
        self._before: Array | None = None
        self._clear = np.full((len(gamma), len(gamma)), np.nan)

    @property
    def clearance(self) -> Array:
        """The last step's clearances (N, N) m of pairs i < j; nan elsewhere."""
        return self._clear

    @property
    def declaration(self) -> Declaration:
        """It solves quadratic programs. No barrier of poses is its own: its h is of the flow."""
        return Declaration(solves_qp=True, record=self.record)

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The nearest commands to `nominal` (N,) inside `limits` whose flow keeps every row.

        Raises  ValueError if a nominal command or what is seen is not finite
        """
        problem = Problem(*input_set(view, nominal, limits))
        target, lower, upper = problem.target, problem.lower, problem.upper
        own, flow, n = view.own(), self.flow, len(target)
        state, rates = own.state, own.rates.array()
        if not (state.isfinite().all() and np.isfinite(rates).all()):
            raise ValueError("the flow needs finite poses and rates")
        self._belief.see(rates)
        rates, queued = self._belief.rates, self._belief.queued
        if self.record.steps:  # before, nothing was commanded
            lower = np.maximum(lower, queued[0] - self._change)
            upper = np.minimum(upper, queued[0] + self._change)
        ends = np.stack([lower, upper, *queued])
        told = np.abs(ends - flow.gamma).max(axis=0)
        begun = flow.begin(state, rates, queued, flow.times(rates, told))
        gamma = np.minimum(np.maximum(flow.gamma, lower), upper)
        wanted = Wanted(target, lower, upper, gamma, self._scale(lower, upper))
        covered = flow.covered(begun, np.stack([gamma, lower, upper, wanted.clipped]))
        paths = flow.paths(begun, covered[::3])
        base, wish = paths[0], paths[1]
        moves = furthest(begun, covered[0], covered[1], covered[2], self.circle is not None)
        turned = self._turn * (self.record.steps + begun.times.size)
        kept = Kept(self.level, self.kappa, self.phases, turned, self.circle, self.record.steps)
        if view.age is None:
            found = true = samples(base, *self._seen(view), kept, moves)
            made = rows(found, kept, moves)
        else:
            true = samples(base, *self._seen(view), kept, moves.still(self._every))
            found, made = self._by_packets(view, base, kept, moves)
        u, ending = wanted.clipped, np.full(n, int(Ending.NOMINAL))
        moved = made.displacement(wish, base)
        breaks = np.zeros(n, dtype=bool)
        breaks[made.vehicle[~(moved >= made.least + made.back - TOLERANCE_M)]] = True
        broken = np.flatnonzero(breaks)
        if broken.size:
            posed = Posed(flow, begun, base, made).of(broken)
            mine = breaks[made.vehicle]
            u[broken], ending[broken] = self._choose(
                posed, wanted.of(broken), covered[:, broken], moved[mine]
            )
        clear = np.full((n, n), np.nan)
        clear[true.i, true.j] = true.least - self.level
        self._clear = clear
        self._note(clear, ending)
        self._belief.told(u)
        short = np.zeros(n)
        for who in (found.i, found.j):
            there = who < n
            np.maximum.at(short, who[there], self.level - found.least[there])
        status = np.full(n, int(Status.SOLVED))
        status[(short > 0) & (ending == Ending.EVADING)] = int(Status.INFEASIBLE)
        return problem.decision(u, status, short, None, np.zeros(0))

    def _choose(
        self, posed: Posed, wanted: Wanted, covered: Array, moved: Array
    ) -> tuple[Array, NDArray[np.int_]]:
        """Inputs and endings of vehicles whose targets break rows.

        covered  (4, N, 3, M) integrals under gamma, the box's lower and upper end, and the targets
        moved    (R,) m, displacements at the targets
        """
        # One channel at a time to the end of its range on the target's side, or else the other.
        gamma, lower, upper = wanted.gamma, wanted.lower, wanted.upper
        high = wanted.clipped >= gamma
        high ^= np.abs(np.where(high, upper, lower) - gamma) < _STEP
        step = np.where(high, upper, lower) - gamma
        ends = np.where(high[..., None], covered[2], covered[1])
        one = np.eye(3, dtype=bool)[:, None, :, None]
        tried = self.flow.paths(posed.begun, np.where(one, ends, covered[0]))
        step = np.where(np.abs(step) > _STEP, step, np.inf)
        slope = (posed.rows.displacement(tried, posed.gamma) / step.T[:, posed.rows.vehicle]).T
        return choose(wanted, posed, slope, moved)

    def _by_packets(self, view: View, base: Paths, kept: Kept, moves: Reach) -> tuple[Samples, Rows]:
        """Samples and rows of each vehicle against all that it has heard of, where their packets put them.

        Numbers from N on in them are others as one of the vehicles expects them, which no row is of.
        """
        assert view.age is not None
        n = len(base.centre)
        i, j = np.nonzero(~np.eye(n, dtype=bool))
        heard = view.knows(i, j)
        i, j = i[heard], j[heard]
        others = self._received.images(base, i, j, view.age)
        both = Paths(
            *(np.concatenate([getattr(base, x.name), getattr(others, x.name)]) for x in fields(Paths))
        )
        reach = moves.with_still(j)
        found = samples(both, i, n + np.arange(j.size), kept, reach)
        return found, rows(found, kept, reach)

    def _scale(self, lower: Array, upper: Array) -> Array:
        ranges = upper - lower
        return np.where((ranges > 0) & (self.cost == "range"), ranges, 1.0)

    def _seen(self, view: View) -> tuple[Indices, Indices]:
        """The pairs that know of each other."""
        i, j = self._pairs
        known = view.known
        if known is None:
            return i, j
        both = known[i] & known[j] if known.ndim == 1 else known[i, j] & known[j, i]
        return i[both], j[both]

    def _note(self, clear: Array, ending: NDArray[np.int_]) -> None:
        """Watch the clearances (N, N) m of this step, and what became of the last one's."""
        step, see = self.record.steps, self.record.checks
        i, j = self._pairs
        now = clear[i, j]
        there = np.isfinite(now)
        see["flow_clear"].see(step, now[there], i[there], j[there])
        if self._before is not None:
            both = there & (self._before >= 0)
            left = now - (1 - self.kappa) * self._before
            see["flow_step"].see(step, left[both], i[both], j[both])
        self._before = now
        self.endings += np.bincount(ending, minlength=len(Ending))
        self.record.steps += 1
