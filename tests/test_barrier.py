"""The closed-form barriers: known answers, the theorem's premise, and sanity everywhere."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from filters.barriers.class_k import cubic
from filters.barriers.closed_form import StraightBarrier, TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.barriers.pairs import ARRAYS, NUMBERS, ForwardDifference, PairValues, all_pairs, form_function
from filters.barriers.range_functions import SquaredRange
from filters.cbf.constraints import pair_rows
from filters.model import Command, State, step

DS, V, OMEGA = 5.0, 16.0, 0.2042
TURNS = {
    "plain": TurnBarrier(V, OMEGA, DS),
    "right": TurnBarrier(V, -OMEGA, DS),
    "delta": TurnBarrier(V, OMEGA, DS, delta=0.01),
    "sigma": TurnBarrier(V, OMEGA, DS, delta=0.5, sigma=[0.8, 1.0]),
    "sigma above 1": TurnBarrier(V, -OMEGA, DS, sigma=[1.4, 0.9]),
    "smoothed": TurnBarrier(V, OMEGA, DS, smoothing=30.0),
    "smoothed delta": TurnBarrier(V, OMEGA, DS, delta=0.1, sigma=[1.2, 1.0], smoothing=30.0),
    "squared": TurnBarrier(V, OMEGA, DS, delta=0.01, form="squared"),
}
STRAIGHTS = {
    "level": StraightBarrier([16.16, 16.32], 0.0, DS),
    "climbing": StraightBarrier([16.16, 18.0], [0.5, -1.0], DS),
    "equal speeds": StraightBarrier([16.0, 16.0], [0.5, -1.0], DS),
    "squared": StraightBarrier([16.16, 16.32], [0.5, -1.0], DS, form="squared"),
}
ALL = {f"turn {k}": b for k, b in TURNS.items()} | {f"straight {k}": b for k, b in STRAIGHTS.items()}
ALL |= {"euclidean": EuclideanBarrier(DS), "euclidean squared": EuclideanBarrier(DS, form="squared")}


def catalogue(barriers):
    return pytest.mark.parametrize("barrier", barriers.values(), ids=barriers.keys())


def random_state(rng, n, reach=200.0):
    planar = rng.uniform(-reach, reach, (2, n))
    return State(*planar, rng.uniform(-4, 4, n), rng.uniform(-5, 5, n))


def along(values: PairValues, state: State, gamma: Command):
    """L_g h gamma and |L_g h| of each pair."""
    lie_i, lie_j = values.lie(state)
    g = gamma.array()
    product = np.sum(lie_i * g[values.i] + lie_j * g[values.j], axis=1)
    return product, np.linalg.norm(np.hstack([lie_i, lie_j]), axis=1)


number = st.floats(-1e5, 1e5)
near = st.floats(-100, 100)
angle = st.floats(-10, 10)
pair = st.tuples(near, near, angle, near, near, near, angle, near).map(
    lambda x: State.of(np.reshape(x, (2, 4)))
)
wild = st.tuples(number, number, angle, number, number, number, angle, number).map(
    lambda x: State.of(np.reshape(x, (2, 4)))
)
COINCIDENT = State.of([[1.0, 2.0, 0.5, 3.0]] * 2)
PARALLEL = State.of([[0.0, 0.0, 0.5, 0.0], [20.0, 0.0, 0.5, 0.0]])
HEAD_ON = State.of([[-200.0, 0.0, 0.0, 0.0], [200.0, 0.0, np.pi, 0.0]])
SHARED_CENTRE = State.of([[0.0, 0.0, 0.0, 0.0], [0.0, 2 * V / OMEGA, np.pi, 0.0]])


# --- known answers


def test_all_pairs_are_those_above_the_diagonal():
    i, j = all_pairs(4)
    assert list(zip(i, j, strict=True)) == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]


def test_all_pairs_cannot_be_written():
    for index in all_pairs(5):
        with pytest.raises(ValueError, match="read-only"):
            index[0] = 1


def test_both_forms_have_known_values_and_slopes():
    m = np.array([144.0, 1.0, 0.0])
    # Ds 10 m: the root is continued from m0 = (1 m)^2 with its slope there, a half per metre
    for form, h, slope in (
        ("root", [2.0, -9.0, -9.5], [1 / 24, 0.5, 0.5]),
        ("squared", m - 100.0, np.ones(3)),
    ):
        got = form_function(form)(m, 10.0, ARRAYS)
        np.testing.assert_allclose(got[0], h)
        np.testing.assert_allclose(got[1], slope)
        one = form_function(form)(144.0, 10.0, NUMBERS)
        assert one == (h[0], pytest.approx(slope[0]))
    with pytest.raises(ValueError, match=r"unknown form 'cube' of h; choose one of root, squared$"):
        form_function("cube")


@pytest.mark.parametrize("delta", [0.0, 20.0])
@pytest.mark.parametrize("omega", [0.2042, -0.15])
def test_the_phasor_is_the_harmonic_of_the_squared_range_along_the_turn(delta, omega):
    """rho(tau) - rho(0) = Re(Z (e^(1j omega tau) - 1)), whose kink in h is where Z is 0."""
    barrier = TurnBarrier(16.0, omega, 5.0, delta=delta, sigma=[1.0, 1.2, 0.9])
    rng = np.random.default_rng(50)
    state = State(*rng.uniform(-80, 80, (2, 3)), rng.uniform(-4, 4, 3), rng.uniform(-5, 5, 3))
    i, j = all_pairs(3)
    safety, z = SquaredRange(delta), barrier.phasor(state)
    for tau in (1.0, 6.0, 17.0):
        later = step(state, barrier.manoeuvre(3), tau)
        moved = safety.value(later[i], later[j]) - safety.value(state[i], state[j])
        np.testing.assert_allclose(moved, (z * (np.exp(1j * omega * tau) - 1)).real, rtol=1e-9, atol=1e-7)
    many = State.of(np.stack([state.array(), later.array()]))
    np.testing.assert_array_equal(barrier.phasor(many)[0], z)


def test_parameters_given_as_lists_are_kept_as_arrays():
    turn, straight = TurnBarrier(16, 0.2, 5, sigma=[1, 2]), StraightBarrier([16, 17], 1, 5)
    assert turn.sigma.tolist() == [1.0, 2.0] and turn.sigma.dtype == float
    assert straight.v.tolist() == [16.0, 17.0] and straight.zeta.tolist() == [1.0, 1.0]
    assert straight.v.dtype == straight.zeta.dtype == float


def test_what_has_another_number_of_entries_than_there_are_vehicles_is_named():
    three = State(np.arange(3.0) * 50, 0.0, 0.0, 0.0)
    for name, barrier in (("sigma", TurnBarrier(16.0, 0.2, 5.0, sigma=[1.0, 1.1])),
                          ("v", StraightBarrier([16.0, 17.0], 0.0, 5.0))):  # fmt: skip
        for asked in (lambda b=barrier: b.manoeuvre(3), lambda b=barrier: b.values(three)):
            with pytest.raises(ValueError, match=f"^{name} has 2 entries for 3 vehicles; give one each$"):
                asked()


@pytest.mark.parametrize("v", [0.0, -1.0, np.nan, np.inf])
def test_a_speed_that_is_no_speed_is_refused(v):
    with pytest.raises(ValueError, match="turn's speed v must be positive and finite"):
        TurnBarrier(v, 0.2, 5.0)
    with pytest.raises(ValueError, match="straight speeds v must be positive and finite"):
        StraightBarrier([16.0, v], 0.0, 5.0)


@pytest.mark.parametrize("name", ["delta", "smoothing"])
@pytest.mark.parametrize("value", [-1e-9, np.nan, np.inf])
def test_delta_and_smoothing_out_of_range_are_named(name, value):
    with pytest.raises(ValueError, match=f"^{name} must be finite and not negative, got {value} m.2"):
        TurnBarrier(16.0, 0.2, 5.0, **{name: value})


def test_parameters_of_two_axes_are_refused():
    with pytest.raises(ValueError, match="sigma must be positive and finite, a number or one per vehicle"):
        TurnBarrier(16.0, 0.2, 5.0, sigma=[[1.0, 1.1]])
    with pytest.raises(ValueError, match="straight speeds v must be positive and finite, one per vehicle"):
        StraightBarrier([[16.0, 17.0]], 0.0, 5.0)
    with pytest.raises(ValueError, match="climb rates zeta must be finite, a number or one per vehicle"):
        StraightBarrier([16.0, 17.0], [[0.0, 1.0]], 5.0)


def test_slow_vehicles_and_opposite_climb_rates_are_no_equal_velocities():
    assert StraightBarrier([0.5, 0.6], 0.0, 5.0).manoeuvre(2).v.tolist() == [0.5, 0.6]
    assert StraightBarrier([16.0, 16.0], [1.0, -1.0], 5.0).manoeuvre(2).zeta.tolist() == [1.0, -1.0]
    # relative to their speed, not to 1 m/s
    StraightBarrier([0.01, 0.01 + 1e-10], 0.0, 5.0)
    with pytest.raises(ValueError, match=r"vehicles 1 and 2 have equal straight speeds \(1000.0 m/s\)"):
        StraightBarrier([1000.0, 1000.0 + 1e-7], 0.0, 5.0)


def test_parallel_flight_keeps_its_distance_under_the_shared_turn():
    assert TURNS["plain"].values(PARALLEL).h[0] == pytest.approx(15.0, abs=1e-12)


def test_smoothing_makes_parallel_flight_need_the_square_root_of_ds_squared_plus_eps():
    wanted = np.sqrt(DS**2 + 30.0)
    state = State.of([[0.0, 0.0, 0.5, 0.0], [wanted, 0.0, 0.5, 0.0]])
    assert TURNS["smoothed"].values(state).h[0] == pytest.approx(0.0, abs=1e-9)


def test_circles_about_one_centre_keep_the_vehicles_a_diameter_apart():
    assert TURNS["plain"].values(SHARED_CENTRE).h[0] == pytest.approx(2 * V / OMEGA - DS, abs=1e-9)


def test_straight_overtaking_ends_in_a_collision_and_flying_apart_does_not():
    line = State.of([[0.0, 0.0, 0.0, 0.0], [50.0, 0.0, 0.0, 0.0]])
    assert StraightBarrier([17.0, 16.0], 0.0, DS, "squared").values(line).h[0] == pytest.approx(-25.0)
    assert StraightBarrier([16.0, 17.0], 0.0, DS).values(line).h[0] == pytest.approx(45.0)


def test_climb_rates_separate_a_straight_pair():
    # They meet after 50 s, when the faster climber is 50 m higher; the closest approach comes before.
    line = State.of([[0.0, 0.0, 0.0, 0.0], [50.0, 0.0, 0.0, 0.0]])
    h = StraightBarrier([17.0, 16.0], [1.0, 0.0], DS).values(line).h[0]
    assert h == pytest.approx(50 / np.sqrt(2) - DS, abs=1e-12)


def test_euclidean_barrier_has_the_negative_sup_of_the_motivating_example():
    v_min, v_max, omega_max, zeta_max, eps = 15.0, 25.0, 0.2269, 3.9, 0.7
    state = State.of([[-DS / 2, 0, 0, eps], [DS / 2, 0, np.pi, -eps]])
    values = EuclideanBarrier(DS, form="squared").values(state)
    lower, upper = np.array([v_min, -omega_max, -zeta_max]), np.array([v_max, omega_max, zeta_max])
    alpha = cubic(0.1)
    sup = sum(np.sum(np.maximum(row[0] * lower, row[0] * upper)) for row in values.lie(state))
    sup += alpha(values.h[0])
    assert sup == pytest.approx(-4 * DS * v_min + 8 * eps * zeta_max + alpha(4 * eps**2), rel=1e-12)
    assert sup < 0


def test_euclidean_barrier_has_a_manoeuvre_only_when_given_one():
    assert EuclideanBarrier(DS).manoeuvre(2) is None
    gamma = EuclideanBarrier(DS, gamma=Command(16.0, 0.2, 0.0)).manoeuvre(3)
    np.testing.assert_array_equal(gamma.array(), [[16.0, 0.2, 0.0]] * 3)


def test_the_three_vehicle_counterexample_as_corrected():
    ds, r = 0.5, 1.0
    psi = np.arccos((ds / 2 + 2 * r) / (2 * r + ds))
    across, up = (2 * r + ds) * np.sin(psi), (2 * r + ds) * np.cos(psi) - 2 * r
    state = State.of([[0, 0, 0, 0], [across, up, np.pi, 0], [across, -up, np.pi, 0]])
    left, right = TurnBarrier(1.0, 1.0, ds), TurnBarrier(1.0, -1.0, ds)
    h = [right.values(state).h[0], *left.values(state).h[1:]]
    np.testing.assert_allclose(h, 0.0, atol=1e-12)

    c = np.sqrt(0.19)
    first, second = right.values(state).lie(state), left.values(state).lie(state)
    np.testing.assert_allclose(first[0][0][:2], [-c, -c], atol=1e-12)
    np.testing.assert_allclose(first[1][0][:2], [-c, -c], atol=1e-12)
    np.testing.assert_allclose(second[0][1][:2], [-c, c], atol=1e-12)
    np.testing.assert_allclose(second[1][1][:2], [-c, c], atol=1e-12)
    # Sharing the left turn puts the state outside the safe set.
    squared = TurnBarrier(1.0, 1.0, ds, form="squared").values(state).h[0]
    assert squared == pytest.approx(-0.246, abs=5e-4)
    assert left.values(state).h[0] == pytest.approx(np.sqrt(squared + ds**2) - ds, abs=1e-12)
    assert left.values(state).h[0] == pytest.approx(-0.438, abs=5e-4)


# --- what is differentiated and minimised


# the smoothed h is below the infimum by construction
@catalogue({k: b for k, b in (TURNS | STRAIGHTS).items() if "smoothed" not in k})
def test_h_is_the_smallest_value_along_the_manoeuvre(barrier):
    rng = np.random.default_rng(5)
    delta = getattr(barrier, "delta", 0.0)
    tau = np.linspace(0, 60, 60001)
    gamma = barrier.manoeuvre(2)
    for _ in range(20):
        state = random_state(rng, 2, 60.0)
        a, b = (step(state[[k]], gamma[[k]], tau) for k in (0, 1))
        m = (a.x - b.x) ** 2 + (a.y - b.y) ** 2 + (a.z - b.z) ** 2
        m = m + delta * (np.sin(a.theta) - np.cos(a.theta) - 2)
        if m.min() < 0.25:
            continue
        want = m.min() - DS**2 if barrier.form == "squared" else np.sqrt(m.min()) - DS
        # a grid of 1 ms misses the minimum by at most M dt^2/8, M of order 1e3 m^2/s^2
        assert barrier.values(state).h[0] == pytest.approx(want, abs=5e-4)
        assert barrier.values(state).h[0] <= want + 1e-9


@catalogue(ALL)
def test_gradient_agrees_with_central_differences(barrier):
    rng = np.random.default_rng(6)
    for _ in range(30):
        state = random_state(rng, 2)
        values = barrier.values(state)
        eps = 1e-5
        for k in range(8):
            shift = np.zeros(8)
            shift[k] = eps
            up = barrier.values(State.of(state.array() + shift.reshape(2, 4))).h[0]
            down = barrier.values(State.of(state.array() - shift.reshape(2, 4))).h[0]
            # the differences of squared forms, h of 1e5 m^2, carry 1e-11/1e-5 of rounding
            scale = 1 + np.abs(values.h[0])
            assert values.grad[0, k] == pytest.approx((up - down) / (2 * eps), abs=1e-6 * scale, rel=1e-6)


@catalogue(ALL)
def test_forward_differences_come_close_and_leave_h_alone(barrier):
    state = random_state(np.random.default_rng(7), 2)
    exact, differenced = barrier.values(state), ForwardDifference(barrier, 1e-6).values(state)
    np.testing.assert_allclose(differenced.h, exact.h, rtol=1e-13, atol=1e-12)
    # a step of 1e-6 errs by half a second derivative, up to 1e5 m^2 in squared form, of it
    atol = 1e-1 if barrier.form == "squared" else 1e-3
    np.testing.assert_allclose(differenced.grad, exact.grad, rtol=1e-4, atol=atol)


def test_forward_differences_pass_on_the_barrier_they_wrap():
    barrier = TURNS["sigma"]
    wrapped = ForwardDifference(barrier)
    assert wrapped.d_safe == DS
    np.testing.assert_array_equal(wrapped.manoeuvre(2).array(), barrier.manoeuvre(2).array())


# --- the theorem's premise


@catalogue(TURNS)
def test_turn_leaves_h_constant_along_the_manoeuvre(barrier):
    rng = np.random.default_rng(8)
    for reach in (10.0, 200.0, 1e4):
        for _ in range(100):
            state = random_state(rng, 2, reach)
            product, size = along(barrier.values(state), state, barrier.manoeuvre(2))
            assert np.all(np.abs(product) <= 1e-9 * size)


@catalogue(STRAIGHTS)
def test_straight_never_loses_h_along_the_manoeuvre(barrier):
    rng = np.random.default_rng(9)
    for reach in (10.0, 200.0, 1e4):
        for _ in range(100):
            state = random_state(rng, 2, reach)
            product, size = along(barrier.values(state), state, barrier.manoeuvre(2))
            assert np.all(product >= -1e-9 * size)


@given(state=pair)
@example(state=HEAD_ON)
@example(state=PARALLEL)
@example(state=COINCIDENT)
def test_the_manoeuvre_never_loses_h(state):
    for barrier in (*TURNS.values(), *STRAIGHTS.values()):
        product, size = along(barrier.values(state), state, barrier.manoeuvre(2))
        # Where turn's gradient itself cancels, A1 nearly |Z|, rounding of its parts (1e2 m) remains.
        assert np.all(product >= -1e-9 * size - 1e-9)


@given(state=pair)
@example(state=HEAD_ON)
@example(state=PARALLEL)
def test_smoothing_is_conservative(state):
    for form in ("root", "squared"):
        for delta in (0.0, 0.01):
            plain = TurnBarrier(V, OMEGA, DS, delta=delta, form=form).values(state)
            smooth = TurnBarrier(V, OMEGA, DS, delta=delta, form=form, smoothing=30.0).values(state)
            assert np.all(smooth.h <= plain.h + 1e-12 * (1 + np.abs(plain.h)))


def test_smoothing_is_smooth_across_equal_headings():
    def slope(offset, smoothing):
        state = State.of([[0.0, 0.0, 0.5 + offset, 0.0], [20.0, 0.0, 0.5, 0.0]])
        return TurnBarrier(V, OMEGA, DS, smoothing=smoothing).values(state).grad[0, 2]

    jump = {eps: abs(slope(1e-9, eps) - slope(-1e-9, eps)) for eps in (0.0, 30.0)}
    assert jump[0.0] > 10.0  # m/rad: the kink
    assert jump[30.0] < 1e-4


# --- invariances


@given(state=pair, dx=near, dy=near, dz=near)
def test_h_does_not_depend_on_where_the_origin_is(state, dx, dy, dz):
    moved = State(state.x + dx, state.y + dy, state.theta, state.z + dz)
    for barrier in ALL.values():
        a, b = barrier.values(state).h[0], barrier.values(moved).h[0]
        # straight: tau = -b/a is as sensitive as 1/a, and speeds differ by 1 % only
        assert a == pytest.approx(b, rel=1e-9, abs=1e-7)


@given(state=pair, turn=angle)
def test_rotation_and_swapping_leave_h_alone_for_equal_speeds_and_no_delta(state, turn):
    position = (state.x + 1j * state.y) * np.exp(1j * turn)
    turned = State(position.real, position.imag, state.theta + turn, state.z)
    for name in ("plain", "right", "smoothed"):
        barrier = TURNS[name]
        values, rotated, swapped = (barrier.values(s) for s in (state, turned, state[[1, 0]]))
        assert rotated.h[0] == pytest.approx(values.h[0], rel=1e-9, abs=1e-8)
        assert swapped.h[0] == pytest.approx(values.h[0], rel=1e-9, abs=1e-8)
        np.testing.assert_allclose(np.roll(swapped.grad, 4, axis=1), values.grad, rtol=1e-6, atol=1e-6)


# --- finite everywhere


@given(state=wild)
@example(state=COINCIDENT)
@example(state=PARALLEL)
@example(state=HEAD_ON)
@example(state=SHARED_CENTRE)
def test_value_and_gradient_are_finite_everywhere(state):
    for barrier in ALL.values():
        values = barrier.values(state)
        assert np.all(np.isfinite(values.h))
        assert np.all(np.isfinite(values.grad))


def meeting(rng, gap: float) -> State:
    """A level pair whose turning circles bring it within |gap| m, wherever it is now."""
    theta = rng.uniform(-np.pi, np.pi, 2)
    arm = V / OMEGA * np.exp(1j * theta)
    centre = (abs(arm[0] - arm[1]) + gap) * np.exp(1j * rng.uniform(-np.pi, np.pi))
    position = np.array([centre, 0.0]) - 1j * arm
    return State(position.real, position.imag, theta, 0.0)


@pytest.mark.parametrize("delta", [0.0, 0.01, 10.0])
@pytest.mark.parametrize("smoothing", [0.0, 30.0, 1e4])
def test_below_the_root_h_continues_linearly_with_its_slope(delta, smoothing):
    root = TurnBarrier(V, OMEGA, DS, delta=delta, smoothing=smoothing)
    squared = TurnBarrier(V, OMEGA, DS, delta=delta, smoothing=smoothing, form="squared")
    m0 = (0.1 * DS) ** 2
    rng = np.random.default_rng(10)
    for _ in range(50):
        state = meeting(rng, rng.uniform(-0.4, 0.4))
        a, b = root.values(state), squared.values(state)
        m = b.h[0] + DS**2
        assert m < m0
        assert a.h[0] == pytest.approx(0.1 * DS + (m - m0) / (0.2 * DS) - DS, rel=1e-11)
        np.testing.assert_allclose(a.grad, b.grad / (0.2 * DS), rtol=1e-11)


def test_a_pair_far_apart_can_be_outside_the_root_of_the_paper():
    rng = np.random.default_rng(14)
    pairs = [meeting(rng, 0.0) for _ in range(50)]
    far = [s for s in pairs if np.hypot(*(s.x - s.x[::-1])[:1], *(s.y - s.y[::-1])[:1]) > 113]
    assert far
    for state in far:
        m = TurnBarrier(V, OMEGA, DS, delta=0.01, form="squared").values(state).h[0] + DS**2
        assert -(2 + np.sqrt(2)) * 0.01 <= m <= -(2 - np.sqrt(2)) * 0.01
        assert TurnBarrier(V, OMEGA, DS, delta=0.01).values(state).h[0] == pytest.approx(-0.95 * DS, abs=0.05)


# --- pairs, shapes and parameters


@catalogue({k: b for k, b in ALL.items() if "sigma" not in k and "straight" not in k and "delta" not in k})
def test_many_vehicles_are_their_pairs(barrier):
    state = random_state(np.random.default_rng(11), 6)
    values = barrier.values(state)
    lie_i, lie_j = values.lie(state)
    for p, (i, j) in enumerate(zip(*all_pairs(6), strict=True)):
        alone = barrier.values(state[[i, j]])
        assert values.h[p] == pytest.approx(alone.h[0], rel=1e-13)
        np.testing.assert_allclose(values.grad[p], alone.grad[0], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(lie_i[p], alone.lie(state[[i, j]])[0][0], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(lie_j[p], alone.lie(state[[i, j]])[1][0], rtol=1e-12, atol=1e-12)


def per_vehicle_barriers(n):
    speeds = 16 * (1 + 0.01 * np.arange(1, n + 1))
    return [
        TurnBarrier(V, OMEGA, DS, delta=0.01, sigma=speeds / 16),
        StraightBarrier(speeds, np.linspace(-1, 1, n), DS),
        ForwardDifference(TurnBarrier(V, OMEGA, DS, sigma=speeds / 16)),
        ForwardDifference(StraightBarrier(speeds, 0.0, DS)),
    ]


@pytest.mark.parametrize(
    "barrier", per_vehicle_barriers(5), ids=["turn", "straight", "fd turn", "fd straight"]
)
def test_chosen_pairs_are_those_of_all_pairs_also_in_a_view(barrier):
    state = random_state(np.random.default_rng(12), 5)
    whole = barrier.values(state)
    chosen = np.array([7, 2, 3])
    part = barrier.values(state, whole.i[chosen], whole.j[chosen])
    # Few pairs may be computed in plain numbers, which round otherwise.
    np.testing.assert_allclose(part.h, whole.h[chosen], rtol=0, atol=1e-12)
    np.testing.assert_allclose(part.grad, whole.grad[chosen], rtol=1e-12)

    # In a view of two observers, (observer, vehicle) indices pick each pair from one of the worlds.
    other = random_state(np.random.default_rng(13), 5)
    view = State.of(np.stack([state.array(), other.array()]))
    observer = np.array([0, 1, 0])
    i, j = whole.i[chosen], whole.j[chosen]
    seen = barrier.values(view, (observer, i), (observer, j))
    want = np.where(observer == 0, whole.h[chosen], barrier.values(other).h[chosen])
    np.testing.assert_allclose(seen.h, want, rtol=1e-14)
    np.testing.assert_allclose(seen.lie(view)[0][0], part.lie(state)[0][0], rtol=1e-12)
    with pytest.raises(ValueError, match="observer, vehicle"):
        barrier.values(view)


@catalogue(TURNS)
def test_a_few_pairs_in_plain_numbers_are_what_they_are_in_arrays(barrier):
    """Known answers and finite differences above are of either kind; here they meet."""
    n = np.size(barrier.sigma) if np.ndim(barrier.sigma) else 3
    for seed in range(50):
        reach = 10.0 if seed % 2 else 200.0  # near, also inside Ds where the root is continued
        state = random_state(np.random.default_rng(seed), n, reach)
        few, lie = barrier.values(state), barrier.values(state).lie(state)
        # An observer's index, of which there is one only, makes it arrays.
        alone = State.of(state.array()[None])
        i, j = all_pairs(n)
        zero = np.zeros_like(i)
        many = barrier.values(alone, (zero, i), (zero, j))
        np.testing.assert_allclose(few.h, many.h, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(few.grad, many.grad, rtol=1e-9, atol=1e-11)
        for a, b in zip(lie, many.lie(alone), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("field", ["x", "theta", "z"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_few_pairs_with_no_number_in_them_are_refused_by_name(field, value):
    state = random_state(np.random.default_rng(3), 3)
    getattr(state, field)[1] = value
    for barrier in TURNS.values():
        if not np.ndim(barrier.sigma):
            with pytest.raises(FloatingPointError, match="vehicles 1 and 2"):
                pair_rows(barrier.values(state), state, cubic(0.1))


def test_the_manoeuvre_is_the_one_h_is_made_of():
    gamma = TurnBarrier(V, OMEGA, DS, sigma=[0.8, 1.0, 1.2]).manoeuvre(3)
    np.testing.assert_allclose(gamma.array(), [[v, OMEGA, 0] for v in (0.8 * V, V, 1.2 * V)])
    gamma = StraightBarrier([16.0, 17.0], [1.0, 2.0], DS).manoeuvre(2)
    np.testing.assert_array_equal(gamma.array(), [[16, 0, 1], [17, 0, 2]])
    assert TurnBarrier(V, OMEGA, DS).manoeuvre(4).shape == (4,)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: TurnBarrier(V, 0.0, DS), "StraightBarrier"),
        (lambda: TurnBarrier(-1.0, OMEGA, DS), "speed v"),
        (lambda: TurnBarrier(V, OMEGA, 0.0), "d_safe"),
        (lambda: TurnBarrier(V, OMEGA, np.nan), "d_safe"),
        (lambda: TurnBarrier(V, OMEGA, DS, delta=-1.0), "delta"),
        (lambda: TurnBarrier(V, OMEGA, DS, smoothing=np.inf), "smoothing"),
        (lambda: TurnBarrier(V, OMEGA, DS, sigma=[1.0, 0.0]), "sigma"),
        (lambda: TurnBarrier(V, OMEGA, DS, form="cube"), "unknown form"),
        (lambda: StraightBarrier([16.0, 17.0, 16.0], 0.0, DS), "vehicles 1 and 3 .*discontinuous"),
        (lambda: StraightBarrier([16.0, -17.0], 0.0, DS), "positive"),
        (lambda: StraightBarrier([16.0, 17.0], [np.nan, 0.0], DS), "climb rates"),
        (lambda: StraightBarrier([16.0, 17.0], [0.0, 0.0, 1.0], DS), "zeta has 3"),
        (lambda: EuclideanBarrier(-5.0), "d_safe"),
        (lambda: ForwardDifference(TurnBarrier(V, OMEGA, DS), 0.0), "step"),
        (lambda: TurnBarrier(V, OMEGA, DS, sigma=[1.0, 1.1]).values(State(*np.zeros((4, 3)))), "sigma has 2"),
        (lambda: TurnBarrier(V, OMEGA, DS).values(State(*np.zeros((4, 3))), i=np.array([0])), "both pair"),
    ],
)
def test_mistakes_are_refused_with_the_reason(make, reason):
    with pytest.raises(ValueError, match=reason):
        make()


def test_importing_barriers_does_not_import_scipy():
    code = (
        "import sys, filters.barriers.closed_form, filters.barriers.class_k; sys.exit('scipy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
