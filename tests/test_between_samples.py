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


def test_the_radius_of_a_constant_acceleration_is_that_of_twice_its_size():
    """2 a T^2 / 8 for each of a pair, the accelerations of the three vehicles being 1, 2 and 6 m/s^2."""
    dt, a = 0.1, np.array([1.0, 2.0, 6.0])
    t = dt * np.arange(6)
    track = np.zeros((3, 6, 3))
    track[1] = 0.5 * a * t[:, None] ** 2
    bends = Bends(3)
    bends.update(track, 3)
    np.testing.assert_allclose(bends.largest, a * dt**2, rtol=1e-9)
    i, j = all_pairs(3)
    np.testing.assert_allclose(bends.radius(i, j), 2 * (a[i] + a[j]) * dt**2 / 8, rtol=1e-9)


# Arcs whose closest approach is known


def test_the_closest_approach_of_pairs_that_part_or_meet_is_at_the_begin_or_the_end():
    """On straight lines, one pair overtaking at 10 m/s, the other falling behind so."""
    a = State([0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    b = State([30.0, 50.0], [3.0, 4.0], [0.0, 0.0], [4.0, 3.0])
    rates_b = Command([30.0, 10.0], 0.0, 0.0)
    _, reached, when = closest_on_arcs(a, Command([20.0, 20.0], 0.0, 0.0), b, rates_b, 2.0)
    assert list(when) == [0.0, 2.0]
    np.testing.assert_allclose(reached, [np.hypot(30, 5), np.hypot(30, 5)], rtol=1e-15)


def test_arcs_whose_accelerations_are_equal_at_first_are_bounded_by_their_turning_apart():
    """Equal v omega and course: the offset's acceleration is 0 at first, and grows over several turns."""
    rng = np.random.default_rng(5)
    m = 200
    a = State(rng.normal(0, 40, m), rng.normal(0, 40, m), 0.0, 0.0)
    b = State(np.zeros(m), 0.0, 0.0, 0.0)
    turn, v = rng.uniform(5, 18, m), rng.uniform(10, 30, (2, m))
    rates_a, rates_b = (Command(speed, turn / speed, 0.0) for speed in v)
    low, reached, _ = closest_on_arcs(a, rates_a, b, rates_b, 10.0)
    brute, width = sampled(a, rates_a, b, rates_b, 10.0, 2001)
    assert np.all(reached <= brute + 1e-9) and np.all(low >= reached - TOLERANCE_M)
    assert np.all(reached >= brute - 0.5 * width * 60.0)


def approach(monkeypatch, places, rates, enough, periods=1, dt=0.1, t=(0.0,)):
    """After so many equal filter periods on arcs, and the arcs that were searched: (period, i, j)."""
    from testbed.measures import between_samples

    n, searched = len(places), []
    i, j = all_pairs(n)
    now, flown = State.of(np.array(places, dtype=float)), Command.of(np.array(rates, dtype=float))
    starts, samples = [], [now.position]
    for _ in t:
        starts.append(now.array())
        samples += [step(now, flown, k * dt).position for k in range(1, periods + 1)]
        now = step(now, flown, periods * dt)
    offset = np.array(samples)[:, i] - np.array(samples)[:, j]
    chords = nearest_on_chords(offset[:-1], offset[1:]).reshape(len(t), periods, i.size)

    def search(a, rates_a, b, rates_b, period, enough=np.inf):
        assert period == periods * dt
        for one, two in zip(a.array(), b.array(), strict=True):
            [k] = {k for k, s in enumerate(starts) if (s == one).all(axis=1).any()}
            who = [int(np.flatnonzero((starts[k] == x).all(axis=1))[0]) for x in (one, two)]
            searched.append((k, *who, enough))
        return closest_on_arcs(a, rates_a, b, rates_b, period, enough)

    monkeypatch.setattr(between_samples, "closest_on_arcs", search)
    found = ArcApproach(i, j, enough)
    found.update(
        np.array(t), State.of(np.array(starts)), Command.of(np.array([flown.array()] * len(t))), chords, dt
    )
    return found, searched, chords


def test_only_arcs_that_may_come_near_enough_are_searched(monkeypatch):
    """Side by side at 20 m/s, turning at 0.4 rad/s: within 0.1 s a path leaves its chord by 1 cm at most.

    The pairs are 5.00, 5.01 and 10.01 m apart for ever; 5.0 + 2 cm bounds what has to be searched.
    """
    places = [[0.0, 0.0, 0.0, 0.0], [0.0, 5.0, 0.0, 0.0], [0.0, -5.01, 0.0, 0.0]]
    rates = [[20.0, 0.4, 0.0]] * 3
    leaves = 20.0 * 0.4 * 0.1**2 / 8
    pairs = [5.0, 5.01, 10.01]
    for enough, due in (
        (4.97, []),
        (4.985, [(0, 0, 1)]),
        (4.995, [(0, 0, 1), (0, 0, 2)]),
        (5.02, [(0, 0, 1), (0, 0, 2)]),
    ):
        found, searched, chords = approach(monkeypatch, places, rates, enough)
        assert searched == [(*arc, enough) for arc in due], enough
        np.testing.assert_allclose(chords[0, 0], pairs, atol=1e-12)
        for p, distance in enumerate(pairs):
            if (0, 0, p + 1) in due:
                assert min(enough, distance) - 2 * TOLERANCE_M <= found.possible[p] <= distance + 1e-12
            else:
                assert found.possible[p] == pytest.approx(distance - 2 * leaves, abs=1e-12)
        assert np.isinf(found.least.value[2]) and np.isnan(found.least.t[2])


def test_of_a_pair_that_comes_near_once_only_that_period_is_searched(monkeypatch):
    """Head-on at 40 m/s, 3 m aside, from 14 m: in the fourth of six periods of 0.1 s they pass."""
    places = [[-7.0, 0.0, 0.0, 0.0], [7.0, 3.0, np.pi, 0.0], [0.0, 80.0, 0.0, 0.0]]
    rates = [[20.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    t = 7.0 + 0.1 * np.arange(6)
    found, searched, chords = approach(monkeypatch, places, rates, 3.05, t=t)
    assert {arc[:3] for arc in searched} == {(3, 0, 1)}
    assert found.least.value[0] == pytest.approx(3.0, abs=1e-9)
    assert found.least.t[0] == pytest.approx(7.35, abs=1e-4)
    assert 3.0 - 2 * TOLERANCE_M <= found.possible[0] <= 3.0 + 1e-12
    np.testing.assert_allclose(found.possible[1:], chords.min(axis=(0, 1))[1:], rtol=1e-12)
    # With the nearest period just above what is enough the next ones bound what is possible.
    found, searched, chords = approach(monkeypatch, places, rates, 2.9, t=t)
    assert searched == [] and found.possible[0] == pytest.approx(3.0, abs=1e-9)


def test_of_a_pair_the_periods_that_stay_away_bound_what_is_possible_too(monkeypatch):
    """One that turns is searched in the periods in which it may touch, and bounded in the others."""
    places = [[0.0, 0.0, 0.0, 0.0], [0.0, 6.0, 0.0, 0.0]]
    rates = [[20.0, 0.0, 1.0], [20.0, 0.0, 0.0]]  # climbs away: 6 m at first, then more
    found, searched, chords = approach(monkeypatch, places, rates, 6.05, t=tuple(0.1 * np.arange(10)))
    assert [arc[0] for arc in searched] == [k for k in range(10) if chords[k, 0, 0] < 6.05]
    assert 6.0 - 2 * TOLERANCE_M <= found.possible[0] <= 6.0 + 1e-12
    assert (found.least.value[0], found.least.t[0]) == (6.0, 0.0)


def test_a_distance_that_stays_the_same_was_reached_when_it_was_first(monkeypatch):
    places = [[0.0, 0.0, 0.0, 0.0], [0.0, 3.0, 0.0, 0.0]]
    found, _, _ = approach(monkeypatch, places, [[16.0, 0.0, 0.0]] * 2, 6.0, t=(1.0, 2.0, 3.0), dt=0.125)
    assert (found.least.value[0], found.least.t[0]) == (3.0, 1.0)


def test_bends_of_rates_count_each_vehicle_for_itself(monkeypatch):
    """One flies straight, the other turns: 20 m/s at 0.8 rad/s leaves a chord of 0.1 s by 2 cm."""
    places = [[0.0, 0.0, 0.0, 0.0], [0.0, 50.0, 0.0, 0.0], [0.0, 150.0, 0.0, 0.0]]
    rates = [[20.0, 0.0, 0.0], [20.0, 0.8, 0.0], [20.0, -0.4, 0.0]]
    found, searched, chords = approach(monkeypatch, places, rates, 5.0, periods=2)
    assert searched == []
    due = chords.min(axis=(0, 1)) - np.array([0.02, 0.01, 0.03])
    np.testing.assert_allclose(found.possible, due, atol=1e-12)


def test_no_time_changes_nothing():
    found = ArcApproach(*all_pairs(2), 5.0)
    none = State.of(np.zeros((0, 2, 4))), Command.of(np.zeros((0, 2, 3)))
    found.update(np.zeros(0), *none, np.zeros((0, 1, 1)), 0.1)
    assert np.isinf(found.possible[0]) and np.isinf(found.least.value[0])


def test_the_nearest_point_of_a_chord_is_inside_it_or_an_end_of_it():
    first = np.array([[3.0, -1.0, 4.0], [3.0, 0.0, 0.0], [2.0, 2.0, 1.0], [0.0, 3.0, 4.0]])
    last = np.array([[3.0, 1.0, 4.0], [9.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0, 3.0, 4.0]])
    np.testing.assert_allclose(nearest_on_chords(first, last), [5.0, 3.0, np.sqrt(3), 5.0], rtol=1e-12)
