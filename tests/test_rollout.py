"""The general construction: the oracle of the closed forms, and barriers for mixed manoeuvres."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from filters.barriers import global_minimum as search
from filters.barriers.closed_form import StraightBarrier, TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.barriers.global_minimum import NotLocated, global_minimum
from filters.barriers.pairs import ForwardDifference, all_pairs
from filters.barriers.range_functions import Motion, SquaredRange
from filters.barriers.rollout import PremiseNotMet, RolloutBarrier
from filters.model import Command, State, step

DS = 5.0
MIXED = Command(
    [16.0, 20.0, 15.0, 18.0, 24.0, 17.0, 21.0, 16.0],
    [0.2, -0.2, 0.1, 0.0, 0.0, 0.15, -0.1, 0.4],
    [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5, 0.0],
)


def random_state(rng, n, reach=200.0):
    planar = rng.uniform(-reach, reach, (2, n))
    return State(*planar, rng.uniform(-4, 4, n), rng.uniform(-5, 5, n))


def assert_agrees(rollout, closed, state, i, j):
    got, want = rollout.values(state, i, j), closed.values(state, i, j)
    np.testing.assert_allclose(got.h, want.h, rtol=1e-12, atol=1e-8)
    size = np.max(np.abs(want.grad), axis=1, keepdims=True)
    assert np.max(np.abs(got.grad - want.grad) / size) < 1e-8


# 400 vehicles as 200 disjoint pairs
I, J = np.arange(0, 400, 2), np.arange(1, 400, 2)


@pytest.mark.parametrize("form", ["root", "squared"])
@pytest.mark.parametrize("omega", [0.2042, -0.15])
@pytest.mark.parametrize(("delta", "sigma"), [(0.0, 1.0), (0.01, 1.0), (0.5, 0.8), (0.0, 1.3)])
def test_rollout_agrees_with_turn_on_200_random_pairs(form, omega, delta, sigma):
    ratio = np.where(np.arange(400) % 2, 1.0, sigma)
    closed = TurnBarrier(16.0, omega, DS, delta=delta, sigma=ratio, form=form)
    # the pairs' turns share one period, so the manoeuvre of all 400 passes as that of each pair does
    rollout = RolloutBarrier(closed.manoeuvre(400), DS, SquaredRange(delta), form)
    assert_agrees(rollout, closed, random_state(np.random.default_rng(20), 400), I, J)


@pytest.mark.parametrize("form", ["root", "squared"])
@pytest.mark.parametrize("climb", [0.0, 3.0])
def test_rollout_agrees_with_straight_on_200_random_pairs(form, climb):
    rng = np.random.default_rng(21)
    closed = StraightBarrier(16 + 8 * rng.random(400), climb * rng.uniform(-1, 1, 400), DS, form)
    rollout = RolloutBarrier(closed.manoeuvre(400), DS, form=form)
    assert_agrees(rollout, closed, random_state(rng, 400), I, J)


@pytest.mark.slow
def test_rollout_agrees_with_a_fine_grid_for_mixed_manoeuvres():
    barrier = RolloutBarrier(MIXED, DS)
    rng = np.random.default_rng(22)
    n = len(MIXED)
    for _ in range(5):
        state = random_state(rng, n)
        values = barrier.values(state)
        tau = np.linspace(0.0, 300.0, 60001)[:, np.newaxis]
        for p, (i, j) in enumerate(zip(*all_pairs(n), strict=True)):

            def distance(t, state=state, i=i, j=j):
                a, b = step(state[[i]], MIXED[[i]], t), step(state[[j]], MIXED[[j]], t)
                return np.sqrt((a.x - b.x) ** 2 + (a.y - b.y) ** 2 + (a.z - b.z) ** 2)

            coarse = tau[np.argmin(distance(tau))]
            fine = distance(coarse + np.linspace(-np.minimum(coarse[0], 0.006), 0.006, 20001))
            if fine.min() > 0.1 * DS:
                assert values.h[p] == pytest.approx(fine.min() - DS, abs=1e-6)


def test_gradient_agrees_with_differences_for_mixed_manoeuvres():
    barrier = RolloutBarrier(MIXED, DS, SquaredRange(5.0))
    state = random_state(np.random.default_rng(23), len(MIXED))
    analytic = barrier.values(state).grad
    differenced = ForwardDifference(barrier, 1e-6).values(state).grad
    # a step of 1e-6 errs by half of it times the second derivative, up to 1e3 m/rad^2 here
    np.testing.assert_allclose(differenced, analytic, atol=1e-3, rtol=1e-5)


def test_the_manoeuvre_never_loses_h_and_h_rises_only_when_the_worst_is_now():
    barrier = RolloutBarrier(MIXED, DS)
    state = random_state(np.random.default_rng(24), len(MIXED))
    values, when = barrier.values(state), barrier.worst_time(state)
    lie_i, lie_j = values.lie(state)
    gamma = MIXED.array()
    product = np.sum(lie_i * gamma[values.i] + lie_j * gamma[values.j], axis=1)
    size = np.linalg.norm(np.hstack([lie_i, lie_j]), axis=1)
    assert np.all(product >= -1e-9 * size)
    assert np.all(np.abs(product[when != 0]) <= 1e-9 * size[when != 0])
    assert np.any(product[when == 0] > 0.1)


def test_a_deep_narrow_minimum_late_in_a_long_period_is_found():
    # Rates of ratio 31 : 32 close after 31 and 32 turns; the pair is made to meet in the middle of them.
    gamma = Command([16.0, 16.0], [0.31, 0.32], 0.0)
    meet = State.of([[0.0, 0.0, 0.3, 0.0], [0.0, 0.0, 1.9, 1.0]])
    period = 2 * np.pi / 0.01
    start = step(meet, gamma, -0.57 * period)
    barrier = RolloutBarrier(gamma, 0.5)
    assert barrier.values(start).h[0] == pytest.approx(0.5, abs=1e-9)
    assert np.hypot(start.x[0] - start.x[1], start.y[0] - start.y[1]) > 20


def test_a_straight_flyer_meets_a_turning_one_only_within_the_horizon():
    gamma = Command([16.0, 20.0], [0.2, 0.0], 0.0)
    meet = State.of([[0.0, 0.0, 0.3, 0.0], [0.0, 0.0, 1.9, 2.0]])
    start = step(meet, gamma, -40.0)
    barrier = RolloutBarrier(gamma, 1.0)
    assert barrier.values(start).h[0] == pytest.approx(1.0, abs=1e-9)
    assert barrier.worst_time(start)[0] == pytest.approx(40.0, abs=1e-9)
    past = step(meet, gamma, 1.0)
    assert barrier.worst_time(past)[0] == 0.0


def test_the_three_vehicle_counterexample_with_each_pair_its_own_manoeuvre():
    ds, r = 0.5, 1.0
    psi = np.arccos((ds / 2 + 2 * r) / (2 * r + ds))
    across, up = (2 * r + ds) * np.sin(psi), (2 * r + ds) * np.cos(psi) - 2 * r
    state = State.of([[0, 0, 0, 0], [across, up, np.pi, 0], [across, -up, np.pi, 0]])
    right = RolloutBarrier(Command(np.ones(3), -1.0, 0.0), ds).values(state).h
    left = RolloutBarrier(Command(np.ones(3), 1.0, 0.0), ds).values(state).h
    np.testing.assert_allclose([right[0], left[1], left[2]], 0.0, atol=1e-10)
    # one turning left and one right: neither closed form has it
    mixed = RolloutBarrier(Command(np.ones(3), [1.0, -1.0, -1.0], 0.0), ds)
    assert np.all(np.isfinite(mixed.values(state).h))


@dataclass(frozen=True)
class Ellipsoid:
    """Squared range with the vertical counted `k` times: a safety function of a user's own."""

    k: float

    def value(self, a, b):
        return (a.x - b.x) ** 2 + (a.y - b.y) ** 2 + self.k * (a.z - b.z) ** 2 - DS**2

    def gradient(self, a, b):
        g = [2 * (a.x - b.x), 2 * (a.y - b.y), np.zeros_like(a.x), 2 * self.k * (a.z - b.z)]
        return np.stack([*g, *(-x for x in g)], axis=-1)

    def reach(self, value):
        return np.sqrt(np.maximum(value + DS**2, 0.0) / min(1.0, self.k))

    def curvature(self, motion):
        # d^2 |p|^2 = 2 |p'|^2 + 2 p . p'', at most k times as much
        bend = motion.largest_speed**2 + motion.largest_range * motion.largest_acceleration
        return 2 * max(1.0, self.k) * bend


