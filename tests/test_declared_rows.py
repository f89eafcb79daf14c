"""Rows that a user filter declares: least slack, where and when, and whether an input satisfies all."""

from __future__ import annotations

import numpy as np
import pytest

from filters.constraints import Constraints
from filters.model import Limits
from filters.qp.single import RESIDUAL
from testbed.measures.declared_rows import DeclaredRows
from testbed.measures.extreme import Extreme

# Two vehicles: v in [10, 20] m/s, |omega| <= 0.5 rad/s, |zeta| <= 2 m/s.
LIMITS = Limits(*(np.full(2, x) for x in (10.0, 20.0, 0.5, 2.0)))
MIDDLE = np.array([[15.0, 0.0, 0.0], [15.0, 0.0, 0.0]])


def rows(lies: list[list[float]], rhs: list[float], vehicles: tuple[int, ...] = (0, 1)) -> Constraints:
    """A row per entry: sum over the vehicles of lie . u >= rhs, with the same lie for each of them."""
    n = len(rhs)
    where = tuple(np.full(n, v) for v in vehicles)
    return Constraints(where, tuple(np.array(lies, dtype=float) for _ in vehicles), np.ones(n), np.array(rhs))


def seen(*updates: tuple[float, list[Constraints], np.ndarray]) -> DeclaredRows:
    found = DeclaredRows(LIMITS)
    for t, blocks, u in updates:
        found.update(t, blocks, u)
    return found


def test_without_rows_nothing_is_unsolvable_even_outside_the_limits() -> None:
    none = rows([], [], ())
    found = seen((0.0, [], MIDDLE), (1.0, [none], MIDDLE), (2.0, [], 3.0 * MIDDLE))
    assert (found.least, found.unsolvable) == (np.inf, 0) and np.isnan(found.first)


def test_the_least_slack_is_kept_with_its_first_instant_and_its_vehicles() -> None:
    """v1 + v2 >= rhs at v = 15 each leaves 30 - rhs; a row over one vehicle leaves 15 - rhs."""
    both = rows([[1, 0, 0], [1, 0, 0]], [20.0, 27.0])
    found = seen(
        (0.0, [both], MIDDLE), (1.0, [both], MIDDLE), (2.0, [rows([[1, 0, 0]], [14.0], (1,))], MIDDLE)
    )
    assert (found.least, found.t, found.vehicles, found.unsolvable) == (1.0, 2.0, (1,), 0)
    first = seen((0.0, [both], MIDDLE), (1.0, [both], MIDDLE))
    assert (first.least, first.t, first.vehicles) == (3.0, 0.0, (0, 1))


def test_an_empty_block_does_not_hide_the_one_after_it() -> None:
    found = seen((0.0, [rows([], [], ()), rows([[1, 0, 0]], [31.0])], MIDDLE))
    assert found.least == -1.0 and found.unsolvable == 0  # 20 + 20 would do


@pytest.mark.parametrize(
    ("rhs", "unsolvable"), [(39.0, 0), (40.0, 0), (40.0 + 5e-7, 0), (40.0 + 1e-5, 1), (41.0, 1)]
)
def test_solvable_is_what_some_input_in_the_limits_satisfies(rhs: float, unsolvable: int) -> None:
    """v1 + v2 is at most 40."""
    assert seen((0.0, [rows([[1, 0, 0]], [rhs])], MIDDLE)).unsolvable == unsolvable


def test_rows_that_exclude_each_other_are_unsolvable_together_only() -> None:
    fast, slow = rows([[1, 0, 0]], [38.0]), rows([[-1, 0, 0]], [-32.0])
    assert seen((0.0, [fast], MIDDLE)).unsolvable == 0 and seen((0.0, [slow], MIDDLE)).unsolvable == 0
    found = seen((0.5, [fast, slow], MIDDLE), (1.0, [fast], MIDDLE), (1.5, [slow, fast], MIDDLE))
    assert (found.unsolvable, found.first) == (2, 0.5)


