"""Verdicts from hand-made numbers: the worst pair, early ends, and a user's filter by its declaration."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import numpy as np
import pytest

from filters.barriers.pairs import all_pairs
from filters.model import Limits
from testbed.claims import own_filter, registry
from testbed.claims.judging import (
    at_pair,
    decide,
    decide_premise,
    finer,
    leave_open,
    premise_not_met,
    void,
)
from testbed.claims.promises import excused
from testbed.measures.declared_barrier import DeclaredBarrier
from testbed.measures.declared_rows import DeclaredRows
from testbed.measures.extreme import Extreme
from testbed.measures.run_statistics import RunStatistics
from testbed.records.verdict import Status, Verdict
from testbed.scenario.scenario import load

I, J = all_pairs(3)
END = "stalled at 1 s; run stopped"
LIMITS = Limits(*(np.full(3, v) for v in (15.0, 25.0, 0.2, 1.0)))
G2 = registry.SAFE_SET.unjudged("root", 20.0)
P5 = registry.GRADIENT.unjudged("root", 20.0)


def extreme(*values: float, t: float = 2.5) -> Extreme:
    return Extreme(np.array(values), np.where(np.isposinf(values), nan, t))


def stands(v: Verdict) -> tuple[Status, str]:
    return v.status, v.why


def numbers(v: Verdict) -> tuple[Any, ...]:
    return v.value, v.bound, v.margin, v.instant, v.vehicles


def test_a_verdict_has_the_worst_pairs_value_margin_instant_and_vehicles() -> None:
    found = at_pair(G2, extreme(3.0, 1.5, 2.0), I, J, 0.25)
    assert numbers(found) == (1.5, 0.25, 1.25, 2.5, (1, 3)) and found.status is Status.NOT_APPLICABLE
    assert numbers(at_pair(G2, extreme(3.0, 2.0, -1.0), I, J, 0.25)) == (-1.0, 0.25, -1.25, 2.5, (2, 3))
    assert numbers(at_pair(G2, extreme(-3.0, 2.0, -1.0), I, J, 0.0))[-1] == (1, 2)
    assert at_pair(G2, extreme(inf, inf, inf), I, J, 0.25) is G2
    assert at_pair(G2, Extreme.of(0), I, J, 0.25) is G2


def test_a_run_that_ended_early_holds_nothing_and_decides_nothing() -> None:
    assert stands(decide(G2, True, None)) == (Status.HOLDS, "")
    assert stands(decide(G2, False, None)) == (Status.VIOLATED, "")
    assert stands(decide(G2, True, END)) == (Status.PREMISE_NOT_MET, END)
    assert stands(decide(G2, False, END)) == (Status.VIOLATED, "")
    assert stands(leave_open(G2, "finer", None)) == (Status.OPEN, "finer")
    assert stands(leave_open(G2, "finer", END)) == (Status.PREMISE_NOT_MET, END)
    assert stands(premise_not_met(G2, "no")) == (Status.PREMISE_NOT_MET, "no")


def test_a_premise_that_fails_violates_nothing_and_keeps_its_own_reason() -> None:
    assert stands(decide_premise(P5, True)) == (Status.HOLDS, "")
    assert stands(decide_premise(P5, False, "zero")) == (Status.PREMISE_NOT_MET, "zero")
    assert stands(decide_premise(P5.but(why="first"), False, "second")) == (Status.PREMISE_NOT_MET, "first")
    assert stands(decide_premise(P5, True, "noted")) == (Status.HOLDS, "noted")


def test_at_an_early_end_what_holds_is_void_but_premises() -> None:
    given = [G2.but(status=status) for status in Status] + [P5.but(status=Status.HOLDS)]
    assert void(given, None) is given
    after = void(given, END)
    for old, new in zip(given, after, strict=True):
        if old.id == G2.id and old.status is Status.HOLDS:
            assert stands(new) == (Status.PREMISE_NOT_MET, END)
        else:
            assert new is old


# Between samples


@pytest.mark.parametrize(
    ("possible", "radius", "bound", "dt", "would"),
    [
        # The lines pass at 5.6 and the paths at 5.2 or more; at half dt the radius is those 0.2.
        (4.8, 0.8, 5.0, 0.01, "fdm_dt_s <= 0.005 would do"),
        (4.87515, 0.25, 5.0, 0.01, "fdm_dt_s <= 0.00024 would do"),  # sqrt(0.0006) = 0.02449
        (4.9, 0.25, 5.0, 0.1, "fdm_dt_s <= 0.031 would do"),  # sqrt(0.1) = 0.3162, rounded down
        (4.99, 0.08, 5.0, 0.02, "fdm_dt_s <= 0.012 would do"),  # sqrt(0.375) = 0.6124
        (4.0, 2.0, 5.0, 0.02, "for example fdm_dt_s = 0.005"),  # the paths pass just at the bound
        (4.0, 1.0, 5.0, 0.02, "for example fdm_dt_s = 0.005"),
        (4.0, 0.5, 5.0, 0.02, "for example fdm_dt_s = 0.005"),
        (4.0, 0.5, 5.0, 0.005, "for example fdm_dt_s = 0.0012"),
    ],
)
def test_a_period_that_would_decide_is_rounded_down_to_two_digits(
    possible: float, radius: float, bound: float, dt: float, would: str
) -> None:
    said = finer(possible, radius, bound, dt)
    assert said == f"paths between samples may come as near as {possible:.6g} m: sample finer, {would}"


def test_paths_of_which_nothing_is_known_may_be_anywhere() -> None:
    said = finer(-inf, inf, 5.0, 0.02)
    assert said == "paths between samples may be anywhere: sample finer, for example fdm_dt_s = 0.005"
    said = finer(4.0, inf, 5.0, 0.02)
    assert said == "paths between samples may come as near as 4 m: sample finer, for example fdm_dt_s = 0.005"


@pytest.mark.parametrize("share", np.linspace(0.05, 0.95, 9))
def test_the_period_that_would_do_does(share: float) -> None:
    """With the radius of that period the bound is kept, and with that of one a ninth longer it is not."""
    radius, bound, dt = 0.3, 5.0, 0.01
    line = bound + radius * (0.5 + share)  # and the paths themselves half a radius nearer
    said = float(finer(line - radius, radius, bound, dt).split("fdm_dt_s <= ")[1].split()[0])
    assert line - radius * (0.5 + (said / dt) ** 2) >= bound - 1e-12
    assert line - radius * (0.5 + (1.11 * said / dt) ** 2) < bound


# A user's own filter

OTHERS, OWN_OTHERS = (
    f"its own rows are satisfied, those of {whose} at the true state are not always"
    for whose in ("the scenario's barrier", "its barrier")
)

G4, G6 = (c.unjudged("root", 20.0) for c in (registry.QP_FEASIBILITY, registry.ROWS_SATISFIED))


def rows(least: float = 0.5, unsolvable: int = 0) -> DeclaredRows:
    return DeclaredRows(LIMITS, least, 1.5, (0, 2), unsolvable, 0.7 if unsolvable else nan)


def flown(
    declared: DeclaredRows | None = None,
    true: float = 1.0,
    own: DeclaredBarrier | None = None,
    steps: int = 4,
) -> RunStatistics:
    """Of three vehicles; `true` is the least of the scenario's rows at the true state."""
    made = RunStatistics(3, foreign=True, declared=declared, own=own)
    made.filter_steps = steps
    made.true_rows = extreme(2.0, true, 3.0)
    return made