@pytest.mark.slow
def test_a_safety_function_of_ones_own_is_minimised_as_it_is():
    barrier = RolloutBarrier(MIXED, DS, Ellipsoid(4.0), form="plain", resolution=1e-11)
    state = random_state(np.random.default_rng(25), len(MIXED))
    values = barrier.values(state)
    tau = np.linspace(0.0, 300.0, 300001)[:, np.newaxis]
    for p, (i, j) in enumerate(zip(*all_pairs(len(MIXED)), strict=True)):
        a, b = step(state[[i]], MIXED[[i]], tau), step(state[[j]], MIXED[[j]], tau)
        grid = np.min(Ellipsoid(4.0).value(a, b))
        # on a grid of 1 ms the minimum is missed by up to M dt^2/8, M up to 1e4 m^2/s^2
        assert grid - 5e-3 <= values.h[p] <= grid + 1e-9
    differenced = ForwardDifference(barrier, 1e-6).values(state)
    np.testing.assert_allclose(differenced.grad, values.grad, rtol=1e-4, atol=1e-1)


def test_both_straight_with_one_velocity_keep_their_distance():
    gamma = Command([16.0, 16.0], 0.0, 1.0)
    state = State.of([[0.0, 0.0, 0.7, 0.0], [12.0, 5.0, 0.7, 0.0]])
    values = RolloutBarrier(gamma, DS).values(state)
    assert values.h[0] == pytest.approx(8.0, abs=1e-12)
    np.testing.assert_allclose(values.grad, EuclideanBarrier(DS).values(state).grad, atol=1e-14)