@pytest.mark.parametrize("u", [[[9.0, 0, 0], [20.0, 0, 0]], [[20.0, 0, 0], [20.0, 0.6, 0]]])
def test_a_command_outside_the_limits_that_satisfies_all_rows_proves_no_solution(
    u: list[list[float]],
) -> None:
    """The row asks for omega1 + omega2 >= 0.5 or v1 + v2 >= 41: outside the limits it may be had."""
    impossible = rows([[1, 0, 0]], [41.0], (0, 1))
    outside = np.array(u)
    outside[:, 0] += 12.0
    assert seen((0.0, [impossible], outside)).unsolvable == 1


def test_a_command_at_the_limits_that_satisfies_all_rows_is_a_solution() -> None:
    at = np.array([[20.0, 0.5, -2.0], [10.0, -0.5, 2.0]])
    assert seen((0.0, [rows([[1, 0, 0]], [30.0])], at)).unsolvable == 0


def test_a_command_that_satisfies_all_rows_is_proof_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the limits, and by the residual: no linear program is solved."""

    def solved(*_: object) -> tuple[float, None]:
        raise AssertionError

    monkeypatch.setattr("testbed.measures.declared_rows.best_margin", solved)
    at = np.array([[20.0, 0.5, -2.0], [10.0, -0.5, 2.0]])
    assert seen((0.0, [rows([[0, 0, 0]], [RESIDUAL])], at)).unsolvable == 0


def test_a_row_that_names_a_vehicle_twice_asks_for_both_parts() -> None:
    """2 v2 >= 40 is at the limit, 2 v2 >= 41 beyond it."""
    found = seen((0.0, [rows([[1, 0, 0]], [40.0], (1, 1)), rows([[1, 0, 0]], [39.0], (1, 1))], MIDDLE))
    assert (found.least, found.unsolvable) == (-10.0, 0)
    assert seen((0.0, [rows([[1, 0, 0]], [41.0], (1, 1))], MIDDLE)).unsolvable == 1


def test_a_row_that_is_no_number_stays() -> None:
    bad, fine = rows([[np.nan, 0, 0]], [0.0]), rows([[1, 0, 0]], [-1e9])
    found = seen((0.0, [fine], MIDDLE), (1.0, [bad], MIDDLE), (2.0, [rows([[1, 0, 0]], [99.0])], MIDDLE))
    assert np.isnan(found.least) and found.t == 1.0 and found.vehicles == (0, 1)
    assert found.unsolvable == 2 and found.first == 1.0


def test_an_extreme_of_nothing_is_nobody() -> None:
    place, value, t = Extreme.of(3).worst()
    assert place == -1 and np.isnan(value) and np.isnan(t)
    assert Extreme.of(0).worst()[0] == -1


def test_an_extreme_is_the_least_of_each_quantity_with_the_time_it_was_first_seen() -> None:
    rng = np.random.default_rng(2)
    # Few different values, so that the least comes more than once.
    values, t = rng.integers(0, 6, (40, 5)).astype(float), 0.5 * np.arange(40)
    blocks, single = Extreme.of(5), Extreme.of(5)
    assert blocks.t.dtype == blocks.value.dtype == float
    for k in range(0, 40, 8):
        blocks.update(t[k : k + 8], values[k : k + 8])
    for now, value in zip(t, values, strict=True):
        single.update(float(now), value)
    for found in (blocks, single):
        assert np.array_equal(found.value, values.min(axis=0))
        assert np.array_equal(found.t, t[values.argmin(axis=0)])
        p = int(np.argmin(found.value))
        assert found.worst() == (p, found.value[p], found.t[p])


def test_an_extreme_among_some_is_that_of_those() -> None:
    seen = Extreme(np.array([3.0, 1.0, 2.0]), np.array([0.1, 0.2, 0.3]))
    assert seen.among(None) is seen and seen.worst() == (1, 1.0, 0.2)
    some = seen.among(np.array([True, False, True]))
    assert some.worst() == (2, 2.0, 0.3)
    assert list(some.value) == [3.0, np.inf, 2.0] and list(some.t[[0, 2]]) == [0.1, 0.3]
    assert np.isnan(some.t[1]) and some.value.dtype == some.t.dtype == float
    assert seen.among(np.zeros(3, dtype=bool)).worst()[0] == -1
    assert Extreme(np.array([np.inf, np.nan]), np.array([np.nan, 4.0])).worst()[::2] == (1, 4.0)
