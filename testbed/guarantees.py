"""Verdicts on the paper's claims, from what a run tallied at full rate.

Every verdict uses the true state, the scenario's Ds and the unmodified barrier, whatever the filter used.
Missing data is never a pass: a run that ended early holds nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filters.monitor import MonitorRecord
from testbed.scenario import Scenario
from testbed.tally import Extreme, Tally

HOLDS, VIOLATED, PREMISE, NOT_APPLICABLE = "holds", "violated", "premise not met", "not applicable"

# Round-off of a barrier evaluated at coordinates of some hundred metres.
H_TOLERANCE_M = 1e-9


def judge(
    scenario: Scenario, tally: Tally, i: np.ndarray, j: np.ndarray, started_safe: bool, end: str | None
) -> list[dict[str, Any]]:
    """One entry per claim.

    i, j          vehicles of each pair, from 0
    started_safe  whether h >= 0 for all pairs at t = 0
    end           why the run ended before its time, or None
    """
    return [
        _separation(scenario, tally, i, j, end),
        _invariance(scenario, tally, i, j, started_safe, end),
        _admissible(scenario, tally, i, j, end),
        _feasibility(scenario, tally, end),
        _limits(tally, end),
        _goals(scenario, tally, end),
    ]


# Of the monitor's checks, those that are premises of a theorem, not conclusions.
PREMISES = ("aligned", "aligned_limited", "gradient")


def monitored(record: MonitorRecord, filter_dt: float) -> list[dict[str, Any]]:
    """One entry per check of a monitored run; a premise that fails voids its theorem, it violates nothing."""
    entries = []
    for name, check in record.checks.items():
        claim, _, quantity = check.claim.rstrip("]").partition(" [")
        entry = _entry(f"monitor-{name}", claim, "Theorems 3 and 4", "smallest seen", quantity)
        if check.checked:
            entry.update(value=check.worst, bound=check.least, margin=check.worst - check.least)
            entry["verdict"] = HOLDS if not check.failed else PREMISE if name in PREMISES else VIOLATED
            entry["why"] = f"{check.failed} of {check.checked}"
            if check.worst_at is not None:
                entry.update(t_s=check.worst_at[0] * filter_dt, vehicles=list(check.worst_at[1]))
        else:
            entry["why"] = "never met"
        entries.append(entry)
    return entries


def _entry(name: str, claim: str, source: str, quantity: str, unit: str) -> dict[str, Any]:
    return {
        "id": name,
        "claim": claim,
        "source": source,
        "quantity": quantity,
        "unit": unit,
        "value": None,
        "bound": None,
        "margin": None,
        "t_s": None,
        "vehicles": [],
        "verdict": NOT_APPLICABLE,
        "why": "",
    }


def _decide(entry: dict[str, Any], holds: bool, end: str | None) -> dict[str, Any]:
    entry["verdict"] = HOLDS if holds else VIOLATED
    if holds and end:
        entry["verdict"], entry["why"] = PREMISE, end
    return entry


def _at_pair(entry: dict[str, Any], extreme: Extreme, i: np.ndarray, j: np.ndarray, bound: float) -> float:
    p, value, t = extreme.worst()
    entry.update(
        value=value, bound=bound, margin=value - bound, t_s=t, vehicles=[int(i[p]) + 1, int(j[p]) + 1]
    )
    return value


def _separation(s: Scenario, tally: Tally, i: np.ndarray, j: np.ndarray, end: str | None) -> dict[str, Any]:
    entry = _entry(
        "separation",
        "every pair keeps Ds",
        "Theorem 1 with eq. (7)",
        "smallest distance at any FDM step",
        "m",
    )
    if not i.size:
        return entry | {"why": "one vehicle has nobody to keep clear of"}
    return _decide(entry, _at_pair(entry, tally.separation, i, j, s.d_safe_m) >= s.d_safe_m, end)


def _invariance(
    s: Scenario, tally: Tally, i: np.ndarray, j: np.ndarray, started_safe: bool, end: str | None
) -> dict[str, Any]:
    unit = "m" if s.barrier.form == "root" else "m^2"
    entry = _entry(
        "safe-set", "h >= 0 for ever", "Theorem 1, Corollary 1", "smallest h at any filter step", unit
    )
    if not i.size:
        return entry | {"why": "no pair, no barrier"}
    value = _at_pair(entry, tally.h, i, j, 0.0)
    if not started_safe:
        return entry | {"verdict": PREMISE, "why": "the start is outside the safe set"}
    return _decide(entry, value >= -H_TOLERANCE_M, end)


def _admissible(s: Scenario, tally: Tally, i: np.ndarray, j: np.ndarray, end: str | None) -> dict[str, Any]:
    unit = "m/s" if s.barrier.form == "root" else "m^2/s"
    entry = _entry(
        "zcbf-condition",
        "inside its safe set, each barrier leaves an admissible input",
        "Definition 1, Theorem 2",
        "smallest sup over U of hdot + alpha(h)",
        unit,
    )
    if not i.size:
        return entry | {"why": "no pair, no barrier"}
    if tally.admissible.worst()[0] < 0:
        return entry | {"verdict": PREMISE, "why": "no pair was ever inside its safe set"}
    value = _at_pair(entry, tally.admissible, i, j, 0.0)
    return _decide(entry, value >= -H_TOLERANCE_M, end)


def _feasibility(s: Scenario, tally: Tally, end: str | None) -> dict[str, Any]:
    entry = _entry(
        "qp-feasibility", "the QP has a solution", "Theorems 2 to 4", "vehicle-steps without a solution", ""
    )
    if s.filter.kind not in ("centralised", "limited"):
        return entry | {"why": f"filter '{s.filter.kind}' solves no QP"}
    failures = sum(tally.qp_failures.values())
    entry.update(value=failures, bound=0, margin=-failures)
    if tally.first_failure is not None:
        t, vehicle, status = tally.first_failure
        counts = ", ".join(f"{n} {name}" for name, n in sorted(tally.qp_failures.items()))
        entry.update(t_s=t, vehicles=[vehicle + 1], why=f"first: {status}; in all {counts}")
    return _decide(entry, failures == 0, end)


def _limits(tally: Tally, end: str | None) -> dict[str, Any]:
    entry = _entry(
        "command-limits",
        "commands stay in U",
        "eq. (5), actuator rows",
        "smallest distance of a command inside its limits, as a share of their range",
        "",
    )
    vehicle, value, t = tally.command_margin.worst()
    if vehicle < 0:
        return entry | {"verdict": PREMISE, "why": "no command was given"}
    entry.update(value=value, bound=0.0, margin=value, t_s=t, vehicles=[vehicle + 1])
    return _decide(entry, value >= 0.0, end)


def _goals(s: Scenario, tally: Tally, end: str | None) -> dict[str, Any]:
    entry = _entry(
        "goal",
        f"every vehicle passes its goal within {s.goal_radius_m:g} m before the run ends",
        "Section V: vehicles reach their waypoints",
        "largest over vehicles of the closest approach to the goal",
        "m",
    )
    worst = int(np.argmax(tally.goal.value))
    value = float(tally.goal.value[worst])
    entry.update(
        value=value,
        bound=s.goal_radius_m,
        margin=s.goal_radius_m - value,
        t_s=float(tally.goal.t[worst]),
        vehicles=[worst + 1],
    )
    late = np.flatnonzero(np.isnan(tally.passed))
    if late.size:
        entry["why"] = f"{late.size} of {tally.vehicles} not within it by the end"
    else:
        entry["why"] = f"the last passed at {float(np.max(tally.passed)):.2f} s"
    return _decide(entry, value <= s.goal_radius_m, end)
