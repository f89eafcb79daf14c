"""The navigation-function baseline: it seeks its goal, gives way, and stays inside the limits."""

import numpy as np
import pytest

from filters.navigation import NavigationFilter
from filters.qp import Status
from filters.unicycle import Command, Limits, State, View, step

LIMITS = Limits(15.0, 25.0, np.deg2rad(13), 3.9)


def view_of(state):
    return View(state, Command(np.full(len(state), 20.0), 0.0, 0.0))


def circle(k, radius=200.0):
    angle = np.pi + 2 * np.pi * np.arange(k) / k
    state = State(radius * np.cos(angle), radius * np.sin(angle), angle + np.pi, np.zeros(k))
    points = np.stack([state.x, state.y], axis=-1)
    return state, NavigationFilter(-points, points)


def fly(k, seconds, dt=0.02):
    state, steer = circle(k)
    nearest = np.inf
    for _ in range(round(seconds / dt)):
        decision = steer(view_of(state), Command(np.full(k, 20.0), 0.0, 0.0), LIMITS)
        assert np.all(LIMITS.contains(decision.command))
        state = step(state, decision.command, dt)
        apart = np.abs(np.subtract.outer(state.x + 1j * state.y, state.x + 1j * state.y))
        nearest = min(nearest, np.min(apart[np.triu_indices(k, 1)], initial=np.inf))
    return state, nearest


def test_alone_a_vehicle_flies_straight_to_its_goal():
    state, _ = fly(1, 20.0)
    np.testing.assert_allclose([state.x[0], state.y[0]], [200.0, 0.0], atol=1e-6)


def test_a_vehicle_off_its_course_turns_towards_the_goal():
    steer = NavigationFilter([[200.0, 0.0]], [[-200.0, 0.0]])
    for theta, sign in ((0.5, -1), (-0.5, 1), (np.pi - 0.1, -1)):
        command = steer(
            view_of(State([0.0], [0.0], [theta], [0.0])), Command([20.0], 0.0, 0.7), LIMITS
        ).command
        assert np.sign(command.omega) == sign
        assert command.v == [20.0] and command.zeta == [0.7]


def test_the_turn_rate_is_the_gain_times_the_heading_error():
    steer = NavigationFilter([[200.0, 0.0]], [[-200.0, 0.0]])
    command = steer(view_of(State([0.0], [0.0], [0.1], [0.0])), Command([20.0], 0.0, 0.0), LIMITS).command
    assert command.omega[0] == pytest.approx(-0.06, abs=1e-9)


@pytest.mark.slow
def test_twenty_vehicles_give_way_before_they_meet():
    _, nearest = fly(20, 20.0, 0.01)
    assert nearest > 5.0  # unfiltered they all meet in one point


def test_two_vehicles_head_on_both_swerve_to_the_same_side():
    state = State([-100.0, 100.0], [0.0, 0.0], [0.0, np.pi], [0.0, 0.0])
    points = np.stack([state.x, state.y], axis=-1)
    omega = NavigationFilter(-points, points)(
        view_of(state), Command([20.0] * 2, 0.0, 0.0), LIMITS
    ).command.omega
    assert omega[0] == pytest.approx(omega[1], abs=1e-9) and abs(omega[0]) > 0.01


def test_beyond_the_sensing_range_nobody_is_seen():
    state = State([0.0, 401.0], [0.0, 0.0], [0.0, np.pi], [0.0, 0.0])
    steer = NavigationFilter([[600.0, 0.0], [-200.0, 0.0]], [[-10.0, 0.0], [410.0, 0.0]])
    np.testing.assert_allclose(
        steer(view_of(state), Command([20.0] * 2, 0.0, 0.0), LIMITS).command.omega, 0, atol=1e-9
    )


def test_equal_views_give_what_one_shared_view_gives():
    state, steer = circle(5, 60.0)
    many = View(State.of(np.tile(state.array(), (5, 1, 1))), Command.of(np.tile([20.0, 0.0, 0.0], (5, 5, 1))))
    nominal = Command(np.full(5, 20.0), 0.0, 0.0)
    np.testing.assert_array_equal(
        steer(many, nominal, LIMITS).command.array(), steer(view_of(state), nominal, LIMITS).command.array()
    )


def test_vehicles_in_one_place_or_at_the_goal_get_finite_commands():
    state = State([0.0, 0.0, 200.0], [0.0] * 3, [0.0] * 3, [0.0] * 3)
    steer = NavigationFilter([[200.0, 0.0]] * 3, [[-200.0, 0.0], [-200.0, 0.0], [200.0, 0.0]])
    decision = steer(view_of(state), Command([20.0] * 3, 0.0, 0.0), LIMITS)
    assert np.all(decision.command.isfinite()) and np.all(decision.status == Status.NONE)


def test_goals_and_starts_must_match_and_be_finite():
    with pytest.raises(ValueError, match="do not match"):
        NavigationFilter([[0.0, 0.0]], [[1.0, 0.0], [2.0, 0.0]])
    with pytest.raises(ValueError, match="goal must be finite"):
        NavigationFilter([[np.nan, 0.0]], [[1.0, 0.0]])
    with pytest.raises(ValueError, match="step must be positive"):
        NavigationFilter([[0.0, 0.0]], [[1.0, 0.0]], step=0.0)
    with pytest.raises(ValueError, match="1 goals do not fit 2 vehicles"):
        NavigationFilter([[0.0, 0.0]], [[1.0, 0.0]])(
            view_of(State([0.0, 9.0], [0.0] * 2, [0.0] * 2, [0.0] * 2)), Command([20.0] * 2, 0.0, 0.0), LIMITS
        )
