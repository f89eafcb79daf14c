"""The cost of the QPs: in raw units, the paper's, or with every channel as a share of its range."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

import testbed
from filters.barriers.closed_form import TurnBarrier
from filters.cbf.collision import CollisionFilter
from filters.cbf.problem import Problem
from filters.cbf.theorem_monitor import Monitor
from filters.constraints import Constraints
from filters.model import Array, Command, Limits, State, View
from filters.qp.single import Status
from testbed.verification.check import verify
from tests.forgery import copied, read, seal, write

LOW, HIGH = np.array([15.0, -0.227, -5.0]), np.array([25.0, 0.227, 5.0])
HALF = 0.5 * (HIGH - LOW)


def problem(n: int, target: Array, cost: Any = "range") -> Problem:
    return Problem(target, np.tile(LOW, (n, 1)), np.tile(HIGH, (n, 1)), cost=cost)


def random_rows(rng: np.random.Generator, n: int, count: int, share: float) -> Constraints:
    """Rows over two of n vehicles that some input inside the limits satisfies with room."""
    i = rng.integers(0, n - 1, count)
    j = np.array([rng.integers(a + 1, n) for a in i])
    lie = rng.normal(size=(2, count, 3)) * [1.0, 30.0, 1.0]
    inside = LOW + share * (HIGH - LOW)
    return Constraints((i, j), (lie[0], lie[1]), np.ones(count), (lie @ inside).sum(axis=0) - 0.1)


def cost(u: Array, target: Array) -> float:
    return float(np.sum(((u - target) / HALF) ** 2))


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_no_other_input_within_the_rows_costs_less(seed: int) -> None:
    rng = np.random.default_rng(seed)
    target = rng.uniform(LOW - HALF, HIGH + HALF, (3, 3))
    rows = random_rows(rng, 3, 4, 0.3)
    p = problem(3, target)
    u, status, residual = p.centralised([rows])
    assert (status == Status.SOLVED).all() and residual.max() <= 1e-6
    assert ((u >= LOW) & (u <= HIGH)).all()
    # An optimiser that knows nothing of QPs finds nothing nearer.
    found = minimize(
        lambda x: cost(x.reshape(3, 3), target),
        np.clip(u + rng.normal(size=u.shape) * 0.1 * HALF, LOW, HIGH).ravel(),
        method="SLSQP",
        bounds=list(zip(np.tile(LOW, 3), np.tile(HIGH, 3), strict=True)),
        constraints={"type": "ineq", "fun": lambda x: rows.left(x.reshape(3, 3)) - rows.rhs},
        options={"ftol": 1e-12, "maxiter": 300},
    )
    if found.success:
        assert p.cost_of(u) <= cost(found.x.reshape(3, 3), target) + 1e-6
    # Nor does a random walk along the boundary.
    for _ in range(200):
        tried = np.clip(u + rng.normal(size=u.shape) * HALF * 10.0 ** rng.uniform(-5, 0), LOW, HIGH)
        if (rows.left(tried) >= rows.rhs).all():
            assert p.cost_of(u) <= cost(tried, target) + 1e-9


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_each_vehicles_own_qp_is_optimal_in_shares_of_the_range(seed: int) -> None:
    rng = np.random.default_rng(seed)
    target = rng.uniform(LOW, HIGH, (2, 3))
    lie = rng.normal(size=(3, 3)) * [1.0, 30.0, 1.0]
    rhs = lie @ (LOW + 0.4 * (HIGH - LOW)) - 0.1
    rows = Constraints((np.array([0, 0, 0]),), (lie,), np.ones(3), rhs)
    u, status, _ = problem(2, target).limited(rows)
    assert (status == Status.SOLVED).all() and (u[1] == target[1]).all()
    grid = np.stack(np.meshgrid(*(np.linspace(a, b, 61) for a, b in zip(LOW, HIGH, strict=True))), axis=-1)
    tried = grid.reshape(-1, 3)
    fine = (tried @ lie.T >= rhs).all(axis=1)
    least = (((tried[fine] - target[0]) / HALF) ** 2).sum(axis=1).min()
    assert (((u[0] - target[0]) / HALF) ** 2).sum() <= least + 1e-9


def test_one_row_is_shared_by_range_and_not_by_size() -> None:
    """v + 44 omega is to be 6 more: the raw cost turns for nearly all of it, by range both give a share."""
    target = np.array([[20.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
    lie = np.array([[1.0, 44.0, 0.0]])
    zero = np.zeros((1, 3))
    row = Constraints((np.array([0]), np.array([1])), (lie, zero), np.ones(1), np.array([26.0]))
    raw, by_range = (problem(2, target, kind).centralised([row])[0][0] for kind in ("raw", "range"))
    # Raw: the change is along the row, (1, 44): omega does nearly all of it.
    assert raw == pytest.approx([20.0 + 6.0 / 1937.0, 6.0 * 44.0 / 1937.0, 0.0])
    share = 6.0 / (HALF[0] ** 2 + (44.0 * HALF[1]) ** 2)
    assert by_range == pytest.approx([20.0 + share * HALF[0] ** 2, share * 44.0 * HALF[1] ** 2, 0.0])


def test_a_channel_without_a_range_and_rows_without_a_solution() -> None:
    low, high = LOW.copy(), HIGH.copy()
    low[2] = high[2] = 1.0
    target = np.tile([20.0, 0.0, 0.0], (2, 1))
    p = Problem(
        target,
        np.tile(low, (2, 1)),
        np.tile(high, (2, 1)),
        gamma=np.tile([16.0, 0.2, 1.0], (2, 1)),
        cost="range",
    )
    lie = np.array([[1.0, 0.0, 3.0]])
    pair = (np.array([0]), np.array([1]))
    u, status, _ = p.centralised([Constraints(pair, (lie, lie), np.ones(1), np.array([50.0]))])
    assert (status == Status.SOLVED).all() and u[:, 2].tolist() == [1.0, 1.0]
    assert u[:, 0] == pytest.approx([22.0, 22.0])
    u, status, _ = p.centralised([Constraints(pair, (lie, lie), np.ones(1), np.array([99.0]))])
    assert (status == Status.INFEASIBLE).all() and u.tolist() == [[16.0, 0.2, 1.0]] * 2


def test_the_monitor_compares_the_cost_that_is_minimised() -> None:
    barrier = TurnBarrier(16.0, 0.2, 5.0)
    monitor = Monitor(CollisionFilter(barrier, lambda h: 0.1 * h**3, cost="range"))
    state = State([0.0, 60.0], [0.0, 1.0], [0.0, np.pi], [0.0, 0.0])
    limits = Limits.of(np.tile([15.0, 25.0, 0.227, 5.0], (2, 1)))
    wanted = Command([25.0, 25.0], [0.0, 0.0], [0.0, 0.0])
    for _ in range(2):
        monitor(View(state, wanted), wanted, limits)
    assert monitor.record.compared and monitor.record.cost <= monitor.record.cost_limited + 1e-9
    with pytest.raises(ValueError, match="cost is 'raw' or 'range'"):
        CollisionFilter(barrier, lambda h: h, cost="cheap")  # type: ignore[arg-type]


NEAR = ["filter_dt_s=0.05", "record_dt_s=0.05", "lookahead_m=10", "manoeuvre_instants=0", "duration_s=9"]


@pytest.mark.parametrize("kind", ["centralised", "limited"])
def test_a_run_is_verified_by_its_own_cost_and_a_forged_cost_is_found(tmp_path: Path, kind: str) -> None:
    s = testbed.load_scenario("paper-2-turn", [*NEAR, f"filter.kind={kind}", "filter.cost=range"])
    run = testbed.run(s, tmp_path / "run")
    raw = testbed.run(testbed.load_scenario("paper-2-turn", [*NEAR, f"filter.kind={kind}"]))
    assert not np.allclose(run.vehicles.omega_command_radps, raw.vehicles.omega_command_radps)
    assert run.guarantee("separation")["verdict"] == run.guarantee("safe-set")["verdict"] == "holds"
    assert [f for f in verify(tmp_path / "run") if f.agrees is False] == []
    folder = copied(tmp_path / "run", tmp_path / "forged")
    said = read(folder, "manifest.json")
    assert said["scenario"]["filter"].pop("cost") == "range"
    write(folder, "manifest.json", said)
    seal(folder)
    assert "minimal" in {f.what for f in verify(folder) if f.agrees is False}


def test_the_papers_cost_leaves_no_trace_in_scenarios() -> None:
    assert "cost" not in testbed.load_scenario("paper-2-turn").model_dump(mode="json")["filter"]
    with pytest.raises(testbed.UserError, match=r"filter\.cost: input should be 'raw' or 'range'"):
        testbed.load_scenario("paper-2-turn", ["filter.cost=cheap"])
    # The flow filter's own default is another one, and is said.
    flow = testbed.load_scenario("paper-2-turn", ["filter.kind=flow", "filter.cost=raw"])
    assert flow.model_dump(mode="json")["filter"]["cost"] == "raw"