def test_parallel_flight_is_cheap_though_every_instant_is_a_minimum():
    n = 20
    state = State(np.arange(n) * 20.0, 0.0, 0.4, 0.0)
    barrier = RolloutBarrier(Command(np.full(n, 16.0), 0.2042, 0.0), DS)
    start = time.perf_counter()
    values = barrier.values(state)
    assert time.perf_counter() - start < 1.0  # 5 ms when healthy, minutes when every cell must be halved
    np.testing.assert_allclose(values.h, 20.0 * (values.j - values.i) - DS, atol=1e-9)


def test_orbits_that_never_close_are_refused_naming_the_pair_and_the_reason():
    with pytest.raises(PremiseNotMet, match=r"vehicles 2 and 3 .* does not close"):
        RolloutBarrier(Command([16.0, 16.0, 16.0], [0.0, 0.2, 0.2 * np.sqrt(2)], 0.0), DS)
    with pytest.raises(PremiseNotMet, match="p, q <= 64"):
        RolloutBarrier(Command([16.0, 16.0], [0.2, 0.2 * 64 / 65], 0.0), DS)
    # with different climb rates they part, and the infimum exists
    gamma = Command([16.0, 16.0], [0.2, 0.2 * np.sqrt(2)], [0.0, 1.0])
    state = random_state(np.random.default_rng(26), 2, 60.0)
    assert np.isfinite(RolloutBarrier(gamma, DS).values(state).h[0])