def test_rows_are_satisfied_to_a_millionth() -> None:
    assert own_filter.ROW_TOLERANCE_MPS == 1e-6
    for least, status in ((-9e-7, Status.HOLDS), (-1e-6, Status.HOLDS), (-1.1e-6, Status.VIOLATED)):
        assert own_filter.rows(flown(rows(least)), G6, None).status is status
    for true, status in ((-9e-7, Status.HOLDS), (-1e-6, Status.HOLDS), (-1.1e-6, Status.PREMISE_NOT_MET)):
        assert own_filter.rows(flown(rows(), true), G6, None).status is status
        assert own_filter.feasibility(flown(rows(), true), G4, None).status is status


def test_declared_rows_are_judged_by_the_least_of_them() -> None:
    found = own_filter.rows(flown(rows(0.5)), G6, None)
    assert numbers(found) == (0.5, -1e-6, 0.5 + 1e-6, 1.5, (1, 3)) and stands(found) == (Status.HOLDS, "")
    found = own_filter.rows(flown(rows(-0.5)), G6, None)
    assert numbers(found) == (-0.5, -1e-6, -0.5 + 1e-6, 1.5, (1, 3)) and found.status is Status.VIOLATED
    assert own_filter.rows(flown(rows(nan)), G6, None).status is Status.VIOLATED
    assert stands(own_filter.rows(flown(rows(0.5)), G6, END)) == (Status.PREMISE_NOT_MET, END)
    found = own_filter.rows(flown(rows(inf)), G6, None)
    assert stands(found) == (Status.PREMISE_NOT_MET, "the filter declared no row at any step")
    assert numbers(found) == numbers(G6)
    found = own_filter.rows(flown(rows(0.5), -1.0), G6, None)
    assert stands(found) == (Status.PREMISE_NOT_MET, OTHERS) and found.value == 0.5
    assert own_filter.rows(flown(rows(-0.5), -1.0), G6, None).status is Status.VIOLATED
    assert own_filter.rows(flown(rows(0.5), nan), G6, None).status is Status.PREMISE_NOT_MET


