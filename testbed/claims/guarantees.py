"""Judges the paper's guarantees, G1 to G8, from what was counted at every step of a run.

Every verdict uses the true state, the scenario's Ds and the unmodified barrier, whatever the filter used.
Missing data is never a pass: a run that ended early holds nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbed.claims import own_filter, promises, registry
from testbed.claims.judging import at_pair, decide, finer, leave_open, premise_not_met
from testbed.claims.registry import Claim
from testbed.measures.between_samples import TOLERANCE_M
from testbed.measures.progress import seeking
from testbed.measures.roles import Mask, Roles
from testbed.measures.run_statistics import RunStatistics
from testbed.records.verdict import Verdict
from testbed.scenario import guidance_rules
from testbed.scenario.scenario import Scenario

# Round-off of a barrier evaluated at coordinates of some hundred metres.
H_TOLERANCE_M = 1e-9
# What a filter period's curvature may take from hdot on a vehicle that flies exactly as commanded [m/s].
CONDITION_TOLERANCE_MPS = 1e-3
ROW_TOLERANCE_MPS = 1e-6

QP_FILTERS = ("centralised", "limited")


@dataclass(frozen=True)
class Flown:
    """The results of a run that the verdicts are made from.

    i, j          vehicles of each pair, from 0
    started_safe  whether h >= 0 for all pairs at t = 0
    started_in_fences  whether h >= 0 for all fences at t = 0
    end           why the run ended before its time, or None
    straight      (N,) m, distance from start to goal
    roles         who is under the filter; None without intruders
    solo_time_s   (N,) s, time from there to within the goal radius at the nominal speed; None if unknown
    """

    scenario: Scenario
    statistics: RunStatistics
    i: np.ndarray
    j: np.ndarray
    started_safe: bool
    end: str | None
    straight: np.ndarray
    solo_time_s: np.ndarray | None = None
    started_in_fences: bool = True
    roles: Roles | None = None

    def unjudged(self, claim: Claim) -> Verdict:
        """A verdict on `claim` without data, with the words and units of this scenario."""
        s = self.scenario
        return claim.unjudged(s.barrier.form, s.goal_radius_m, self.roles is not None)

    @property
    def ours(self) -> Mask | None:
        """(P,) pairs under the filter; None is all."""
        return self.roles.ours if self.roles else None

    @property
    def judged(self) -> Mask | None:
        """(P,) pairs with a vehicle under the filter; None is all."""
        return self.roles.judged if self.roles else None

    @property
    def under(self) -> Mask | None:
        """(N,) vehicles under the filter; None is all."""
        return self.roles.under if self.roles else None


def judge(f: Flown) -> list[Verdict]:
    """G1 to G8, and G1i with intruders, one verdict per claim, in the order of the registry."""
    beside = []
    if f.roles is not None:
        beside = [_separation(f, f.unjudged(registry.SEPARATION_INTRUDERS), f.roles.beside)]
    return [
        _separation(f, f.unjudged(registry.SEPARATION), f.ours),
        _invariance(f, f.unjudged(registry.SAFE_SET)),
        _condition(f, f.unjudged(registry.BARRIER_CONDITION)),
        _admissible(f, f.unjudged(registry.ZCBF_CONDITION)),
        _feasibility(f, f.unjudged(registry.QP_FEASIBILITY)),
        _limits(f, f.unjudged(registry.COMMAND_LIMITS)),
        _rows(f, f.unjudged(registry.ROWS_SATISFIED)),
        _goals(f, f.unjudged(registry.GOAL)),
        _intervention(f, f.unjudged(registry.INTERVENTION)),
        *beside,
    ]


def _separation(f: Flown, v: Verdict, which: Mask | None) -> Verdict:
    """Of `which` (P,) of the pairs; None is all."""
    if not f.i.size:
        return v.but(why="a single vehicle has no pair")
    if which is not None and not which.any():
        return v.but(why="a single vehicle under the filter has no pair")
    d_safe, dt = f.scenario.d_safe_m, f.scenario.rates.fdm_dt_s
    possible, reached = f.statistics.least_distances()
    reached, samples = reached.among(which), f.statistics.separation.among(which)
    possible = possible if which is None else np.where(which, possible, np.inf)
    _, between, _ = f.statistics.between.among(which).worst()
    (_, sampled, _), (_, nearest, _) = samples.worst(), reached.worst()
    # The value is that of the samples, unless only a passing between them tells.
    v = at_pair(v, reached if nearest < d_safe <= sampled else samples, f.i, f.j, d_safe)
    worst = int(np.argmin(possible))
    v = v.but(detail={"between_steps_m": between, "possible_m": float(possible[worst])})
    if not nearest >= d_safe or possible[worst] >= d_safe - TOLERANCE_M:
        return decide(v, nearest >= d_safe, f.end)
    radius = f.statistics.bends.radius(f.i[[worst]], f.j[[worst]])
    return leave_open(v, finer(float(possible[worst]), float(radius[0]), d_safe, dt), f.end)


def _invariance(f: Flown, v: Verdict) -> Verdict:
    if not f.i.size:
        return v.but(why="no pair, no barrier")
    v = at_pair(v, f.statistics.h.among(f.judged), f.i, f.j, -H_TOLERANCE_M)
    if not f.started_safe:
        return premise_not_met(v, "the start is outside the safe set")
    if v.value is None:
        return premise_not_met(v, "no step was flown")
    return decide(v, v.value >= -H_TOLERANCE_M, f.end)


def _condition(f: Flown, v: Verdict) -> Verdict:
    """G3, from the statistics' least hdot + alpha(h) along the motion."""
    if not f.i.size:
        return v.but(why="no pair, no barrier")
    v = at_pair(v, f.statistics.condition.among(f.judged), f.i, f.j, -CONDITION_TOLERANCE_MPS)
    if v.value is None:
        return premise_not_met(v, "the run had no motion")
    return decide(v, v.value >= -CONDITION_TOLERANCE_MPS, f.end)


