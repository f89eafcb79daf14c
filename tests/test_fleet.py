"""Fleets behind the Plant seam: contract tests over all of them, and what is JSBSim's own."""

import numpy as np
import pytest

from aircraft.airframe import load
from aircraft.jsbsim.fleet import JsbsimFleet
from aircraft.kinematic import KinematicFleet, Lag
from filters.model import Command, State

CALM = np.zeros((2, 3))
LAGS = (Lag(0.8, 0.05), Lag(0.3, 0.02, -1.0, 1.0), Lag(0.3))

PLANTS = {
    "jsbsim": lambda: JsbsimFleet([load("x8")] * 2),
    "jsbsim, mixed": lambda: JsbsimFleet([load("x8"), load("rascal")]),
    "unicycle": lambda: KinematicFleet(2),
    "lagged": lambda: KinematicFleet(2, lags=LAGS),
    "lagged, each its own way": lambda: KinematicFleet(2, lags=[LAGS, (Lag(0.5), Lag(0.2), Lag(0.1))]),
}


def two():
    return State(x=[0.0, 200.0], y=[0.0, 50.0], theta=[0.0, np.pi], z=[0.0, 10.0])


@pytest.fixture(params=PLANTS)
def plant(request):
    made = PLANTS[request.param]()
    made.reset(two(), np.random.default_rng(0))
    return made


def test_reset_puts_the_vehicles_where_they_were_asked(plant):
    np.testing.assert_allclose(plant.state().array(), two().array(), atol=1e-4)
    np.testing.assert_allclose(plant.achieved().array(), [[20, 0, 0]] * 2, atol=1e-3)
    assert plant.faults() == ["", ""]


def test_step_returns_every_position_and_ends_at_the_state(plant):
    track = plant.step(Command([20.0, 22.0], [0.1, -0.1], [1.0, -1.0]), CALM, 7)
    assert track.shape == (7, 2, 3)
    state = plant.state()
    np.testing.assert_array_equal(track[-1], state.position)
    assert np.all(np.linalg.norm(np.diff(track, axis=0), axis=2) > 0.05)


def test_the_state_handed_out_stays_what_it_was(plant):
    before = plant.state()
    kept = before.array()
    plant.step(Command([20.0, 22.0], [0.1, -0.1], [1.0, -1.0]), CALM, 3)
    np.testing.assert_array_equal(before.array(), kept)
    assert not np.array_equal(plant.state().array(), kept)


def test_commands_are_reached_in_their_own_type(plant):
    asked = Command([20.0, 22.0], [0.1, -0.1], [1.0, -1.0])
    plant.step(asked, CALM, 1600)
    np.testing.assert_allclose(plant.achieved().array(), asked.array(), atol=0.01)


def test_course_counts_turns(plant):
    for _ in range(20):
        plant.step(Command([20.0, 20.0], [0.5, -0.5], [0.0, 0.0]), CALM, 200)
    # 10 rad less what the lag costs
    np.testing.assert_allclose(plant.state().theta, [10.0, np.pi - 10.0], atol=0.35)


def test_one_long_step_is_many_short_ones_bit_for_bit(plant):
    command = Command([21.0, 19.0], [0.1, 0.0], [0.5, 0.0])
    long = plant.step(command, CALM, 40)
    plant.reset(two(), np.random.default_rng(0))
    short = np.concatenate([plant.step(command, CALM, 4) for _ in range(10)])
    np.testing.assert_array_equal(long, short)


def test_vehicles_do_not_disturb_each_other(plant):
    alone = plant.step(Command([20.0, 20.0], [0.1, 0.1], [0.0, 0.0]), CALM, 100)[:, 0]
    plant.reset(two(), np.random.default_rng(0))
    beside = plant.step(Command([20.0, 24.0], [0.1, -0.2], [0.0, 2.0]), CALM, 100)[:, 0]
    np.testing.assert_array_equal(alone, beside)


@pytest.mark.parametrize("bad", [Command([np.nan, 20.0], 0.0, 0.0), Command(20.0, [0.0, np.inf], 0.0)])
def test_a_command_that_is_not_finite_is_refused_and_nobody_moves(plant, bad):
    before = plant.state().array()
    with pytest.raises(ValueError, match="finite"):
        plant.step(bad, CALM, 1)
    np.testing.assert_array_equal(plant.state().array(), before)


def test_a_start_of_the_wrong_size_is_refused(plant):
    with pytest.raises(ValueError, match="cannot start at 3 poses"):
        plant.reset(State(np.arange(3) * 100.0, 0.0, 0.0, 0.0), np.random.default_rng(0))