def test_without_declared_rows_or_pairs_there_is_nothing_to_judge() -> None:
    none = (Status.NOT_APPLICABLE, "it declares no constraints")
    assert stands(own_filter.rows(flown(), G6, None)) == none
    assert stands(own_filter.feasibility(flown(), G4, None)) == none
    alone = RunStatistics(1, foreign=True, declared=rows())
    alone.filter_steps = 1
    assert stands(own_filter.rows(alone, G6, None)) == (Status.NOT_APPLICABLE, "no rows")
    assert own_filter.feasibility(alone, G4, None).status is Status.HOLDS


def test_feasibility_counts_the_vehicles_of_each_step_without_a_solution() -> None:
    found = own_filter.feasibility(flown(rows()), G4, None)
    assert numbers(found) == (0, 0, 0, None, ()) and stands(found) == (Status.HOLDS, "")
    found = own_filter.feasibility(flown(rows(unsolvable=2)), G4, None)
    assert numbers(found) == (6, 0, -6, 0.7, ())
    assert stands(found) == (Status.VIOLATED, "its own rows have no solution")
    assert own_filter.feasibility(flown(rows(unsolvable=2)), G4, END).status is Status.VIOLATED
    assert stands(own_filter.feasibility(flown(rows()), G4, END)) == (Status.PREMISE_NOT_MET, END)
    found = own_filter.feasibility(flown(rows(), steps=0), G4, None)
    assert stands(found) == (Status.PREMISE_NOT_MET, "no command was given") and found.value is None
    assert own_filter.feasibility(flown(rows(), steps=1), G4, None).status is Status.HOLDS
    found = own_filter.feasibility(flown(rows(), -1.0), G4, None)
    assert stands(found) == (Status.PREMISE_NOT_MET, OTHERS) and found.value == 0
    # By its own barrier the scenario's rows are not its own.
    found = own_filter.feasibility(flown(rows(), -1.0, own=barrier()), G4, None)
    assert found.status is Status.HOLDS


# A filter that declares a barrier

S = load("paper-2-turn")


def barrier(h: float = 1.0, condition: float = 2.0, row: float = 3.0, alpha: bool = True) -> DeclaredBarrier:
    made = DeclaredBarrier(3, alpha)
    made.h = extreme(5.0, 6.0, h, t=0.5)
    made.condition = extreme(5.0, condition, 9.0, t=0.6)
    made.rows = extreme(row, 6.0, 9.0, t=0.7)
    return made


def promises(
    own: DeclaredBarrier | None,
    declared: DeclaredRows | None = None,
    end: str | None = None,
    scenario: Any = S,
) -> list[Verdict]:
    """O1 to O3."""
    found = own_filter.judged_by_its_own([G2], scenario, flown(declared, own=own), I, J, end)
    assert [v.number for v in found] == ["G2", "O1", "O2", "O3"]
    return found[1:]


def test_a_promise_that_is_kept_holds_with_its_worst_pair() -> None:
    safe, condition, satisfied = promises(barrier(), rows(0.25))
    assert numbers(safe) == (1.0, -1e-9, 1.0 + 1e-9, 0.5, (2, 3))
    assert numbers(condition) == (2.0, -1e-3, 2.0 + 1e-3, 0.6, (1, 3))
    assert numbers(satisfied) == (0.25, -1e-6, 0.25 + 1e-6, 1.5, (1, 3))
    assert {stands(v) for v in (safe, condition, satisfied)} == {(Status.HOLDS, "")}
    for v in promises(barrier(), rows(0.25), END):
        assert stands(v) == (Status.PREMISE_NOT_MET, END)


