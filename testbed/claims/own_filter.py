"""Judges a user's own filter by what it declares, never by what it says of itself.

Of a filter that declares constraints alone: G4 and G6, by its rows. Of one that declares a barrier: O1 to O3,
by that barrier, its alpha and its rows; claims that rest on the scenario's barrier are then not its claims.
"""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from testbed.claims import promises, registry
from testbed.claims.judging import at_pair, decide, premise_not_met
from testbed.measures.declared_barrier import DeclaredBarrier
from testbed.measures.run_statistics import RunStatistics
from testbed.records.verdict import Status, Verdict
from testbed.scenario.scenario import Scenario

# Round-off of h, what a filter period's curvature may take from hdot, and what rows are satisfied to: as of
# the paper's claims.
H_TOLERANCE, CONDITION_TOLERANCE, ROW_TOLERANCE_MPS = 1e-9, 1e-3, 1e-6
NONE = "it declares no constraints"
OTHERS = "its own rows are satisfied, those of the scenario's barrier at the true state are not always"
OWN_OTHERS = "its own rows are satisfied, those of its barrier at the true state are not always"


def feasibility(statistics: RunStatistics, v: Verdict, end: str | None) -> Verdict:
    """G4: the declared rows had a solution at every step."""
    declared = statistics.declared
    if declared is None:
        return v.but(why=NONE)
    if not statistics.filter_steps:
        return premise_not_met(v, "no command was given")
    failures = declared.unsolvable * statistics.vehicles
    v = v.but(value=failures, bound=0, margin=-failures)
    if failures:
        return decide(v.but(instant=declared.first, why="its own rows have no solution"), False, end)
    if statistics.own is None and not _true_rows_hold(statistics):
        return premise_not_met(v, OTHERS)
    return decide(v, True, end)


def rows(statistics: RunStatistics, v: Verdict, end: str | None) -> Verdict:
    """G6: the commands satisfy the declared rows, and those of the scenario's barrier."""
    return _declared_rows(statistics, v, end, "" if _true_rows_hold(statistics) else OTHERS)


def _declared_rows(statistics: RunStatistics, v: Verdict, end: str | None, others: str) -> Verdict:
    """By the declared rows; `others` says which further rows are not satisfied, "" if they are."""
    declared = statistics.declared
    if declared is None or not statistics.h.value.size:
        return v.but(why=NONE if declared is None else "no rows")
    if declared.least == float("inf"):
        return premise_not_met(v, "the filter declared no row at any step")
    vehicles = tuple(k + 1 for k in declared.vehicles)
    bound = -ROW_TOLERANCE_MPS
    margin = declared.least - bound
    v = v.but(value=declared.least, bound=bound, margin=margin, instant=declared.t, vehicles=vehicles)
    if not margin >= 0.0:
        return decide(v, False, end)
    return premise_not_met(v, others) if others else decide(v, True, end)


def excused(verdicts: Sequence[Verdict], claims: Container[str]) -> list[Verdict]:
    """The verdicts, those on `claims` (ids) measured and not judged."""
    return [
        v.but(status=Status.NOT_APPLICABLE, why=registry.NOT_ITS_CLAIM) if v.id in claims else v
        for v in verdicts
    ]


def judged_by_its_own(
    verdicts: Sequence[Verdict],
    s: Scenario,
    statistics: RunStatistics,
    i: np.ndarray,
    j: np.ndarray,
    end: str | None,
) -> list[Verdict]:
    """The verdicts on a filter that declares a barrier, those that are not its claims excused, and O1 to O3.

    i, j  (P,) vehicles of each pair, from 0
    """
    kept = excused(verdicts, promises.excused(declared=True))
    own, (safe, condition, own_rows) = (
        statistics.own,
        (claim.unjudged(s.barrier.form, s.goal_radius_m) for claim in registry.OWN),
    )
    if own is None:
        none = "a single vehicle has no pair" if not i.size else "no decision was taken"
        return [*kept, *(v.but(why=none) for v in (safe, condition, own_rows))]
    safe = _least(safe, at_pair(safe, own.h, i, j, -H_TOLERANCE), "no decision was taken", end)
    if own.alpha:
        found = at_pair(condition, own.condition, i, j, -CONDITION_TOLERANCE)
        condition = _least(condition, found, "the run had no motion", end)
    else:
        condition = condition.but(why="it declares no alpha")
    return [*kept, safe, condition, _declared_rows(statistics, own_rows, end, _short(own))]


def measured(statistics: RunStatistics, v: Verdict, i: np.ndarray, j: np.ndarray) -> Verdict:
    """G6 where it is not the filter's claim: the rows of the scenario's barrier at the true state."""
    return at_pair(v, statistics.true_rows, i, j, -ROW_TOLERANCE_MPS)


def _least(empty: Verdict, found: Verdict, missing: str, end: str | None) -> Verdict:
    if found.value is None or found.bound is None:
        return premise_not_met(empty, missing)
    return decide(found, found.value >= found.bound, end)


def _short(own: DeclaredBarrier) -> str:
    """Which rows of the declared barrier at the true state are not satisfied; "" if all are."""
    p, least, _ = own.rows.worst()
    return OWN_OTHERS if own.alpha and p >= 0 and not least >= -ROW_TOLERANCE_MPS else ""


def _true_rows_hold(statistics: RunStatistics) -> bool:
    _, least, _ = statistics.true_rows.worst()
    return not statistics.h.value.size or least >= -ROW_TOLERANCE_MPS