@pytest.mark.slow
def test_climb_rates_that_nearly_agree_are_refused_with_the_remedy():
    barrier = RolloutBarrier(Command([16.0, 16.0], [0.2, -0.2], [0.0, 1e-9]), DS)
    with pytest.raises(PremiseNotMet, match=r"vehicles 1 and 2 .* make these equal or more different"):
        barrier.values(random_state(np.random.default_rng(28), 2))


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: RolloutBarrier(Command([16.0, 0.0], 0.1, 0.0), DS), "finite v > 0"),
        (lambda: RolloutBarrier(Command([16.0, np.nan], 0.1, 0.0), DS), "finite v > 0"),
        (lambda: RolloutBarrier(MIXED, -1.0), "d_safe"),
        (lambda: RolloutBarrier(MIXED, DS, form="cube"), "choose one of root, squared, plain$"),
        (lambda: RolloutBarrier(MIXED, DS, resolution=0.0), "resolution"),
        (lambda: RolloutBarrier(MIXED, DS, resolution=1.0), "resolution must lie between 0 and 1, got 1.0"),
        (lambda: RolloutBarrier(MIXED, DS).manoeuvre(3), "^gamma has 8 entries for 3 vehicles"),
        (
            lambda: RolloutBarrier(MIXED, DS).worst_time(State(np.zeros(3), 0.0, 0.0, 0.0)),
            "^gamma has 8 entries for 3 vehicles",
        ),
    ],
)
def test_mistakes_are_refused_with_the_reason(make, reason):
    with pytest.raises(ValueError, match=reason):
        make()


number = st.floats(-1e5, 1e5)
wild = st.tuples(number, number, st.floats(-10, 10), number)


@settings(max_examples=50, deadline=None)
@given(
    a=wild, b=wild, which=st.sampled_from([(0, 0), (0, 1), (0, 3), (3, 4), (3, 3), (4, 6), (5, 7), (6, 6)])
)
@example(a=(0.0, 0.0, 0.0, 0.0), b=(0.0, 0.0, 0.0, 0.0), which=(3, 3))
@example(a=(0.0, 0.0, 0.0, 0.0), b=(0.0, 0.0, 0.0, 0.0), which=(0, 0))
@example(a=(0.0, 0.0, 0.0, 0.0), b=(0.0, 0.0, 1e-9, 0.0), which=(3, 3))
@example(a=(1e5, 0.0, 0.0, 0.0), b=(-1e5, 0.0, np.pi, 0.0), which=(0, 3))
def test_value_and_gradient_are_finite_everywhere(a, b, which):
    values = RolloutBarrier(MIXED[list(which)], DS, SquaredRange(0.01)).values(State.of([a, b]))
    assert np.all(np.isfinite(values.h))
    assert np.all(np.isfinite(values.grad))


@settings(max_examples=50, deadline=None)
@given(st.data())
def test_no_minimum_of_a_random_trigonometric_sum_is_missed(data):
    k = np.arange(1, 6)
    amplitude = np.array(data.draw(st.lists(st.floats(0, 10), min_size=5, max_size=5)))
    phase = np.array(data.draw(st.lists(st.floats(-4, 4), min_size=5, max_size=5)))

    def value(p, t):
        return np.sum(amplitude * np.cos(k * t[..., np.newaxis] + phase), axis=-1)

    def slope(p, t):
        return np.sum(-k * amplitude * np.sin(k * t[..., np.newaxis] + phase), axis=-1)

    bound = np.array([np.sum(amplitude * k**2)])
    one = np.ones(1)
    tau = global_minimum(value, slope, bound, 2 * np.pi * one, np.array([True]), one, 1e-13)
    grid = value(None, np.linspace(0, 2 * np.pi, 20001))
    assert value(None, tau)[0] <= grid.min() + 1e-11 * (1 + bound[0])


