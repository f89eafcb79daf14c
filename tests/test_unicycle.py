"""State, commands and the exact unicycle step."""

from __future__ import annotations

import numpy as np
import pytest

from filters.model import Command, Limits, State, View, step


def rk4(state: State, command: Command, dt: float, n: int) -> State:
    """The unicycle integrated in n classical Runge-Kutta steps."""
    x = state.array()

    def rate(x):
        v, theta = command.v, x[..., 2]
        return np.stack([v * np.cos(theta), v * np.sin(theta), command.omega, command.zeta], axis=-1)

    h = dt / n
    for _ in range(n):
        k1 = rate(x)
        k2 = rate(x + 0.5 * h * k1)
        k3 = rate(x + 0.5 * h * k2)
        k4 = rate(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return State.of(x)


def test_flying_north_means_theta_is_half_pi():
    north = step(State(0.0, 0.0, np.pi / 2, 0.0), Command(20.0, 0.0, 1.0), 3.0)
    np.testing.assert_allclose(north.array(), [0, 60, np.pi / 2, 3], atol=1e-13)


def test_positive_turn_rate_is_counter_clockwise():
    quarter = step(State(0.0, 0.0, 0.0, 0.0), Command(10.0, 0.1, 0.0), 0.5 * np.pi / 0.1)
    np.testing.assert_allclose(quarter.array(), [100, 100, np.pi / 2, 0], atol=1e-12)


def test_the_exact_arc_equals_fine_runge_kutta():
    rng = np.random.default_rng(3)
    n = 50
    state = State.of(rng.uniform(-100, 100, (n, 4)))
    command = Command(rng.uniform(15, 25, n), rng.uniform(-0.3, 0.3, n), rng.uniform(-4, 4, n))
    # RK4's own error at 2 ms over 2 s is below 1e-12 m
    np.testing.assert_allclose(
        step(state, command, 2.0).array(), rk4(state, command, 2.0, 1000).array(), atol=1e-10
    )


def test_the_arc_is_continuous_through_zero_turn_rate():
    state = State(3.0, -2.0, 0.7, 1.0)
    straight = step(state, Command(20.0, 0.0, 0.5), 5.0)
    for omega in (1e-3, 1e-6, 1e-9, 1e-15, -1e-15, 1e-300):
        bent = step(state, Command(20.0, omega, 0.5), 5.0)
        # a turn rate omega moves the end by v omega dt^2/2 at first order
        np.testing.assert_allclose(bent.array(), straight.array(), atol=300 * abs(omega) + 1e-12)


def test_flying_back_undoes_the_step_and_two_halves_make_a_whole():
    rng = np.random.default_rng(4)
    state = State.of(rng.uniform(-100, 100, (20, 4)))
    command = Command(rng.uniform(15, 25, 20), rng.uniform(-0.3, 0.3, 20), rng.uniform(-4, 4, 20))
    there = step(state, command, 7.0)
    np.testing.assert_allclose(step(there, command, -7.0).array(), state.array(), atol=1e-12)
    halves = step(step(state, command, 3.5), command, 3.5)
    np.testing.assert_allclose(halves.array(), there.array(), atol=1e-12)


def test_a_full_circle_returns_to_its_start_and_counts_the_turn():
    state = State(5.0, 6.0, 0.3, 0.0)
    after = step(state, Command(16.0, -0.2, 0.0), 2 * np.pi / 0.2)
    np.testing.assert_allclose(after.array(), [5, 6, 0.3 - 2 * np.pi, 0], atol=1e-12)


def test_arrays_round_trip_and_broadcast():
    rows = np.arange(12.0).reshape(3, 4)
    np.testing.assert_array_equal(State.of(rows).array(), rows)
    assert Command(16.0, np.zeros(3), 0.0).shape == (3,)
    np.testing.assert_array_equal(State.of(rows)[[2, 0]].x, [8, 0])
    assert State.of([1, 2, np.nan, 4]).isfinite().item() is False


def test_clip_is_the_nearest_point_of_the_box_and_nan_is_outside():
    limits = Limits(15.0, 25.0, 0.2, 3.9)
    clipped = limits.clip(Command([10.0, 20.0], [0.5, -0.1], [-9.0, 1.0]))
    np.testing.assert_array_equal(clipped.array(), [[15, 0.2, -3.9], [20, -0.1, 1]])
    assert limits.contains(clipped).all() and not limits.contains(Command(25.5, 0.0, 0.0))
    assert not limits.contains(Command(np.nan, 0.0, 0.0))
    assert limits.contains(Command(25.0 + 1e-9, 0.0, 0.0), tolerance=1e-8)


def test_numbers_of_any_type_become_floats_and_floats_that_fit_are_kept():
    x, y, theta, z = np.arange(12.0).reshape(4, 3)
    state = State(x, y, theta, z)
    assert (state.x is x) and (state.y is y) and (state.theta is theta) and (state.z is z)
    for made in (
        Command(np.arange(3), np.arange(3), np.arange(3)),
        Command(x.astype(np.float32), x.astype(np.float32), x.astype(np.float32)),
        Command(x, x, x.astype(np.float32)),
        Command.of(np.arange(9).reshape(3, 3)),
        Command(np.zeros(3), np.zeros((2, 3)), [1, 2, 3])[0],
    ):
        assert made.shape == (3,) and {a.dtype for a in (made.v, made.omega, made.zeta)} == {np.dtype(float)}


def test_each_vehicle_is_finite_and_inside_for_itself():
    state = State([1.0, np.nan, 3.0], 0.0, [0.0, 0.0, np.inf], 0.0)
    assert state.isfinite().tolist() == [True, False, False]
    limits = Limits([15.0, 10.0], [25.0, 12.0], 0.2, 3.9)
    assert limits.contains(Command(11.0, 0.0, 0.0)).tolist() == [False, True]
    slack = Command([15.0 - 1e-9, 15.0 - 1e-7], 0.0, 0.0)
    assert Limits(15.0, 25.0, 0.2, 3.9).contains(slack, 1e-8).tolist() == [True, False]


def test_corners_cannot_be_written():
    for corner in Limits([15.0], [25.0], 0.2, 3.9).corners:
        with pytest.raises(ValueError, match="read-only"):
            corner[0, 0] = 0.0


def test_clipping_works_on_both_sides_of_every_entry():
    limits = Limits(15.0, 25.0, 0.2, 3.9)
    below, above = (limits.clip(Command(v, v, v)).array() for v in (-100.0, 100.0))
    np.testing.assert_array_equal([below, above], [[15.0, -0.2, -3.9], [25.0, 0.2, 3.9]])


@pytest.mark.parametrize("bad", [(0, 25, 1, 1), (26, 25, 1, 1), (15, 25, -1, 1), (15, np.inf, 1, 1)])
def test_limits_out_of_order_are_refused(bad):
    with pytest.raises(ValueError, match="limits"):
        Limits(*bad)


def test_a_view_shows_each_observer_its_own_world():
    state = State.of(np.arange(16.0).reshape(2, 2, 4))
    rates = Command(np.full((2, 2), 16.0), 0.0, 0.0)
    view = View(state, rates)
    assert not view.shared
    np.testing.assert_array_equal(view.of(1).state.x, [8, 12])
    np.testing.assert_array_equal(view.of(1).rates.v, [16, 16])
    same = View(state[0], rates[0])
    assert same.shared and same.of(1) is same and same.own() is same
    np.testing.assert_array_equal(view.own().state.x, [0, 12])
    assert view.own().shared
