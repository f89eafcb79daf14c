"""The unicycle plants: the exact arc, and lags whose answers are known."""

import math

import numpy as np
import pytest

from aircraft.kinematic import KinematicFleet, Lag
from filters.model import Command, State, step

CALM = np.zeros((1, 3))
ORIGIN = State([0.0], [0.0], [0.0], [0.0])
NONE = Lag()


def test_the_unicycle_flies_the_exact_arc():
    plant = KinematicFleet(1, dt=0.1)
    plant.reset(ORIGIN, np.random.default_rng(0))
    command = Command([20.0], [0.5], [1.0])
    plant.step(command, CALM, 20)
    np.testing.assert_allclose(plant.state().array(), step(ORIGIN, command, 2.0).array(), atol=1e-12)


def test_the_unicycle_does_what_it_is_told_in_any_wind():
    plant = KinematicFleet(1)
    plant.reset(ORIGIN, np.random.default_rng(0))
    plant.step(Command([20.0], [0.0], [0.0]), np.array([[5.0, 5.0, 1.0]]), 200)
    np.testing.assert_allclose(plant.state().array(), [[20.0, 0.0, 0.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize("dt", [0.005, 0.05])
def test_a_first_order_lag_covers_63_percent_in_its_time_constant(dt):
    plant = KinematicFleet(1, dt, lags=(Lag(1.0), NONE, NONE))
    plant.reset(ORIGIN, np.random.default_rng(0))
    plant.step(Command([24.0], [0.0], [0.0]), CALM, round(1.0 / dt))
    assert plant.achieved().v[0] == pytest.approx(20 + 4 * (1 - math.exp(-1)), rel=1e-12)


def test_a_pure_delay_waits_and_then_obeys():
    plant = KinematicFleet(1, 0.01, lags=(NONE, Lag(0.0, 0.1), NONE))
    plant.reset(ORIGIN, np.random.default_rng(0))
    command = Command([20.0], [0.2], [0.0])
    plant.step(command, CALM, 10)
    assert plant.achieved().omega[0] == 0.0
    plant.step(command, CALM, 1)
    assert plant.achieved().omega[0] == 0.2


def test_rate_limits_differ_up_and_down():
    plant = KinematicFleet(1, 0.01, lags=(Lag(0.0, 0.0, -0.9, 4.0), NONE, NONE))
    plant.reset(ORIGIN, np.random.default_rng(0))
    plant.step(Command([24.0], [0.0], [0.0]), CALM, 50)
    assert plant.achieved().v[0] == pytest.approx(22.0)
    plant.step(Command([20.0], [0.0], [0.0]), CALM, 100)
    assert plant.achieved().v[0] == pytest.approx(21.1)


def test_a_gust_carries_the_lagged_vehicle_and_the_speed_is_corrected():
    plant = KinematicFleet(1, lags=(Lag(1.0), Lag(0.3), Lag(0.3)))
    plant.reset(ORIGIN, np.random.default_rng(0))
    tail = np.array([[3.0, 0.0, 0.0]])
    plant.step(Command([20.0], [0.0], [0.0]), tail, 1)
    assert plant.achieved().v[0] == pytest.approx(23.0, abs=0.02)
    plant.step(Command([20.0], [0.0], [0.0]), tail, 2000)
    assert plant.achieved().v[0] == pytest.approx(20.0, abs=1e-3)


def test_a_lag_that_makes_no_sense_is_refused():
    for bad in ({"time_constant_s": -1.0}, {"delay_s": math.nan}, {"rate_min": 1.0}):
        with pytest.raises(ValueError, match="lag"):
            Lag(**bad)
    with pytest.raises(ValueError, match="three"):
        KinematicFleet(1, lags=(NONE,))
    with pytest.raises(ValueError, match="3 vehicles need one or 3 triples of lags, got 2"):
        KinematicFleet(3, lags=[(NONE,) * 3] * 2)


def test_every_vehicle_has_its_own_lags_and_flies_as_it_would_alone():
    quick, slow = (Lag(0.2), Lag(0.1, 0.02), NONE), (Lag(1.0, 0.1, -0.9, 4.0), Lag(0.4), Lag(0.3, 0.03))
    fleet = KinematicFleet(2, lags=[quick, slow])
    alone = [KinematicFleet(1, lags=lags) for lags in (quick, slow)]
    fleet.reset(ORIGIN[[0, 0]], np.random.default_rng(0))
    for plant in alone:
        plant.reset(ORIGIN, np.random.default_rng(0))
    for command in (Command([24.0], [0.2], [2.0]), Command([18.0], [-0.2], [0.0])):
        tracks = [plant.step(command, CALM, 150) for plant in alone]
        both = Command(*np.repeat(command.array(), 2, axis=0).T)
        np.testing.assert_array_equal(
            fleet.step(both, CALM.repeat(2, axis=0), 150), np.concatenate(tracks, axis=1)
        )
    assert fleet.achieved().v[0] < fleet.achieved().v[1]