@dataclass(frozen=True)
class Told(SquaredRange):
    """The squared range, keeping the motions it is told."""

    motions: list = field(default_factory=list)

    def curvature(self, motion):
        self.motions.append(motion)
        return super().curvature(motion)


@dataclass(frozen=True)
class Mirrored:
    """The squared range whose delta tilts with the second vehicle's course instead of the first's."""

    delta: float

    def value(self, a, b):
        return SquaredRange(self.delta).value(b, a)

    def gradient(self, a, b):
        return np.roll(SquaredRange(self.delta).gradient(b, a), 4, axis=-1)

    def reach(self, value):
        return SquaredRange(self.delta).reach(value)

    def curvature(self, motion):
        return SquaredRange().curvature(motion) + 2 * self.delta * motion.rate_j**2


def test_with_the_vehicles_exchanged_a_mirrored_safety_function_gives_the_same():
    state, swap = random_state(np.random.default_rng(34), 2, 60.0), [1, 0]
    one = RolloutBarrier(MIXED[:2], DS, SquaredRange(9.0)).values(state)
    other = RolloutBarrier(MIXED[swap], DS, Mirrored(9.0)).values(state[swap])
    np.testing.assert_allclose(other.h, one.h, rtol=1e-9)
    np.testing.assert_allclose(np.roll(other.grad, 4, axis=-1), one.grad, rtol=1e-6, atol=1e-9)


def test_the_motion_a_safety_function_is_told_is_that_of_the_vehicles():
    told = Told()
    state = random_state(np.random.default_rng(32), len(MIXED))
    RolloutBarrier(MIXED, DS, told).values(state)
    (m,), (i, j) = told.motions, all_pairs(len(MIXED))
    np.testing.assert_array_equal(m.theta_i, state.theta[i])
    for tau in (0.0, 1.3, 7.7):
        a, b = step(state[i], MIXED[i], tau), step(state[j], MIXED[j], tau)
        offset = m.centre + m.drift * tau
        offset = offset + m.arm_i * np.exp(1j * m.rate_i * tau) + m.arm_j * np.exp(1j * m.rate_j * tau)
        np.testing.assert_allclose(offset, a.x - b.x + 1j * (a.y - b.y), atol=1e-9)
        np.testing.assert_allclose(m.height + m.climb * tau, a.z - b.z, atol=1e-12)
    alike = MIXED.omega[i] == MIXED.omega[j]
    assert np.all(m.arm_j[alike] == 0.0) and alike.any()


def test_beyond_its_horizon_no_pair_comes_as_close_as_it_is_now():
    told = Told()
    for seed in range(5):
        state = random_state(np.random.default_rng(40 + seed), len(MIXED), 60.0)
        RolloutBarrier(MIXED, DS, told).values(state)
        m, (i, j) = told.motions[-1], all_pairs(len(MIXED))
        now = told.value(state[i], state[j])
        for share in np.linspace(1.0, 4.0, 60):
            tau = share * m.horizon
            later = told.value(step(state[i], MIXED[i], tau), step(state[j], MIXED[j], tau))
            parts = ~np.isfinite(RolloutBarrier(MIXED, DS).period[i, j])
            assert np.all(later[parts] >= now[parts] * (1 - 1e-6))


def test_the_horizon_of_two_who_fly_straight_ends_when_they_are_as_far_apart_again():
    told = Told()
    # 100 m apart, closing at 30 m/s, 10 m past each other sideways and 4 m in height, closing at 0.5 m/s
    gamma = Command([18.0, 12.0], 0.0, [0.0, 0.5])
    approaching = State([0.0, 100.0], [0.0, 10.0], [0.0, np.pi], [4.0, 0.0])
    RolloutBarrier(gamma, DS, told).values(approaching)
    assert told.motions[0].horizon[0] == pytest.approx(2 * (100 * 30 + 4 * 0.5) / (30**2 + 0.5**2), rel=1e-8)
    parting = State([0.0, -100.0], [0.0, 10.0], [0.0, np.pi], [-4.0, 0.0])
    RolloutBarrier(gamma, DS, told).values(parting)
    assert told.motions[1].horizon[0] == pytest.approx(0.0, abs=1e-9)


