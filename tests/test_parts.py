"""Parts of one's own: flown, named in the manifest, and judged no better than is known of them."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

import testbed
from aircraft.kinematic import KinematicFleet
from filters.cbf.collision import Passthrough
from filters.model import Array, Command, State
from testbed.environment.atmosphere import Air
from testbed.environment.environment import Surroundings
from testbed.environment.wind import SteadyWind
from testbed.scenario.scenario import Scenario

SHORT = ["duration_s=0.5", "filter_dt_s=0.05", "record_dt_s=0.05"]


class Straight:
    """A nominal controller that wants 18 m/s and nothing else."""

    def __init__(self, scenario: Scenario, goal: Array, barrier: object) -> None:
        self.vehicles = scenario.vehicles

    def __call__(self, t: float, state: State) -> Command:
        return Command(*np.broadcast_to([[18.0], [0.0], [0.0]], (3, self.vehicles)))


def fleet(s: Scenario, wind: Array) -> KinematicFleet:
    return KinematicFleet(s.vehicles, s.rates.fdm_dt_s)


def windy(s: Scenario, rngs: object) -> Surroundings:
    return Surroundings(Air(SteadyWind(4.0, 0.0)))


def test_a_run_of_the_scenarios_own_parts_says_nothing_of_parts() -> None:
    scenario = testbed.load_scenario("paper-2-turn", SHORT)
    usual, same = testbed.run(scenario), testbed.run(scenario, parts=testbed.Parts())
    assert "parts" not in usual.manifest and usual.manifest == same.manifest
    assert usual.guarantee("manoeuvre-flyable")["verdict"] == "holds"


def test_parts_are_flown_and_named_in_the_manifest(tmp_path: Path) -> None:
    scenario = testbed.load_scenario("paper-2-turn", SHORT)
    parts = testbed.Parts(plant=fleet, nominal=Straight, disturbance=windy)
    run = testbed.run(scenario, tmp_path / "r", parts=parts)
    assert set(run.manifest["parts"]) == {"plant", "nominal", "disturbance"}
    straight = run.manifest["parts"]["nominal"]
    assert straight["name"].endswith("test_parts.Straight") and straight["file"] == "test_parts.py"
    assert straight["sha256"] == hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    assert run.part("nominal") == straight["name"] and run.part("filter") is None
    assert np.allclose(run.vehicles.v_nominal_mps, 18.0) and np.allclose(run.vehicles.wind_east_mps, 4.0)


def test_of_a_plant_of_ones_own_nobody_knows_whether_it_can_fly_the_manoeuvre() -> None:
    run = testbed.run(testbed.load_scenario("paper-2-turn", SHORT), parts=testbed.Parts(plant=fleet))
    flyable = run.guarantee("manoeuvre-flyable")
    assert flyable["verdict"] == "premise not met" and "unknown whether" in flyable["why"]


def test_a_filter_without_a_qp_is_not_said_to_have_solved_one() -> None:
    parts = testbed.Parts(filter=lambda s, barrier, goal: Passthrough())
    run = testbed.run(testbed.load_scenario("paper-2-turn", SHORT), parts=parts)
    assert run.manifest["scenario"]["filter"]["kind"] == "centralised"
    for name in ("qp-feasibility", "rows-satisfied"):
        assert run.guarantee(name)["verdict"] == "not applicable", name


def test_the_scorecard_is_a_table_of_all_claims() -> None:
    run = testbed.run(testbed.load_scenario("paper-2-turn", SHORT))
    assert list(run.scorecard.index) == [g["id"] for g in run.guarantees]
    assert run.scorecard.loc["separation", "value"] == run.guarantee("separation")["value"]


def test_testbed_names_what_it_says_it_names() -> None:
    assert all(hasattr(testbed, name) for name in testbed.__all__)
    assert set(testbed.__all__) <= set(dir(testbed))
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        testbed.fly  # noqa: B018
