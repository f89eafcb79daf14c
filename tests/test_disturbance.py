"""Disturbed flights: the same air for every plant, verdicts on the truth, equal files for equal seeds."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

import testbed
from filters.model import Command, State, View
from testbed.errors import UserError
from testbed.records.run import WIND_COLUMNS
from testbed.scenario.scenario import Scenario, load
from testbed.simulation.simulate import run

WIND = list(WIND_COLUMNS)
ALL = [
    "wind.speed_mps=4",
    "wind.towards_deg=70",
    "shear_exponent=0.14",
    "intensity=moderate",
    "position_noise_m=0.5",
    "course_drift_deg=1",
    "speed_bias_mps=0.2",
    "delay_s=0.02",
    "latency_s=0.13",
    "loss=0.2",
]
# One vehicle flying east at 20 m/s.
STRAIGHT = ["filter.kind=none", "controller=manoeuvre", "vehicles=1", "barrier.kind=straight"]
STRAIGHT += ["barrier.v_mps=20", "speed_step=0"]
# A filter slow enough that the air is asked between its steps.
SLOW = ["filter_dt_s=0.1", "record_dt_s=0.1"]


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["unicycle", "jsbsim"])
@pytest.mark.parametrize("kind", ["centralised", "limited"])
def test_equal_disturbed_scenarios_give_equal_files(tmp_path: Path, plant: str, kind: str) -> None:
    settings = [*ALL, *SLOW, f"plant={plant}", f"filter.kind={kind}", "duration_s=1"]
    folders = [tmp_path / name for name in "ab"]
    for folder in folders:
        run(load("paper-2-turn", settings), folder)
    for name in ("manifest.json", "vehicles.parquet", "pairs.parquet", "guarantees.json"):
        a, b = (hashlib.sha256((folder / name).read_bytes()).hexdigest() for folder in folders)
        assert a == b, name


@pytest.mark.slow
def test_a_still_unicycle_and_an_aircraft_meet_the_same_air() -> None:
    """The recorded wind is a function of time and place: evaluated anew at the recorded places, it agrees."""
    from testbed.environment.environment import build

    asked: list[float] = []

    class Spy:
        def __init__(self, s: Scenario, rngs: dict[str, np.random.Generator]) -> None:
            self.usual = build(s, rngs)

        def wind(self, t: float, state: State) -> np.ndarray | None:
            asked.append(t)
            return self.usual.wind(t, state)

        def observe(self, t: float, truth: State, rates: Command) -> View:
            return self.usual.observe(t, truth, rates)

    periods = ["filter_dt_s=0.5", "record_dt_s=0.5", "intensity=severe", "plant=lagged"]
    session = testbed.assemble(load("paper-2-turn", periods), testbed.Parts(disturbance=Spy))
    session.reset()
    asked.clear()
    session.step()
    assert asked == pytest.approx(np.arange(0.05, 0.51, 0.05))


@pytest.mark.slow
def test_jsbsims_own_turbulence_follows_the_seed_and_differs_between_aircraft() -> None:
    settings = ["plant=jsbsim", "jsbsim_turbulence=moderate", "duration_s=2", "record_dt_s=0.1"]
    first, again, other = (
        run(load("paper-2-turn", [*settings, f"seed={seed}"])).vehicles for seed in (1, 1, 2)
    )
    assert first.equals(again)
    assert np.abs(first.v_mps - other.v_mps).max() > 0.01
    one, two = (first[first.vehicle == v].airspeed_mps.to_numpy() for v in (1, 2))
    assert np.abs(one - two).max() > 0.05  # in calm the two are mirror images, apart by 1e-6


def test_jsbsims_own_turbulence_is_refused_elsewhere() -> None:
    with pytest.raises(
        UserError, match=r"jsbsim_turbulence: has no effect: plant 'unicycle' has none; gusts\.inten"
    ):
        load("paper-2-turn", ["jsbsim_turbulence=light"])