def test_the_plain_form_is_the_minimum_itself_with_its_gradient():
    state = random_state(np.random.default_rng(33), len(MIXED))
    plain, root = (RolloutBarrier(MIXED, DS, form=form).values(state) for form in ("plain", "root"))
    far = root.h > 0.0
    np.testing.assert_allclose(plain.h[far], (root.h[far] + DS) ** 2, rtol=1e-9)
    np.testing.assert_allclose(plain.grad[far], 2 * (root.h[far, None] + DS) * root.grad[far], rtol=1e-7)
    assert far.sum() > 10


def test_turn_rates_of_a_ratio_up_to_64_have_a_period():
    turning = Command([16.0, 16.0], [0.64, -0.01], 0.0)
    assert RolloutBarrier(turning, DS).period[0, 1] == pytest.approx(2 * np.pi / 0.01)
    sevenths = Command([16.0, 16.0], [0.3, 0.7], 0.0)
    assert RolloutBarrier(sevenths, DS).period[1, 0] == pytest.approx(2 * np.pi / 0.1)
    reason = (
        "vehicles 1 and 2 climb alike and turn at 0.65 and 0.01 rad/s, without a ratio p/q of p, q <= 64: "
        "their relative orbit does not close and no time attains the infimum; choose commensurable turn "
        "rates or different climb rates"
    )
    with pytest.raises(PremiseNotMet, match=f"^{re.escape(reason)}$"):
        RolloutBarrier(Command([16.0, 16.0], [0.65, 0.01], 0.0), DS)


def test_a_minimum_that_outgrows_memory_is_refused_naming_the_pair_and_the_horizon(monkeypatch):
    monkeypatch.setattr(search, "CELL_LIMIT", 1000)
    gamma = Command(np.full(3, 16.0), [0.2, 0.0, -0.2], [5.0, 0.0, 5.001])
    state = random_state(np.random.default_rng(28), 3)
    with pytest.raises(
        PremiseNotMet, match=r"of vehicles 1 and 3 cannot be located within .* horizon of \d"
    ) as e:
        RolloutBarrier(gamma, DS).values(state)
    assert "make these equal or more different, else choose a coarser resolution" in str(e.value)


def dips(centre, width, depth, offset=0.0):
    """Functions offset - depth exp(-((t - centre) / width)^2), all (P,), and what `global_minimum` needs."""
    centre, width, depth, offset = (np.asarray(a, float) for a in (centre, width, depth, offset * np.ones(1)))
    offset = np.broadcast_to(offset, centre.shape)

    def value(p, t):
        return offset[p] - depth[p] * np.exp(-(((t - centre[p]) / width[p]) ** 2))

    def slope(p, t):
        return 2 * (t - centre[p]) / width[p] ** 2 * (offset[p] - value(p, t))

    return value, slope, 2 * depth / width**2


def test_a_narrow_dip_is_found_where_it_is_deeper_than_the_resolution_says():
    # Depth 1 m; the size is what the curvature allows in a first cell, 78 m, of which 1 % is less.
    value, slope, bound = dips([0.4217], [0.005], [1.0])
    one, no = np.ones(1), np.zeros(1, dtype=bool)
    tau = global_minimum(value, slope, bound, one, no, one * 0.005, 1e-2)
    assert tau == pytest.approx(0.4217, abs=1e-6)