def _admissible(f: Flown, v: Verdict) -> Verdict:
    if not f.i.size:
        return v.but(why="no pair, no barrier")
    if f.ours is not None and not f.ours.any():
        return v.but(why="a single vehicle under the filter has no pair")
    v = at_pair(v, f.statistics.admissible.among(f.ours), f.i, f.j, -H_TOLERANCE_M)
    if v.value is None:
        return premise_not_met(v, "no pair was ever inside its safe set")
    return decide(v, v.value >= -H_TOLERANCE_M, f.end)


def _feasibility(f: Flown, v: Verdict) -> Verdict:
    if f.statistics.foreign:
        return own_filter.feasibility(f.statistics, v, f.end)
    if f.scenario.filter.kind in promises.SOLVING_AT_BEST:
        return v.but(why=registry.NOT_ITS_CLAIM)
    if f.scenario.filter.kind not in promises.ALWAYS_SOLVING or f.statistics.without_qp:
        return v.but(why="the filter solves no QP")
    if not f.statistics.filter_steps:
        return premise_not_met(v, "no QP was solved")
    failures, inside = sum(f.statistics.qp_failures.values()), f.statistics.failures_inside
    v = v.but(
        value=failures,
        bound=0,
        margin=-failures,
        detail=dict(sorted(f.statistics.qp_failures.items())) | {"in_safe_set": inside},
    )
    if f.statistics.first_failure is not None:
        t, vehicle, status = f.statistics.first_failure
        why = f"first {status}; {inside} of them inside the safe set"
        v = v.but(instant=t, vehicles=(vehicle + 1,), why=why)
    return decide(v, failures == 0, f.end)


def _limits(f: Flown, v: Verdict) -> Verdict:
    vehicle, value, t = f.statistics.command_margin.worst()
    if vehicle < 0:
        return premise_not_met(v, "no command was given")
    low, high = f.statistics.lowest.min(axis=0), f.statistics.highest.max(axis=0)
    names = ("v_mps", "omega_radps", "zeta_mps")
    detail: dict[str, object] = {
        f"achieved_{n}": [float(a), float(b)] for n, a, b in zip(names, low, high, strict=True)
    }
    if shares := f.statistics.saturation.shares():
        detail["share_at_stop"] = shares
    v = v.but(value=value, bound=0.0, margin=value, instant=t, vehicles=(vehicle + 1,), detail=detail)
    return decide(v, value >= 0.0, f.end)


def _rows(f: Flown, v: Verdict) -> Verdict:
    if f.statistics.own is not None:
        return own_filter.measured(f.statistics, v, f.i, f.j)
    if f.statistics.foreign:
        return own_filter.rows(f.statistics, v, f.end)
    if f.scenario.filter.kind not in QP_FILTERS or not f.i.size or f.statistics.without_qp:
        return v.but(why="no rows")
    v = at_pair(v, f.statistics.rows.among(f.judged), f.i, f.j, -ROW_TOLERANCE_MPS)
    if v.value is None:
        return premise_not_met(v, "no QP was solved")
    return decide(v, v.value >= -ROW_TOLERANCE_MPS, f.end)


def _goals(f: Flown, v: Verdict) -> Verdict:
    s, statistics = f.scenario, f.statistics
    due = seeking(f.scenario)
    if not due.any():
        return v.but(why="no vehicle seeks a goal")
    worst = int(np.argmax(np.where(due, statistics.goal.value, -np.inf)))
    value = float(statistics.goal.value[worst])
    v = v.but(
        value=value,
        bound=s.goal_radius_m,
        margin=s.goal_radius_m - value,
        instant=float(statistics.goal.t[worst]),
        vehicles=(worst + 1,),
    )
    late = int(np.isnan(statistics.passed[due]).sum())
    if late:
        v = v.but(why=f"{late} of {due.sum()} not within it by the end")
    else:
        v = v.but(detail={"last_passed_s": float(np.max(statistics.passed[due]))})
    return decide(v, value <= s.goal_radius_m, f.end)


def _intervention(f: Flown, v: Verdict) -> Verdict:
    """Reported, not judged: the paper promises only that the change is minimal at each step."""
    statistics = f.statistics
    share = statistics.override_steps / max(1, statistics.filter_steps)
    worst = int(np.argmax(share))
    path = statistics.path - (f.straight - f.scenario.goal_radius_m)
    path[~guidance_rules.seeking(f.scenario)] = np.nan
    time = statistics.passed - (f.solo_time_s if f.solo_time_s is not None else np.nan)
    detail = {
        "altered_v_m": float(statistics.altered[:, 0].sum()),
        "altered_omega_rad": float(statistics.altered[:, 1].sum()),
        "altered_zeta_m": float(statistics.altered[:, 2].sum()),
        "path_added_m": _known(np.where(np.isfinite(statistics.passed), path, np.nan)),
        "time_added_s": _known(time),
    }
    return v.but(value=float(share[worst]), vehicles=(worst + 1,), why="reported, not judged", detail=detail)


def _known(values: np.ndarray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]
