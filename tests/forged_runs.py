"""Runs that the forgery tests change: flown once per test module that asks for them."""

from __future__ import annotations

from pathlib import Path

import pytest

from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from tests.forgery import differing, entry

NEAR = ["radius_m=60", "lookahead_m=10", "duration_s=4", "filter_dt_s=0.05", "record_dt_s=0.05"]
VIOLATED = "violated"


@pytest.fixture(scope="module")
def unicycle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two vehicles that meet, every step recorded; all can be decided but the other QP of the monitor."""
    folder = tmp_path_factory.mktemp("forged") / "unicycle"
    overrides = [*NEAR[:3], "fdm_dt_s=0.02", "filter_dt_s=0.02", "record_dt_s=0.02", "filter.monitor=true"]
    run(load("paper-2-turn", [*overrides, "duration_s=8", "height_perturbation_m=1"]), folder)
    assert differing(folder) == set()
    return folder


@pytest.fixture(scope="module")
def lagged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two vehicles that answer late: Ds, h and the barrier condition are violated."""
    folder = tmp_path_factory.mktemp("forged") / "lagged"
    lags = ["plant=lagged", "lags.source=table", "omega_time_constant_s=0.6", "radius_m=120", "duration_s=8"]
    run(load("paper-2-turn", [*NEAR[1:2], *NEAR[3:], *lags]), folder)
    assert differing(folder) == set()
    for name in ("separation", "safe-set", "barrier-condition", "manoeuvre-keeps-Ds"):
        assert entry(folder, name)["verdict"] == VIOLATED, name
    return folder


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The counterexample: three vehicles whose QP has no solution, each pair with its own turn."""
    folder = tmp_path_factory.mktemp("forged") / "crowd"
    rates = ["fdm_dt_s=0.02", "filter_dt_s=0.02", "record_dt_s=0.02"]
    run(load("paper-counterexample", rates), folder, force=True)
    assert differing(folder) == set()
    return folder