def test_each_function_is_searched_to_its_own_size():
    centre, width = np.array([0.371, 0.648]), np.array([0.1, 0.004])
    value, slope, bound = dips(centre, width, [1e13, 1e-3], np.array([1e13, 0.0]))
    two, no = np.ones(2), np.zeros(2, dtype=bool)
    np.testing.assert_allclose(global_minimum(value, slope, bound, two, no, width, 1e-13), centre, atol=1e-6)


def test_a_function_over_no_time_is_least_at_once():
    value, slope, bound = dips([0.3, 0.3], [0.1, 0.1], [1.0, 1.0])
    end, no = np.array([0.0, 0.5]), np.zeros(2, dtype=bool)
    tau = global_minimum(value, slope, bound, end, no, np.full(2, 0.1), 1e-13)
    np.testing.assert_allclose(tau, [0.0, 0.3], atol=1e-7)


def test_the_time_found_never_leaves_the_interval_of_a_function_without_period():
    value, slope, bound = dips([-0.001, 0.501], [0.1, 0.1], [1.0, 1.0])
    end, no = np.full(2, 0.5), np.zeros(2, dtype=bool)
    tau = global_minimum(value, slope, bound, end, no, np.full(2, 0.1), 1e-13)
    assert tau[0] == 0.0 and tau[1] == pytest.approx(0.5, abs=2e-3)


def test_a_search_that_outgrows_memory_names_its_function(monkeypatch):
    monkeypatch.setattr(search, "CELL_LIMIT", 1000)
    # The second is flat, but its bound says that it could dip anywhere.
    value, slope, bound = dips([0.3, 0.3], [0.1, 0.1], [1.0, 0.0], 1.0)
    bound[1] = 1e9
    two, no = np.ones(2), np.zeros(2, dtype=bool)
    with pytest.raises(NotLocated, match="minimum of function 1 cannot be located with 1000 cells") as raised:
        global_minimum(value, slope, bound, two, no, np.full(2, 0.1), 1e-13)
    assert raised.value.function == 1


def test_the_bound_on_a_cell_is_met_by_the_parabola_that_bends_as_much_as_allowed():
    rng = np.random.default_rng(30)
    left, rise, bend, width = rng.normal(size=500), rng.normal(size=500), rng.uniform(0, 9, 500), 0.7
    vertex = -rise / bend
    inside = (vertex > 0) & (vertex < width)
    ends = left, left + rise * width + 0.5 * bend * width**2
    least = np.where(inside, left - 0.5 * rise**2 / bend, np.minimum(*ends))
    np.testing.assert_allclose(search.least_possible(*ends, np.full(500, width), bend), least, atol=1e-12)
    assert 50 < inside.sum() < 450


def motion(**given):
    """One pair's `Motion`; what is not given is 0, and the horizon 10 s."""
    names = ["centre", "drift", "arm_i", "arm_j", "rate_i", "rate_j", "height", "climb", "theta_i"]
    fields = dict.fromkeys(names, 0.0) | {"horizon": 10.0} | given
    return Motion(**{name: np.array([value]) for name, value in fields.items()})


GENERAL = {
    "centre": 3 + 4j, "drift": 3j, "arm_i": -2.0, "arm_j": 3j, "rate_i": -0.5, "rate_j": 1.5, "height": -2.0,
    "climb": -1.0,
}  # fmt: skip


def test_the_bounds_of_a_motion_are_the_sums_of_their_parts():
    m = motion(**GENERAL)
    # centre 5 m, drift 30 m in 10 s, arms 2 and 3 m; height 2 m and 10 m
    assert m.largest_range[0] == pytest.approx(np.hypot(40.0, 12.0))
    # drift 3, arms 1 and 4.5, climb 1 m/s
    assert m.largest_speed[0] == pytest.approx(np.hypot(8.5, 1.0))
    assert m.largest_acceleration[0] == pytest.approx(0.5 + 6.75)
    # Arm i against centre and drift 140 m^2 at 0.25, arm j 210 at 2.25, both 12 at 4; twice the squared drift
    # and climb; four times the drift and the arms' 5.5 m/s.
    assert SquaredRange().curvature(m)[0] == pytest.approx(35 + 472.5 + 48 + 20 + 66)


