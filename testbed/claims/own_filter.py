"""Judges G4 and G6 of a user's own filter: by the rows that it declares, never by what it says of them."""

from __future__ import annotations

from testbed.claims.judging import decide, premise_not_met
from testbed.measures.run_statistics import RunStatistics
from testbed.records.verdict import Verdict

ROW_TOLERANCE_MPS = 1e-6
NONE = "it declares no constraints"
OTHERS = "its own rows are satisfied, those of the scenario's barrier at the true state are not always"


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
    return decide(v, True, end) if _true_rows_hold(statistics) else premise_not_met(v, OTHERS)


def rows(statistics: RunStatistics, v: Verdict, end: str | None) -> Verdict:
    """G6: the commands satisfy the declared rows, and those of the scenario's barrier."""
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
    return decide(v, True, end) if _true_rows_hold(statistics) else premise_not_met(v, OTHERS)


def _true_rows_hold(statistics: RunStatistics) -> bool:
    _, least, _ = statistics.true_rows.worst()
    return not statistics.h.value.size or least >= -ROW_TOLERANCE_MPS
