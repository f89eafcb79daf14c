"""Branching: the same flight again, left at any moment."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from aircraft.airframe import load
from aircraft.jsbsim.fleet import JsbsimFleet
from aircraft.kinematic import KinematicFleet, Lag
from aircraft.plant import Plant
from aircraft.replay import Replay
from filters.model import Command, State
from testbed.scenario.scenario import load as load_scenario
from testbed.simulation.simulate import run

DT = 0.005
START = State([0.0, 60.0], [0.0, 5.0], [0.0, 3.0], [0.0, 1.0])
CALM = np.zeros((2, 3))
PLANTS: dict[str, Callable[[], Plant]] = {
    "unicycle": lambda: KinematicFleet(2, DT),
    "lagged": lambda: KinematicFleet(2, DT, lags=(Lag(1.0), Lag(0.35, 0.05), Lag(0.3))),
    "jsbsim": lambda: JsbsimFleet([load("x8")] * 2, DT),
}


def commands(step: int) -> Command:
    return Command([18.0, 21.0 - 0.1 * step], [0.1, -0.15 + 0.01 * step], [0.5, 0.0])


def fly(plant: Plant, first: int, last: int) -> np.ndarray:
    return np.concatenate([plant.step(commands(k), CALM, 10) for k in range(first, last)])


@pytest.fixture(params=PLANTS)
def plant(request: pytest.FixtureRequest) -> Replay:
    replay = Replay(PLANTS[request.param])
    replay.reset(START, np.random.default_rng(3), np.zeros((2, 3)), np.full(2, 20.0))
    return replay


def test_a_branch_goes_on_bit_for_bit_as_the_flight_did(plant: Replay) -> None:
    fly(plant, 0, 8)
    after = fly(plant, 8, 20)
    branch = plant.branch(8 * 10 * DT)
    assert np.array_equal(fly(branch, 8, 20), after)
    assert np.array_equal(branch.state().array(), plant.state().array())
    assert np.array_equal(branch.achieved().array(), plant.achieved().array())


def test_a_branch_inside_a_step_stands_where_the_track_passed(plant: Replay) -> None:
    track = fly(plant, 0, 3)
    state = plant.branch(13 * DT).state()
    assert np.array_equal(state.position, track[12])


def test_branching_leaves_the_flight_untouched(plant: Replay) -> None:
    fly(plant, 0, 5)
    before = plant.state().array()
    fly(plant.branch(0.1), 0, 5)
    assert np.array_equal(plant.state().array(), before)


def test_a_branch_at_zero_is_a_fresh_start(plant: Replay) -> None:
    fly(plant, 0, 5)
    branch = plant.branch(0.0)
    # an aircraft's start passes through latitude and longitude
    assert np.allclose(branch.state().x, START.x, rtol=0, atol=1e-6)
    assert np.array_equal(fly(branch, 0, 5)[-1, :, 0], plant.state().x)


def test_states_are_values_not_windows_on_the_plant(plant: Replay) -> None:
    state, rates = plant.state(), plant.achieved()
    kept = state.array(), rates.array()
    fly(plant, 0, 3)
    assert np.array_equal(state.array(), kept[0])
    assert np.array_equal(rates.array(), kept[1])


@pytest.mark.parametrize("t", [-0.1, 10.0, 0.0012])
def test_a_moment_outside_the_flight_is_refused(plant: Replay, t: float) -> None:
    fly(plant, 0, 2)
    with pytest.raises(ValueError, match="cannot branch"):
        plant.branch(t)


def test_a_run_that_remembers_itself_flies_bit_for_bit_as_one_that_does_not() -> None:
    brief = ["plant=jsbsim", "duration_s=0.5"]
    plain, remembered = (
        run(load_scenario("paper-2-turn", [*brief, f"manoeuvre_instants={n}"])) for n in (0, 1)
    )
    for name in ("vehicles", "pairs"):
        assert getattr(plain, name).equals(getattr(remembered, name))


def test_gamma_from_the_branch_at_zero_is_a_run_that_flies_gamma_from_the_start() -> None:
    """As fast a turn as the limits allow: a full one takes 27.7 s."""
    turning = ["plant=lagged", "omega_degps=13", "filter_dt_s=0.05", "record_dt_s=0.05"]
    branched = run(load_scenario("paper-2-turn", [*turning, "duration_s=0.5", "manoeuvre_instants=1"]))
    row = branched.guarantee("manoeuvre-keeps-Ds")["detail"]["branches"][0]
    whole = [*turning, "controller=manoeuvre", "filter.kind=none", "duration_s=27.7", "manoeuvre_instants=0"]
    flown = run(load_scenario("paper-2-turn", whole)).guarantee("separation")
    assert row["t_s"] == 0.0 and row["least_m"] == pytest.approx(flown["value"], abs=1e-9)
