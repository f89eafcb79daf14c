"""Verdicts on the paper's claims, from what a run tallied at full rate.

Every verdict uses the true state, the scenario's Ds and the unmodified barrier, whatever the filter used.
Missing data is never a pass: a run that ended early holds nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.filter import MonitorRecord
from testbed.claims.verdict import HOLDS, PREMISE, VIOLATED, Entry, at_pair, decide, entry
from testbed.measures.run_statistics import RunStatistics
from testbed.scenario.scenario import Scenario

# Round-off of a barrier evaluated at coordinates of some hundred metres.
H_TOLERANCE_M = 1e-9
# What a filter period's curvature may take from hdot on a vehicle that flies exactly as commanded [m/s].
CONDITION_TOLERANCE_MPS = 1e-3
ROW_TOLERANCE_MPS = 1e-6

QP_FILTERS = ("centralised", "limited")


@dataclass(frozen=True)
class Flown:
    """What there is to judge.

    i, j          vehicles of each pair, from 0
    started_safe  whether h >= 0 for all pairs at t = 0
    end           why the run ended before its time, or None
    straight      (N,) m, distance from start to goal
    solo_time_s   (N,) s, that way to within the goal radius at the nominal speed; None if unknown
    """

    scenario: Scenario
    statistics: RunStatistics
    i: np.ndarray
    j: np.ndarray
    started_safe: bool
    end: str | None
    straight: np.ndarray
    solo_time_s: np.ndarray | None = None


def judge(f: Flown) -> list[Entry]:
    """G1 to G8, one entry per claim."""
    makers = (
        _separation,
        _invariance,
        _condition,
        _admissible,
        _feasibility,
        _limits,
        _implied,
        _goals,
        _work,
    )
    return [maker(f) for maker in makers]


def _unit(f: Flown, rate: bool = False) -> str:
    return ("m" if f.scenario.barrier.form == "root" else "m^2") + ("/s" if rate else "")


def _separation(f: Flown) -> Entry:
    e = entry("separation", "G1", "every pair keeps Ds", "Theorem 1 with eq. (7)", "least distance", "m")
    if not f.i.size:
        return e | {"why": "one vehicle has nobody to keep clear of"}
    d_safe = f.scenario.d_safe_m
    holds = at_pair(e, f.statistics.separation, f.i, f.j, d_safe) >= d_safe
    _, between, _ = f.statistics.between.worst()
    e["detail"] = {"between_steps_m": between}
    return decide(e, holds and not between < d_safe, f.end)


def _invariance(f: Flown) -> Entry:
    e = entry("safe-set", "G2", "h >= 0 for ever", "Theorem 1, Corollary 1", "least h", _unit(f))
    if not f.i.size:
        return e | {"why": "no pair, no barrier"}
    value = at_pair(e, f.statistics.h, f.i, f.j, 0.0)
    if not f.started_safe:
        return e | {"verdict": PREMISE, "why": "the start is outside the safe set"}
    return decide(e, value >= -H_TOLERANCE_M, f.end)


def _condition(f: Flown) -> Entry:
    e = entry(
        "barrier-condition",
        "G3",
        "along the motion hdot + alpha(h) >= 0",
        "eq. (4), Corollary 1",
        "least hdot + alpha(h) over a filter period",
        _unit(f, rate=True),
    )
    if not f.i.size:
        return e | {"why": "no pair, no barrier"}
    value = at_pair(e, f.statistics.condition, f.i, f.j, 0.0)
    if np.isnan(value):
        return e | {"verdict": PREMISE, "why": "the run had no motion"}
    return decide(e, value >= -CONDITION_TOLERANCE_MPS, f.end)


def _admissible(f: Flown) -> Entry:
    e = entry(
        "zcbf-condition",
        "G4a",
        "inside its safe set each barrier leaves an admissible input",
        "Definition 1, Theorem 2",
        "least sup over U of hdot + alpha(h)",
        _unit(f, rate=True),
    )
    if not f.i.size:
        return e | {"why": "no pair, no barrier"}
    value = at_pair(e, f.statistics.admissible, f.i, f.j, 0.0)
    if np.isnan(value):
        return e | {"verdict": PREMISE, "why": "no pair was ever inside its safe set"}
    return decide(e, value >= -H_TOLERANCE_M, f.end)


def _feasibility(f: Flown) -> Entry:
    e = entry(
        "qp-feasibility", "G4", "the QP has a solution", "Theorems 3, 4", "vehicle-steps without one", ""
    )
    if f.scenario.filter.kind not in QP_FILTERS or f.statistics.without_qp:
        return e | {"why": "the filter solves no QP"}
    if not f.statistics.filter_steps:
        return e | {"verdict": PREMISE, "why": "no QP was solved"}
    failures, inside = sum(f.statistics.qp_failures.values()), f.statistics.failures_inside
    e.update(value=failures, bound=0, margin=-failures)
    e["detail"] = dict(sorted(f.statistics.qp_failures.items())) | {"in_safe_set": inside}
    if f.statistics.first_failure is not None:
        t, vehicle, status = f.statistics.first_failure
        e.update(t_s=t, vehicles=[vehicle + 1], why=f"first {status}; {inside} of them inside the safe set")
    return decide(e, failures == 0, f.end)


def _limits(f: Flown) -> Entry:
    e = entry(
        "command-limits",
        "G5",
        "commands stay in U",
        "eq. (5), actuator rows",
        "least distance inside the limits, as a share of their range",
        "",
    )
    vehicle, value, t = f.statistics.command_margin.worst()
    if vehicle < 0:
        return e | {"verdict": PREMISE, "why": "no command was given"}
    e.update(value=value, bound=0.0, margin=value, t_s=t, vehicles=[vehicle + 1])
    low, high = f.statistics.lowest.min(axis=0), f.statistics.highest.max(axis=0)
    names = ("v_mps", "omega_radps", "zeta_mps")
    e["detail"] = {f"achieved_{n}": [float(a), float(b)] for n, a, b in zip(names, low, high, strict=True)}
    if shares := f.statistics.saturation.shares():
        e["detail"]["share_at_stop"] = shares
    return decide(e, value >= 0.0, f.end)


def _implied(f: Flown) -> Entry:
    e = entry(
        "rows-satisfied",
        "G6",
        "solved inputs satisfy every pair's row, limited communication included",
        "Theorem 4, K(x) in K_cap(x)",
        "least L_g h u + alpha(h)",
        _unit(f, rate=True),
    )
    if f.scenario.filter.kind not in QP_FILTERS or not f.i.size or f.statistics.without_qp:
        return e | {"why": "no rows"}
    value = at_pair(e, f.statistics.rows, f.i, f.j, 0.0)
    if np.isnan(value):
        return e | {"verdict": PREMISE, "why": "no QP was solved"}
    return decide(e, value >= -ROW_TOLERANCE_MPS, f.end)


def _goals(f: Flown) -> Entry:
    s, statistics = f.scenario, f.statistics
    e = entry(
        "goal",
        "G7",
        f"every vehicle passes its goal within {s.goal_radius_m:g} m before the run ends",
        "Section V: vehicles reach their waypoints",
        "largest over vehicles of the closest approach",
        "m",
    )
    worst = int(np.argmax(statistics.goal.value))
    value = float(statistics.goal.value[worst])
    e.update(value=value, bound=s.goal_radius_m, margin=s.goal_radius_m - value)
    e.update(t_s=float(statistics.goal.t[worst]), vehicles=[worst + 1])
    late = int(np.isnan(statistics.passed).sum())
    if late:
        e["why"] = f"{late} of {statistics.vehicles} not within it by the end"
    else:
        e["detail"] = {"last_passed_s": float(np.max(statistics.passed))}
    return decide(e, value <= s.goal_radius_m, f.end)


def _work(f: Flown) -> Entry:
    """The intervention: reported, not judged, for the paper promises only that it is minimal at each step."""
    e = entry(
        "intervention",
        "G8",
        "the nominal input is altered minimally",
        "eq. (6)",
        "time overridden, worst",
        "",
    )
    statistics = f.statistics
    share = statistics.override_steps / max(1, statistics.filter_steps)
    worst = int(np.argmax(share))
    e.update(value=float(share[worst]), vehicles=[worst + 1])
    e["why"] = "reported, not judged"
    path = statistics.path - (f.straight - f.scenario.goal_radius_m)
    time = statistics.passed - (f.solo_time_s if f.solo_time_s is not None else np.nan)
    e["detail"] = {
        "altered_v_m": float(statistics.altered[:, 0].sum()),
        "altered_omega_rad": float(statistics.altered[:, 1].sum()),
        "altered_zeta_m": float(statistics.altered[:, 2].sum()),
        "path_added_m": _known(np.where(np.isfinite(statistics.passed), path, np.nan)),
        "time_added_s": _known(time),
    }
    return e


def _known(values: np.ndarray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


# Of the monitor's checks, those that are premises of a theorem, not conclusions.
PREMISES = ("aligned", "aligned_limited", "gradient")


def monitored(record: MonitorRecord, filter_dt: float) -> list[Entry]:
    """One entry per check of a monitored run; a premise that fails voids its theorem, it violates nothing."""
    entries = []
    for name, check in record.checks.items():
        claim, _, quantity = check.claim.rstrip("]").partition(" [")
        e = entry(f"monitor-{name}", "M", claim, "Theorems 3 and 4", "smallest seen", quantity)
        if check.checked:
            e.update(value=check.worst, bound=check.least, margin=check.worst - check.least)
            e["verdict"] = HOLDS if not check.failed else PREMISE if name in PREMISES else VIOLATED
            e["why"] = f"{check.failed} of {check.checked} fail" if check.failed else ""
            if check.worst_at is not None:
                e.update(t_s=check.worst_at[0] * filter_dt, vehicles=list(check.worst_at[1]))
        else:
            e["why"] = "never met"
        entries.append(e)
    return entries