def test_states_handed_out_do_not_change_later(plant):
    state, rates = plant.state(), plant.achieved()
    kept = state.array().copy(), rates.array().copy()
    plant.step(Command([20.0, 20.0], 0.1, 0.0), CALM, 10)
    np.testing.assert_array_equal(state.array(), kept[0])
    np.testing.assert_array_equal(rates.array(), kept[1])


def test_telemetry_is_the_same_however_often_it_is_asked_for():
    asked, told = Command([20.0, 22.0], [0.1, -0.1], [1.0, -1.0]), []
    for every in (1, 2, 5):
        fleet = JsbsimFleet([load("x8")] * 2)
        fleet.reset(two(), np.random.default_rng(0))
        for k in range(1, 11):
            fleet.step(asked, CALM, 3)
            if k % every == 0:
                now = fleet.telemetry()
                assert {n: x.tolist() for n, x in now.items()} == {
                    n: x.tolist() for n, x in fleet.telemetry().items()
                }
        told.append({n: x.tolist() for n, x in now.items()})
    assert told[0] == told[1] == told[2]


def test_telemetry_is_one_number_per_vehicle():
    fleet = PLANTS["jsbsim"]()
    fleet.reset(two(), np.random.default_rng(0))
    telemetry = fleet.telemetry()
    expected = {
        "roll_rad", "pitch_rad", "heading_rad", "alpha_rad", "beta_rad", "airspeed_mps", "load_factor",
        "throttle", "elevon_left_rad", "elevon_right_rad", "limited_v", "limited_omega", "limited_zeta",
    }  # fmt: skip
    assert set(telemetry) == expected
    assert all(values.shape == (2,) and np.isfinite(values).all() for values in telemetry.values())


def test_aircraft_share_one_origin():
    fleet = JsbsimFleet([load("x8")] * 2)
    fleet.reset(State([0.0, 3000.0], [0.0, 4000.0], [0.0, 0.0], [0.0, 0.0]), np.random.default_rng(0))
    # both fly east side by side: their offset stays, to the curvature of the Earth
    track = fleet.step(Command([20.0, 20.0], 0.0, 0.0), CALM, 400)
    np.testing.assert_allclose(track[-1, 1] - track[-1, 0], [3000.0, 4000.0, 0.0], atol=0.05)


def test_a_vehicle_that_hits_the_ground_is_reported_and_the_other_flies_on():
    fleet = JsbsimFleet([load("x8")] * 2)
    low = State([0.0, 0.0], [0.0, 100.0], [0.0, 0.0], [-297.0, 0.0])
    fleet.reset(low, np.random.default_rng(0))
    for _ in range(40):
        track = fleet.step(Command([20.0, 20.0], 0.0, [-3.0, 0.0]), CALM, 40)
    assert fleet.faults() == ["hit the ground", ""]
    assert np.all(track[:, 0] == track[0, 0]) and fleet.achieved().v[0] == 0.0
    assert track[-1, 1, 0] == pytest.approx(160.0, abs=0.1)
    alone = JsbsimFleet([load("x8")])
    alone.reset(low[[1]], np.random.default_rng(0))
    for _ in range(40):
        lone = alone.step(Command([20.0], 0.0, 0.0), CALM[:1], 40)
    np.testing.assert_array_equal(track[:, 1], lone[:, 0])


def test_a_vehicle_whose_numbers_break_is_reported_and_the_other_flies_on():
    fleet = JsbsimFleet([load("x8")] * 2)
    fleet.reset(two(), np.random.default_rng(0))
    fleet.step(Command([20.0, 20.0], 0.0, 0.0), CALM, 10)
    last = fleet.state().array()[0]
    fleet.vehicles[0].node("atmosphere/delta-T").set_double_value(np.nan)
    track = fleet.step(Command([20.0, 20.0], 0.0, 0.0), CALM, 400)
    assert fleet.faults() == ["state not finite", ""]
    assert np.isfinite(track).all() and np.isfinite(fleet.state().array()).all()
    assert np.linalg.norm(track[-1, 0] - last[[0, 1, 3]]) < 41.0
    assert fleet.achieved().v[1] == pytest.approx(20.0, abs=1e-3)


def test_wind_carries_aircraft_that_meet_it():
    # a gust to the north from still air blows both north at first, as far as the autopilot lets it
    fleet = JsbsimFleet([load("x8")] * 2)
    fleet.reset(two(), np.random.default_rng(0))
    gust = np.array([[0.0, 3.0, 0.0]] * 2)
    track = fleet.step(Command([20.0, 20.0], 0.0, 0.0), gust, 200)
    assert np.all(track[-1, :, 1] - [0.0, 50.0] > 0.03)


def test_a_fleet_needs_an_airframe_and_a_period():
    with pytest.raises(ValueError, match="at least one"):
        JsbsimFleet([])
    with pytest.raises(ValueError, match="positive"):
        JsbsimFleet([load("x8")], dt=0.0)