@pytest.mark.parametrize(
    ("which", "least", "tolerance"), [(0, "h", 1e-9), (1, "condition", 1e-3), (2, "least", 1e-6)]
)
def test_a_promise_is_judged_with_the_tolerance_of_the_papers_claims(
    which: int, least: str, tolerance: float
) -> None:
    for value, status in (
        (-0.99 * tolerance, Status.HOLDS),
        (-tolerance, Status.HOLDS),
        (-1.01 * tolerance, Status.VIOLATED),
        (nan, Status.VIOLATED),
    ):
        own = barrier() if least == "least" else barrier(**{least: value})
        found = promises(own, rows(value) if least == "least" else rows())
        assert found[which].status is status, value
        others = [v for k, v in enumerate(found) if k != which]
        assert {v.status for v in others} == {Status.HOLDS}


def test_rows_that_ask_for_less_than_the_barrier_prove_nothing() -> None:
    for row, due in (
        (-1.1e-6, OWN_OTHERS),
        (-9e-7, ""),
        (-1e-6, ""),
        (nan, OWN_OTHERS),
    ):
        found = promises(barrier(row=row), rows())[2]
        assert stands(found) == (Status.PREMISE_NOT_MET if due else Status.HOLDS, due), row
    # Without an alpha the barrier has no rows, and of pairs that have left nothing is known.
    assert promises(barrier(row=-1.0, alpha=False), rows())[2].status is Status.HOLDS
    none = barrier()
    none.rows = Extreme.of(3)
    assert promises(none, rows())[2].status is Status.HOLDS
    first = barrier()
    first.rows = extreme(-1.0, inf, inf)  # the pair of index 0
    assert promises(first, rows())[2].status is Status.PREMISE_NOT_MET


def test_what_is_not_declared_or_was_not_flown_is_not_judged() -> None:
    safe, condition, satisfied = promises(barrier(alpha=False))
    assert safe.status is Status.HOLDS
    assert stands(condition) == (Status.NOT_APPLICABLE, "it declares no alpha") and condition.value is None
    assert stands(satisfied) == (Status.NOT_APPLICABLE, "it declares no constraints")
    nothing = DeclaredBarrier(3, True)
    safe, condition, _ = promises(nothing, rows())
    assert stands(safe) == (Status.PREMISE_NOT_MET, "no decision was taken")
    assert stands(condition) == (Status.PREMISE_NOT_MET, "the run had no motion")
    assert numbers(safe) == numbers(condition) == (None, None, None, None, ())
    for v in promises(None):
        assert stands(v) == (Status.NOT_APPLICABLE, "no decision was taken") and v.value is None
    none = np.zeros(0, dtype=int)
    for v in own_filter.judged_by_its_own([], S, flown(), none, none, None):
        assert stands(v) == (Status.NOT_APPLICABLE, "a single vehicle has no pair")


def test_promises_have_the_words_and_units_of_the_scenario() -> None:
    for v, claim in zip(promises(barrier()), registry.OWN, strict=True):
        assert (v.id, v.claim, v.unit) == (claim.id, claim.text, claim.unit)


def test_what_rests_on_the_scenarios_barrier_is_measured_and_not_judged() -> None:
    every = [c.unjudged("root", 20.0).but(status=Status.VIOLATED, value=-1.0) for c in registry.EVERY]
    found = own_filter.judged_by_its_own(every, S, flown(own=barrier()), I, J, None)[: len(every)]
    excused = {"G2", "G3", "G4a", "G6", "G9", "G11"}
    for v in found:
        assert v.value == -1.0
        if v.number in excused:
            assert stands(v) == (Status.NOT_APPLICABLE, "not this filter's claim")
        else:
            assert stands(v) == (Status.VIOLATED, "")
    assert own_filter.excused(every, {"goal"})[0] is every[0]
    [goal] = (v for v in own_filter.excused(every, {"goal"}) if v.status is Status.NOT_APPLICABLE)
    assert goal.number == "G7"


def test_the_flow_filter_is_excused_from_the_same_but_the_rows() -> None:
    own, flow = excused(declared=True), excused(declared=False, kind="flow")
    assert own - flow == {"rows-satisfied"} and flow < own and len(own) == 6
    assert excused(declared=True, kind="flow") == flow
    assert excused(declared=False) == frozenset()


def test_the_scenarios_rows_are_measured_at_their_worst_pair() -> None:
    found = own_filter.measured(flown(true=-2.0), G6, I, J)
    assert numbers(found) == (-2.0, -1e-6, -2.0 + 1e-6, 2.5, (1, 3)) and found.status is G6.status
