"""The least distance between samples: arcs against fine sampling, bounds against paths that bend."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from filters.barriers.pairs import all_pairs
from filters.model import Command, State, step
from testbed.measures.between_samples import (
    TOLERANCE_M,
    ArcApproach,
    Bends,
    closest_on_arcs,
    nearest_on_chords,
)

M = 6


def arcs(seed, straight=False):
    """M pairs that fly arcs through about one place, for a period."""
    rng = np.random.default_rng(seed)
    period = 10.0 ** rng.uniform(-2, 0.7)
    rates = []
    for _ in range(2):
        omega = rng.uniform(-0.6, 0.6, M) * (0.0 if straight else 1.0)
        rates.append(Command(rng.uniform(5, 30, M), omega, rng.uniform(-4, 4, M)))
    rates[1] = Command(
        rates[1].v, np.where(rng.random(M) < 0.3, rates[0].omega, rates[1].omega), rates[1].zeta
    )
    middle = [State(rng.normal(0, 4, M), rng.normal(0, 4, M), rng.uniform(-9, 9, M), rng.normal(0, 2, M))] * 2
    middle[1] = State(rng.normal(0, 4, M), rng.normal(0, 4, M), rng.uniform(-9, 9, M), rng.normal(0, 2, M))
    back = period * rng.uniform(-0.2, 1.2, M)
    a, b = (step(m, r, -back) for m, r in zip(middle, rates, strict=True))
    return a, rates[0], b, rates[1], period


def sampled(a, rates_a, b, rates_b, period, n=20_001):
    t = np.linspace(0.0, period, n)[:, None]
    apart = step(a, rates_a, t).position - step(b, rates_b, t).position
    return np.linalg.norm(apart, axis=-1).min(axis=0), period / (n - 1)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), straight=st.booleans())
def test_the_closest_approach_of_arcs_is_that_of_fine_sampling(seed, straight):
    pairs = arcs(seed, straight)
    low, reached, when = closest_on_arcs(*pairs)
    brute, width = sampled(*pairs)
    assert np.all(reached <= brute + 1e-9) and np.all(low <= reached) and np.all(low >= reached - TOLERANCE_M)
    # A sample is half a width from the true minimum at most; the pair closes at 60 m/s at most.
    assert np.all(reached >= brute - 0.5 * width * 62.0)
    a, rates_a, b, rates_b, period = pairs
    there = step(a, rates_a, when).position - step(b, rates_b, when).position
    np.testing.assert_allclose(np.linalg.norm(there, axis=-1), reached, rtol=0, atol=1e-9)
    assert np.all((when >= 0) & (when <= period))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), enough=st.floats(0.5, 8.0))
def test_above_what_is_enough_a_lower_bound_is_given(seed, enough):
    pairs = arcs(seed)
    low, reached, _ = closest_on_arcs(*pairs, enough)
    exact = closest_on_arcs(*pairs)[1]
    assert np.all(low <= exact + 1e-12) and np.all(reached >= exact - TOLERANCE_M)
    assert np.all(low >= np.minimum(enough, reached - TOLERANCE_M))
    touching = exact < enough - TOLERANCE_M
    np.testing.assert_allclose(reached[touching], exact[touching], rtol=0, atol=2 * TOLERANCE_M)


def test_vehicles_in_formation_and_head_on_ones_have_distances_that_are_known():
    # In formation, for a whole turn: always 7 m apart, and 6 m above one another.
    a = State([0.0, 0.0], [0.0, 0.0], [0.3, 0.3], [0.0, 0.0])
    b = State([7.0, 0.0], [0.0, 0.0], [0.3, 0.3], [0.0, 6.0])
    rates = Command([20.0, 20.0], 0.2, 0.0)
    low, reached, _ = closest_on_arcs(a, rates, b, rates, 31.4)
    np.testing.assert_allclose(reached, [7.0, 6.0], atol=1e-9)
    np.testing.assert_allclose(low, [7.0, 6.0], atol=2e-9)
    # Head-on with 3 m between the straight paths.
    a, b = State([-50.0], [0.0], [0.0], [0.0]), State([50.0], [3.0], [np.pi], [0.0])
    low, reached, when = closest_on_arcs(a, Command([20.0], 0.0, 0.0), b, Command([30.0], 0.0, 0.0), 5.0)
    assert reached[0] == pytest.approx(3.0, abs=1e-9) and when[0] == pytest.approx(2.0, abs=1e-4)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), periods=st.integers(1, 6))
def test_of_a_flight_on_arcs_the_bounds_and_the_least_are_those_of_fine_sampling(seed, periods):
    rng = np.random.default_rng(seed)
    n, steps, fdm_dt, enough = 4, 5, 10.0 ** rng.uniform(-2, -0.3), 6.0
    i, j = all_pairs(n)
    now = State(rng.normal(0, 12, n), rng.normal(0, 12, n), rng.uniform(-9, 9, n), rng.normal(0, 1, n))
    starts, rates, samples, fine = [], [], [now.position], []
    for _ in range(steps):
        command = Command(rng.uniform(15, 25, n), rng.uniform(-0.3, 0.3, n), rng.uniform(-3, 3, n))
        starts.append(now.array())
        rates.append(command.array())
        fine.append(step(now, command, np.linspace(0, periods * fdm_dt, 3001)[:, None]).position)
        for k in range(1, periods + 1):
            samples.append(step(now, command, k * fdm_dt).position)
        now = step(now, command, periods * fdm_dt)
    whole = np.array(samples)
    offset = whole[:, i] - whole[:, j]
    chords = nearest_on_chords(offset[:-1], offset[1:]).reshape(steps, periods, i.size)
    t = periods * fdm_dt * np.arange(steps)
    found = ArcApproach(i, j, enough)
    cut = int(rng.integers(0, steps + 1))
    for part in (slice(0, cut), slice(cut, steps)):
        flown = (
            State.of(np.array(starts)[part].reshape(-1, n, 4)),
            Command.of(np.array(rates)[part].reshape(-1, n, 3)),
        )
        found.update(t[part], *flown, chords[part], fdm_dt)
    true = np.min([np.linalg.norm(f[:, i] - f[:, j], axis=-1).min(axis=0) for f in fine], axis=0)
    assume(np.all(np.abs(true - enough) > 0.1))
    slack = 50.0 * periods * fdm_dt / 3000
    near = true < enough
    assert np.all(found.possible <= true + 1e-9)
    assert np.all(found.possible[~near] >= enough - TOLERANCE_M)
    assert np.all(found.possible[near] >= true[near] - slack)
    assert np.all(np.abs(found.least.value[near] - true[near]) <= slack)
    assert np.all((found.least.t[near] >= 0) & (found.least.t[near] <= steps * periods * fdm_dt + 1e-9))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), periods=st.integers(1, 5))
def test_a_path_that_accelerates_stays_within_its_radius_of_the_straight_lines(seed, periods):
    """Accelerations of vehicles that change smoothly, several times slower than samples are taken."""
    rng = np.random.default_rng(seed)
    n, dt = 2, 0.1
    i, j = all_pairs(n)
    omega, phase = rng.uniform(0.5, 4.0, (3, n)), rng.uniform(0, 6, (3, n))
    size, speed = rng.uniform(0.2, 3.0, (3, n)), rng.normal(0, 10, (3, n))

    def track(t):
        return (
            size[:, None] * np.sin(omega[:, None] * t[:, None] + phase[:, None]) + speed[:, None] * t[:, None]
        )

    bends = Bends(n)
    count = 12 * periods
    samples = track(dt * np.arange(count + 1))
    cut = periods * int(rng.integers(1, 12))
    for part in (slice(0, cut + 1), slice(cut, count + 1)):
        bends.update(samples[:, part], periods)
    apart = (samples[:, :, i] - samples[:, :, j]).transpose(1, 2, 0)
    chords = nearest_on_chords(apart[:-1], apart[1:])
    fine = track(np.linspace(0, dt * count, 50 * count + 1))
    true = np.linalg.norm((fine[:, :, i] - fine[:, :, j]).transpose(1, 2, 0), axis=-1)
    true = np.minimum(true[:-1].reshape(count, 50, -1).min(axis=1), true[50::50])
    radius = bends.radius(i, j)
    assert np.all(true >= chords - radius - 1e-9) and np.all(true <= chords + radius + 0.05)


def test_a_jump_of_velocity_where_commands_change_bends_no_path_between_samples():
    t = 0.1 * np.arange(9)
    kinked = np.where(t < 0.4, t, 0.4 + 9.0 * (t - 0.4))
    track = np.zeros((3, 9, 1))
    track[0, :, 0] = kinked
    for periods, largest in ((4, 0.0), (2, 0.0), (3, 0.8), (1, 0.8)):
        bends = Bends(1)
        bends.update(track, periods)
        assert bends.largest[0] == pytest.approx(largest, abs=1e-12), periods
    # in two parts as well, the second beginning with the sample that the first ended with
    bends = Bends(1)
    bends.update(track[:, :5], 1)
    bends.update(track[:, 4:], 1)
    assert bends.largest[0] == pytest.approx(0.8)


def test_of_a_path_sampled_twice_nothing_is_known_between():
    bends = Bends(2)
    assert np.isinf(bends.radius(np.array([0]), np.array([1]))[0])
    bends.update(np.zeros((3, 2, 2)), 1)
    assert np.isinf(bends.radius(np.array([0]), np.array([1]))[0])
    bends.update(np.zeros((3, 3, 2)), 1)
    assert bends.radius(np.array([0]), np.array([1]))[0] == 0.0
