"""Value, margin and verdict of a claim never disagree: it holds where its margin is not negative."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.barriers.closed_form import TurnBarrier
from filters.cbf.theorem_monitor import theorem_checks
from filters.filter import MonitorRecord
from testbed.claims.guarantees import Flown, judge
from testbed.claims.monitored import monitored
from testbed.claims.premises import premises
from testbed.components import catalogue
from testbed.measures.run_statistics import RunStatistics
from testbed.records.verdict import Kind, Status, Verdict
from testbed.scenario.scenario import Scenario, load
from testbed.simulation.simulate import run

S = load("paper-2-turn")
# Near every bound and tolerance, far from them, and what is no number.
NEAR = st.sampled_from([0.0, 1e-12, 1e-9, 1e-6, 1e-3, 5e-4, 1.0, 5.0, 20.0, np.nan, np.inf])
NUMBER = st.builds(lambda size, sign: sign * size, NEAR, st.sampled_from([-1.0, 1.0])) | st.floats(-30, 30)


def agrees(v: Verdict) -> bool:
    """Whether value, bound, margin and status say the same."""
    if v.value is None or v.bound is None or v.margin is None:
        return v.margin is None
    apart = v.value - v.bound
    follows = np.isclose(abs(v.margin), abs(apart), equal_nan=True)
    if v.status is Status.HOLDS:
        return bool(follows and v.margin >= 0.0)
    lost = Status.PREMISE_NOT_MET if v.kind is Kind.PREMISE else Status.VIOLATED
    return bool(follows and (v.status is not lost or not v.margin > 0.0))


def statistics(numbers: list[float]) -> RunStatistics:
    """Of two vehicles, each extreme one of `numbers`."""
    made, take = RunStatistics(2), iter(numbers)
    for name in ("h", "condition", "admissible", "rows", "gradient", "kink", "separation"):
        number = next(take)  # a distance is never negative
        getattr(made, name).update(1.0, np.array([abs(number) if name == "separation" else number]))
    made.between.update(1.0, np.minimum(made.separation.value, 30.0))
    made.command_margin.update(1.0, np.array([next(take), next(take)]))
    made.goal.update(1.0, np.abs(np.nan_to_num([next(take), next(take)], nan=1.0, posinf=9.0, neginf=9.0)))
    made.passed = np.where(made.goal.value <= S.goal_radius_m, 1.0, np.nan)
    made.filter_steps = made.solves = 1
    return made


@settings(max_examples=400, deadline=None)
@given(st.lists(NUMBER, min_size=11, max_size=11), st.sampled_from([None, "ground at 1 s; run stopped"]))
def test_of_any_extremes(numbers: list[float], end: str | None) -> None:
    i, j = np.triu_indices(2, 1)
    flown = Flown(S, statistics(numbers), i, j, True, end, np.full(2, 400.0))
    verdicts = judge(flown)
    barrier = catalogue.barrier(S)
    assert isinstance(barrier, TurnBarrier)
    verdicts += premises(flown, barrier, catalogue.limits(S), [])
    assert [v for v in verdicts if not agrees(v)] == []


@settings(max_examples=200, deadline=None)
@given(st.lists(NUMBER, min_size=1, max_size=4))
def test_of_any_numbers_of_a_monitor(numbers: list[float]) -> None:
    record = MonitorRecord(checks=theorem_checks())
    for check in record.checks.values():
        for number in numbers:
            check.see(3, np.array([number]))
    assert [v for v in monitored(record, S) if not agrees(v)] == []


RUNS = [
    [], ["filter.kind=none"], ["filter.kind=limited"], ["plant=lagged"], ["barrier.kind=straight"],
    ["vehicles=5"], ["barrier.form=squared", "alpha.kind=linear"], ["remedy.smoothing_m2=30"],
    ["filter.monitor=true"], ["radius_m=7"], ["wind.speed_mps=5", "plant=lagged"], ["vehicles=1"],
    ["sensing.position_noise_m=2"], ["v_max_mps=16"], ["goal_radius_m=1"],
]  # fmt: skip


def scenario(more: list[str]) -> Scenario:
    short = ["radius_m=60", "lookahead_m=10", "duration_s=4", "filter_dt_s=0.05", "record_dt_s=0.05"]
    return load("paper-2-turn", [*short, "manoeuvre_instants=2", *more])


@pytest.mark.parametrize("more", RUNS, ids=lambda more: " ".join(more) or "plain")
def test_of_runs(more: list[str]) -> None:
    made = run(scenario(more), force=True)
    assert [v for v in made.guarantees if not agrees(v)] == []
