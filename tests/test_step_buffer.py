"""Judging and recording many steps at a time changes nothing; nor do proofs without a linear program."""

from __future__ import annotations

import numpy as np
import pytest

from filters.qp import single
from filters.qp.infeasibility import impossible
from testbed.scenario.scenario import load
from testbed.simulation import step_buffer
from testbed.simulation.simulate import run

SHORT = ["duration_s=0.5", "start.radius_m=40", "record_dt_s=0.02"]
RUNS = {
    "turn": ["filter.kind=limited"],
    "disturbed": ["plant=lagged", "wind.speed_mps=3", "sensing.position_noise_m=0.5", "filter_dt_s=0.01"],
    "aircraft": ["plant=jsbsim", "filter_dt_s=0.01"],
    "navigation": ["filter.kind=navigation"],
    "alone": ["vehicles=1"],
}


@pytest.mark.parametrize("name", RUNS)
def test_steps_taken_one_by_one_give_the_same_tables_and_verdicts(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load("paper-2-turn", [*SHORT, "manoeuvre_instants=0", *RUNS[name]])
    together = run(scenario, force=True)
    monkeypatch.setattr(step_buffer, "MOST_STEPS", 1)
    alone = run(scenario, force=True)
    assert set(alone.tables) == set(together.tables)
    for table, columns in together.tables.items():
        assert list(alone.tables[table]) == list(columns)
        for column, values in columns.items():
            assert np.array_equal(alone.tables[table][column], values, equal_nan=values.dtype.kind == "f")
    for one, other in zip(alone.guarantees, together.guarantees, strict=True):
        assert (one["id"], one["verdict"], one["vehicles"]) == (
            other["id"],
            other["verdict"],
            other["vehicles"],
        )
        if one["value"] is not None:
            # Sums over steps are added in another order.
            assert one["value"] == pytest.approx(other["value"], rel=1e-12, abs=1e-12, nan_ok=True)


def test_a_run_of_no_duration_is_judged() -> None:
    found = run(load("paper-2-turn", ["duration_s=0", "manoeuvre_instants=0"]))
    assert len(found.vehicles) == 2 and len(found.pairs) == 1
    assert np.isnan(found.pairs.hdot_realised_mps).all()


def test_multipliers_prove_no_qp_infeasible_that_the_linear_program_does_not() -> None:
    rng = np.random.default_rng(1)
    lower, upper = np.array([15.0, -0.2, 0.0]), np.array([25.0, 0.2, 0.0])
    infeasible = proved = 0
    for _ in range(200):
        rows = rng.normal(size=(rng.integers(2, 20), 3)) * [1.0, rng.choice([1.0, 300.0]), 1.0]
        short = rng.choice([1e-7, 1e-5, 1e-2, 1.0])
        rhs = rows @ rng.uniform(lower, upper) + short * rng.normal(size=len(rows))
        margin, _ = single.best_margin(rows, rhs, lower, upper)
        proof = impossible(rows, rhs, lower, upper)
        infeasible += margin < -single.RESIDUAL
        proved += proof
        # HiGHS's own tolerance: a proof is at 1e-6 exactly
        assert not proof or margin < -0.99 * single.RESIDUAL
    assert infeasible > 50 and proved > 0.9 * infeasible


def test_what_is_feasible_by_a_hair_is_not_called_impossible() -> None:
    rows, lower, upper = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.full(2, -1.0), np.full(2, 1.0)
    assert not impossible(rows, np.array([0.5, -0.5]), lower, upper)
    assert not impossible(rows, np.array([0.5, -0.5 + 1e-6]), lower, upper)
    assert impossible(rows, np.array([0.5, -0.5 + 1e-5]), lower, upper)
    assert impossible(rows[:1], np.array([1.1]), lower, upper)
