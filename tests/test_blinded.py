"""Extremes cannot be blinded: one NaN anywhere is never a pass, and no reduction drops it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filters.constraints import Constraints
from filters.model import Limits
from testbed.claims.guarantees import Flown, judge
from testbed.measures.declared_rows import DeclaredRows
from testbed.measures.run_statistics import Extreme, RunStatistics
from testbed.records.verdict import Status
from testbed.scenario.scenario import load

ROOT = Path(__file__).parent.parent
N, P, STEPS = 3, 3, 4
LIMITS = Limits(*(np.full(N, v) for v in (15.0, 25.0, 0.2, 1.0)))
T = 0.1 * np.arange(STEPS)


@pytest.mark.parametrize("at", range(6))
@pytest.mark.parametrize("where", range(P))
@pytest.mark.parametrize("block", [1, 2, 6])
def test_an_extreme_keeps_a_nan_wherever_it_comes(at: int, where: int, block: int) -> None:
    """In any place, first, last or between, in blocks of any length, before and after smaller values."""
    values = np.arange(18.0)[::-1].reshape(6, P).copy()
    values[at, where] = np.nan
    seen = Extreme.of(P)
    for k in range(0, 6, block):
        seen.update(np.arange(6.0)[k : k + block], values[k : k + block])
    worst, value, t = seen.worst()
    assert (worst, t) == (where, float(at)) and np.isnan(value)
    others = [p for p in range(P) if p != where]
    assert np.array_equal(seen.value[others], values[-1, others])


def spoilt(values: np.ndarray, place: int) -> np.ndarray:
    values = values.astype(float).copy()
    if place >= 0:
        values.flat[place % values.size] = np.nan
    return values


# What is taken in, with a NaN at `place` (none below 0) -> the guarantees that rest on it.
def positions(s: RunStatistics, place: int) -> None:
    x = 100.0 * np.arange(N)[:, None] + 0.1 * np.arange(1, STEPS + 1)[:, None, None] * np.ones(3)
    s.positions(T, spoilt(x, place), 1)


def decided(s: RunStatistics, place: int) -> None:
    u = np.tile([20.0, 0.0, 0.0], (STEPS, N, 1))
    s.decided(T, 0.1, spoilt(u, place), u, u, np.zeros((STEPS, N), dtype=bool), LIMITS)


def barrier(s: RunStatistics, place: int) -> None:
    h = spoilt(np.full((STEPS, P), 50.0), place)
    s.barrier(T, h, np.zeros((2, 3, STEPS, P)), h**3, LIMITS)


def lie(s: RunStatistics, place: int) -> None:
    h = np.full((STEPS, P), 50.0)
    s.barrier(T, h, spoilt(np.ones((2, 3, STEPS, P)), place), h**3, LIMITS)


def condition(s: RunStatistics, place: int) -> None:
    s.condition.update(T, spoilt(np.ones((STEPS, P)), place))


def rows(s: RunStatistics, place: int) -> None:
    s.rows.update(T, spoilt(np.ones((STEPS, P)), place))


MEASURES: dict[str, tuple[Callable[[RunStatistics, int], None], tuple[str, ...], int]] = {
    "positions": (positions, ("separation", "goal"), STEPS * N * 3),
    "commands": (decided, ("command-limits",), STEPS * N * 3),
    "h": (barrier, ("safe-set", "zcbf-condition"), STEPS * P),
    "L_g h": (lie, ("zcbf-condition",), 2 * 3 * STEPS * P),
    "condition": (condition, ("barrier-condition",), STEPS * P),
    "rows": (rows, ("rows-satisfied",), STEPS * P),
}


def judged(measure: Callable[[RunStatistics, int], None], place: int) -> dict[str, Status]:
    scenario = load("paper-2-turn", ["vehicles=3"])
    statistics = RunStatistics(N)
    start = 100.0 * np.arange(N)[:, None] * np.ones(3)
    statistics.start(start, start, 4.0)
    statistics.filter_steps = statistics.solves = 1
    measure(statistics, place)
    i, j = np.triu_indices(N, 1)
    flown = Flown(scenario, statistics, i, j, True, None, np.full(N, 400.0), np.full(N, 15.0))
    return {v.id: v.status for v in judge(flown)}


@pytest.mark.parametrize("name", MEASURES)
def test_a_nan_in_any_place_of_a_measure_is_never_a_pass(name: str) -> None:
    measure, claims, places = MEASURES[name]
    assert {judged(measure, -1)[claim] for claim in claims} == {Status.HOLDS}
    for place in range(places):
        said = judged(measure, place)
        assert Status.HOLDS not in {said[claim] for claim in claims if claim != "goal"}, place
        # Of a vehicle that is nowhere it is not known whether it passed its goal later.
        assert "goal" not in claims or said["goal"] is not Status.HOLDS, place


def test_a_nan_in_a_residual_is_kept() -> None:
    for place in range(STEPS * N):
        statistics = RunStatistics(N)
        residual = spoilt(np.zeros((STEPS, N)), place)
        inside = np.ones(STEPS, dtype=bool)
        statistics.solved(T, np.ones((STEPS, N), dtype=int), residual, inside)
        statistics.solved(T, np.ones((STEPS, N), dtype=int), np.zeros((STEPS, N)), inside)
        assert np.isnan(statistics.worst_residual)


@pytest.mark.parametrize("place", range(9))
def test_a_nan_in_a_declared_row_is_no_row_satisfied(place: int) -> None:
    seen = DeclaredRows(LIMITS)
    lies = spoilt(np.ones((3, 3)), place)
    rows_ = Constraints((np.arange(3),), (lies,), np.zeros(3), np.zeros(3))
    seen.update(0.0, (rows_,), np.tile([20.0, 0.0, 0.0], (3, 1)))
    fine = Constraints((np.arange(3),), (np.ones((3, 3)),), np.zeros(3), np.zeros(3))
    seen.update(0.1, (fine,), np.tile([20.0, 0.0, 0.0], (3, 1)))
    assert np.isnan(seen.least) and seen.unsolvable == 1 and seen.t == 0.0


# Reductions that leave NaN out, in numpy, pandas and Python.
DROPS = re.compile(
    r"\b(nanmin|nanmax|nanargmin|nanargmax|nansum|nanmean|nanmedian|nanquantile|nanpercentile|nan_to_num"
    r"|fmin|fmax|dropna|fillna|nanprod|nancumsum|nanstd)\b"
)


def test_no_measure_and_no_claim_uses_a_reduction_that_drops_a_nan() -> None:
    files = [f for d in ("measures", "claims", "simulation") for f in (ROOT / "testbed" / d).rglob("*.py")]
    assert len(files) > 15
    found: list[Any] = [
        f"{file.name}:{k}: {line.strip()}"
        for file in files
        for k, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if DROPS.search(line)
    ]
    assert not found


def test_the_reductions_that_drop_a_nan_are_known() -> None:
    assert all(DROPS.search(f"x = np.{name}(a)") for name in ("nanmin", "fmax", "nanargmin", "nan_to_num"))
    assert not DROPS.search("np.minimum(a, b).min()")