def test_no_motion_bends_more_than_its_bounds_say():
    rng = np.random.default_rng(31)
    t = np.linspace(0.0, 10.0, 4001)
    for _ in range(20):
        planar = rng.normal(size=(4, 2)) @ [1, 1j] * [30, 5, 20, 20]
        names = ("centre", "drift", "arm_i", "arm_j")
        rates, vertical = rng.uniform(-0.6, 0.6, 2), rng.normal(size=2)
        theta = np.angle(planar[2]) + np.sign(rates[0]) * np.pi / 2
        m = motion(**dict(zip(names, planar, strict=True)), rate_i=rates[0], rate_j=rates[1],
                   height=vertical[0], climb=vertical[1], theta_i=theta)  # fmt: skip
        path = (
            planar[0]
            + planar[1] * t
            + sum(a * np.exp(1j * w * t) for a, w in zip(planar[2:], rates, strict=True))
        )
        up, course = vertical[0] + vertical[1] * t, theta + rates[0] * t
        for delta in (0.0, 50.0):
            rho = abs(path) ** 2 + up**2 + delta * (np.sin(course) - np.cos(course) - 2)
            bend = np.max(np.abs(np.diff(rho, 2))) / t[1] ** 2
            assert bend <= SquaredRange(delta).curvature(m)[0] * (1 + 1e-6)
        assert np.max(np.hypot(abs(path), up)) <= m.largest_range[0]
        speed = np.hypot(abs(np.diff(path)), np.diff(up)) / t[1]
        assert np.max(speed) <= m.largest_speed[0]
        assert np.max(abs(np.diff(path, 2))) / t[1] ** 2 <= m.largest_acceleration[0] * (1 + 1e-6)


@pytest.mark.parametrize("theta", [0.4, 2.5, -1.9])
def test_of_one_shared_turn_the_bend_is_known_exactly(theta):
    """The range is a constant and one harmonic, delta's included: its amplitude times the rate squared."""
    centre, arm, rate, delta = 7 - 3j, 4 + 1j, -0.3, 25.0
    m = motion(centre=centre, arm_i=arm, rate_i=rate, rate_j=rate, theta_i=theta)
    t = np.linspace(0.0, 2 * np.pi / abs(rate), 100_001)
    course = theta + rate * t
    rho = abs(centre + arm * np.exp(1j * rate * t)) ** 2 + delta * (np.sin(course) - np.cos(course))
    most = (rho.max() - rho.min()) / 2 * rate**2
    assert SquaredRange(delta).curvature(m)[0] == pytest.approx(most, rel=1e-6)


def test_beyond_its_reach_no_pair_is_as_close_and_at_it_the_worst_course_is():
    safety = SquaredRange(3.0)
    # sin theta - cos theta is least, -sqrt 2, at -45 degrees
    reach = safety.reach(np.array([40.0]))
    worst = State(reach, 0.0, -np.pi / 4, 0.0), State(np.zeros(1), 0.0, 0.0, 0.0)
    assert safety.value(*worst)[0] == pytest.approx(40.0)
    assert safety.reach(np.array([-1e3]))[0] == 0.0


def test_lists_of_manoeuvres_have_one_period_where_their_rates_are_small_multiples():
    gamma = Command(np.full(4, 16.0), [0.1, 0.2, -0.3, 0.25], 0.0)
    state = random_state(np.random.default_rng(27), 4)
    barrier = RolloutBarrier(gamma, DS)
    h = [barrier.values(step(state, gamma, t)).h for t in (0.0, 3.0, 11.0)]
    # along closed orbits h is constant
    for one, other in pairwise(h):
        np.testing.assert_allclose(other, one, atol=1e-9)
