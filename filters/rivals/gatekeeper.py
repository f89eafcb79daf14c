"""Commits to the nominal command only as long as a backup after it stays safe for all time: gatekeeper.

Agrawal, Chen & Panagou, "gatekeeper: online safety verification and control for nonlinear systems in dynamic
environments", IEEE T-RO 40 (2024), first at IROS 2023. A candidate is the nominal trajectory until a
switching time, then the backup for ever. The candidate with the longest valid switching time replaces what
was committed; without one the vehicle goes on along what it has committed to.

Here the backup is gamma, flown by vehicles that lag, and all time is looked at: instants until the channels
have settled, then the whole circle in closed form. The filter is given a command, not a trajectory, so the
nominal trajectory holds that command. Several vehicles decide in the order of their numbers, within each
period: a candidate has to be clear of what all others are committed to at that moment, and whoever commits
broadcasts its command and switching time at once. So all commitments are clear of each other at every moment,
by induction.

Premises: the vehicles follow the model (the margin stands for the tube in which they do); at the start all
are clear of each other on gamma's flow; the broadcasts arrive. Commitments that errors have carried nearer
than the margin must only get no nearer, which the authors, whose tube is a bound, do not need.
"""

from __future__ import annotations

import numpy as np

from filters.cbf.problem import Problem, input_set
from filters.filter import Check, Decision, Declaration, MonitorRecord
from filters.flow.rollout import Begun
from filters.model import Array, Command, Limits, View
from filters.qp.single import Status
from filters.rivals.plans import Model, Tracks, covered, nearest

# Shares of the horizon that are tried as switching times, the longest first; then one period.
SHARES = (1.0, 0.5, 0.25, 0.125)
# What a plan's clearance may be below 0: sums over periods of 0.05 s are right to millimetres [m].
CLEAR_TO_M = 0.01
# Committed paths are found again in every period, to rounding [m].
_ROUND_OFF = 1e-6
# Clearances up to this are recorded as they are, larger ones as a bound below [m].
_EXACT_M = 20.0


def plan_checks() -> dict[str, Check]:
    """What a filter that commits to plans watches at every step."""
    return {
        "plan_clear": Check("on the model the plans committed to keep pairs Ds + m apart [m]", -CLEAR_TO_M)
    }


class GatekeeperFilter:
    """Each vehicle flies its nominal command for as long as gamma after it is safe.

    model    of the vehicles; its margin is kept by all candidates beyond Ds
    horizon  s, the longest switching time that is tried
    Raises   ValueError unless the horizon is a period and more
    """

    def __init__(self, model: Model, horizon: float = 2.0) -> None:
        dt = model.flow.dt
        if not (np.isfinite(horizon) and horizon >= dt - 1e-12):
            raise ValueError(
                f"the horizon must be finite and a filter period ({dt:g} s) or more, got {horizon} s"
            )
        self._model = model
        periods = {max(1, round(share * horizon / dt)) for share in (*SHARES, 0.0)}
        self.switching = dt * np.array(sorted(periods, reverse=True), dtype=float)
        """Switching times that are tried [s], the longest first."""
        n = len(model.flow.gamma)
        self._command, self._left = model.flow.gamma.copy(), np.zeros(n)
        self.record = MonitorRecord(checks=plan_checks())
        self.kept = 0
        """How often a vehicle found no candidate and went on along its plan."""

    @property
    def declaration(self) -> Declaration:
        """It solves no QP, and its plans are no barrier of poses."""
        return Declaration(record=self.record)

    @property
    def committed(self) -> tuple[Array, Array]:
        """Commands (N, 3), and how long [s] each is flown from now on before gamma (N,)."""
        return self._command.copy(), self._left.copy()

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The commands (N,) that the committed plans give for the next period.

        Raises  ValueError if a nominal command or what is seen is not finite
        """
        problem = Problem(*input_set(view, nominal, limits))
        model, n, dt = self._model, len(problem.target), self._model.flow.dt
        wish, lower, upper = problem.clipped, problem.lower, problem.upper
        begun = model.begin(view, float(self.switching[0]), lower, upper)
        now = self._tracks(begun, self._command, self._left)
        i, j = model.seen(view)
        clear = nearest(now, i, now, j, model.level + _EXACT_M) - model.level
        self.record.checks["plan_clear"].see(self.record.steps, clear, i, j)
        least = np.full((n, n), np.inf)
        least[i, j] = least[j, i] = clear
        longest = self._tracks(begun, wish, np.full(n, self.switching[0]))
        for v in range(n):
            others = np.flatnonzero(np.isfinite(least[v]))
            # No nearer than Ds + m, or than on the plans committed to where errors have made that less.
            bound = np.minimum(least[v, others], 0.0) - _ROUND_OFF
            for k, switch in enumerate(self.switching):
                tried, which = (longest, v) if k == 0 else (self._alone(begun, v, wish[v], switch), 0)
                same = np.full(others.size, which, dtype=np.intp)
                off = nearest(tried, same, now, others, model.level) - model.level
                if (off >= bound).all():
                    self._command[v], self._left[v] = wish[v], switch
                    now.put(v, tried, which)
                    least[v, others] = least[others, v] = off
                    break
            else:
                self.kept += 1
        gamma = np.minimum(np.maximum(model.flow.gamma, lower), upper)
        u = np.where(self._left[:, None] > 0.5 * dt, self._command, gamma)
        self._left = np.maximum(self._left - dt, 0.0)
        self._left[self._left < 0.5 * dt] = 0.0
        self.record.steps += 1
        model.told(u)
        none = np.full(n, int(Status.NONE))
        return problem.decision(u, none, np.zeros(n), None, np.zeros(0))

    def _tracks(self, begun: Begun, command: Array, lasts: Array) -> Tracks:
        """Of commands (N, 3), each flown for lasts (N,) s, then gamma."""
        return Tracks.of(self._model.flow.paths(begun, covered(begun, command[:, None], lasts[:, None])))

    def _alone(self, begun: Begun, v: int, command: Array, lasts: float) -> Tracks:
        return self._tracks(begun.of(np.array([v])), command[None], np.array([lasts]))
