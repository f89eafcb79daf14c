"""Where vehicles may have been between recorded instants: closed forms, and paths that stay within."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.model import Command, State, step
from testbed.verification.path_bounds import ROUNDING, PathBounds, resolved
from testbed.verification.recorded import Recorded
from tests.hand_made_runs import flown, recorded, scenario

RNG = np.random.default_rng(8)
T, N = 6, 3
# All steps of the flight dynamics, all filter steps, and every fifth.
EVERY, DECISIONS, THIN = (0.02, 0.02, 0.02), (0.02, 0.1, 0.1), (0.02, 0.1, 0.5)
STOPPED = "vehicle 1: stalled, in step 6 at 0.600 s; run stopped"
LIMITS = {"v_min_mps": 15.0, "v_max_mps": 25.0, "omega_max_degps": np.degrees(0.2), "zeta_max_mps": 3.0}


def commands(count: int = T, n: int = N) -> np.ndarray:
    low, high = [15.0, -0.2, -3.0], [25.0, 0.2, 3.0]
    return RNG.uniform(low, high, (count, n, 3))


def arcs(rates: tuple[float, float, float] = DECISIONS, ended: str | None = None, **more: Any) -> Recorded:
    """Unicycles that fly random commands."""
    u = commands()
    states = flown(RNG.normal(0, 40, (N, 4)), u, rates[2])
    return recorded(scenario(rates, limits=LIMITS, **more), states, u, ended=ended)


def straight(
    speeds: list[float],
    rates: tuple[float, float, float],
    climb: float = 0.0,
    plant: str = "jsbsim",
    **more: Any,
) -> Recorded:
    """East at these speeds, side by side 10 m apart."""
    n = len(speeds)
    u = np.zeros((T, n, 3))
    u[..., 0], u[..., 2] = speeds, climb
    start = np.zeros((n, 4))
    start[:, 1] = 10.0 * np.arange(n)
    fields = {name: more.pop(name) for name in ("duration_s", "limits") if name in more}
    s = scenario(rates, **({"plant": plant, "limits": LIMITS} | fields))
    return recorded(s, flown(start, u, rates[2]), u, **more)


# Which steps are known


def test_of_unicycles_recorded_at_every_decision_every_step_is_known() -> None:
    run = arcs()
    paths = PathBounds.of(run)
    assert paths.whole and paths.periods == 5 and paths.run is run
    np.testing.assert_allclose(paths.t, 0.02 * np.arange(5 * (T - 1) + 1))
    for k in range(T - 1):
        state = State(*(run.vehicles[c][k] for c in ("x_m", "y_m", "theta_rad", "z_m")))
        for m in range(5):
            due = step(state, Command.of(run.command[k]), m * 0.02).position
            np.testing.assert_allclose(paths.track[5 * k + m], due, atol=1e-9)
    assert np.array_equal(paths.track[-1], run.position[-1]) and paths.track.shape == (26, N, 3)


def test_vehicles_that_flew_on_are_known_to_the_end_of_that_step() -> None:
    run = arcs(ended="deciding failed: no, at 0.600 s; run stopped")
    assert run.flew_on
    paths = PathBounds.of(run)
    assert paths.whole and len(paths.t) == len(paths.track) == 5 * T + 1
    state = State(*(run.vehicles[c][-1] for c in ("x_m", "y_m", "theta_rad", "z_m")))
    for m in range(6):
        due = step(state, Command.of(run.command[-1]), m * 0.02).position
        np.testing.assert_allclose(paths.track[5 * (T - 1) + m], due, atol=1e-9)


@pytest.mark.parametrize(
    ("rates", "plant", "whole"),
    [
        (EVERY, "unicycle", True),
        (EVERY, "jsbsim", True),
        (EVERY, "lagged", True),
        (DECISIONS, "jsbsim", False),
        (DECISIONS, "lagged", False),
        (THIN, "unicycle", False),
        (THIN, "jsbsim", False),
    ],
)
def test_otherwise_what_is_recorded_is_known_and_no_more(rates: Any, plant: str, whole: bool) -> None:
    run = arcs(rates, plant=plant)
    paths = PathBounds.of(run)
    assert paths.whole is whole and paths.periods == 1
    assert paths.t is run.t and np.array_equal(paths.track, run.position)


def test_aircraft_that_flew_on_are_not_known_to_the_end() -> None:
    end = "deciding failed: no, at 0.120 s; run stopped"
    run = arcs(EVERY, ended=end, plant="jsbsim")
    assert run.flew_on and not PathBounds.of(run).whole
    run = arcs(EVERY, ended=end)
    assert PathBounds.of(run).whole and PathBounds.of(run).periods == 1 and len(PathBounds.of(run).t) == T + 1
    of_ones_own = recorded(
        arcs().scenario, flown(np.zeros((2, 4)), commands(n=2), 0.1), commands(n=2), parts={"plant": {}}
    )
    assert not PathBounds.of(of_ones_own).whole


# How far a path may stray


def test_a_resolved_record_strays_by_what_the_velocity_changes_around() -> None:
    """Half a period of twice the largest change over an interval and its neighbours."""
    run = straight([20.0, 20.0], DECISIONS)
    run.vehicles["v_mps"] = 20.0 + np.array([[0, 0, 3, 3, 2.5, 2.5], [0, 1, 1, 1, 1, 1]], dtype=float).T
    paths = PathBounds.of(run)
    due = np.array([[3, 3, 3, 0.5, 0.5], [1, 1, 0, 0, 0]]).T
    np.testing.assert_allclose(paths.changing, due, atol=1e-12)
    np.testing.assert_allclose(paths.stray, 0.5 * 0.1 * due, atol=1e-12)
    # A change of course or climb is a change of velocity too.
    run = straight([20.0], DECISIONS)
    run.vehicles["theta_rad"] = np.array([[0, 0, 0, 0, 0, np.pi]]).T
    run.vehicles["zeta_mps"] = np.array([[2.0, 0, 0, 0, 0, 0]]).T
    np.testing.assert_allclose(PathBounds.of(run).changing[:, 0], [2, 2, 0, 40, 40], atol=1e-12)


def test_an_unresolved_record_strays_by_what_the_limits_allow() -> None:
    """At 20 m/s of 15 to 25 a vehicle may be 2.5 m ahead of its mean a second, and 1.5 m above it."""
    run = straight([20.0, 15.0, 22.0], THIN)
    lags = [2.5, 0.0, 3.0 * 7.0 / 10.0]
    bends = 25.0 * 0.2 * 0.5**2 / 8
    due = [np.hypot(lag, 1.5) * 0.5 + bends for lag in lags]
    np.testing.assert_allclose(PathBounds.of(run).stray, np.broadcast_to(due, (T - 1, 3)), atol=1e-9)
    # Climbing at the limit it can be no higher.
    run = straight([20.0], THIN, climb=3.0)
    np.testing.assert_allclose(PathBounds.of(run).stray, 2.5 * 0.5 + bends, atol=1e-9)
    # What was recorded beyond the limits may have been flown in between as well.
    for v, omega, due in (
        (30.0, 0.4, np.hypot(10.0 * 5.0 / 15.0, 5.0 * 4.0 / 9.0) * 0.5 + 30.0 * 0.4 * 0.5**2 / 8),
        (30.0, -0.4, np.hypot(10.0 * 5.0 / 15.0, 5.0 * 4.0 / 9.0) * 0.5 + 30.0 * 0.4 * 0.5**2 / 8),
        (12.0, 0.4, np.hypot(5.0 * 8.0 / 13.0, 5.0 * 4.0 / 9.0) * 0.5 + 25.0 * 0.4 * 0.5**2 / 8),
    ):
        run = straight([20.0], THIN)
        run.vehicles["v_mps"] = np.array([[20.0, 20, v, 20, 20, 20]]).T
        run.vehicles["omega_radps"] = np.array([[0.0, 0, 0, 0, omega, 0]]).T
        run.vehicles["zeta_mps"] = np.linspace(-4.0, 5.0, T)[:, None]
        np.testing.assert_allclose(PathBounds.of(run).stray, due, atol=1e-9)


def test_of_vehicles_that_differ_the_widest_limits_count() -> None:
    own = [{"limits": {"v_max_mps": 35.0}}, {"limits": {"v_min_mps": 10.0, "zeta_max_mps": 4.0}}]
    run = straight([20.0, 20.0], THIN)
    run.scenario["vehicle"] = own
    due = np.hypot(15.0 * 10.0 / 25.0, 2.0) * 0.5 + 35.0 * 0.2 * 0.5**2 / 8
    np.testing.assert_allclose(PathBounds.of(run).stray, due, atol=1e-9)


def test_a_vehicle_that_cannot_change_its_speed_or_climb_strays_by_its_turns() -> None:
    limits = LIMITS | {"v_min_mps": 20.0, "v_max_mps": 20.0, "zeta_max_mps": 0.0}
    run = straight([20.0], THIN, limits=limits)
    np.testing.assert_allclose(PathBounds.of(run).stray, 20.0 * 0.2 * 0.5**2 / 8, atol=1e-9)


def test_a_vehicle_with_little_room_strays_little_and_one_beyond_its_limits_by_its_climb() -> None:
    """Half way between 20 and 20.5 m/s it may be 0.125 m ahead a second."""
    limits = LIMITS | {"v_min_mps": 20.0, "v_max_mps": 20.5, "omega_max_degps": 0.0}
    run = straight([20.25], THIN, limits=limits)
    np.testing.assert_allclose(PathBounds.of(run).stray, np.hypot(0.125, 1.5) * 0.5, atol=1e-9)
    # Positions that were passed quicker, or slower, than any speed recorded leave no room at all.
    for pace in (30.0, 10.0):
        run = straight([20.25], THIN, limits=limits)
        run.vehicles["x_m"] = pace * run.t[:, None]
        np.testing.assert_allclose(PathBounds.of(run).stray, 1.5 * 0.5, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_a_flight_within_the_limits_stays_within_what_it_may_stray(seed: int) -> None:
    """Ten random commands between two recorded instants, at the limits as often as not."""
    rng = np.random.default_rng(seed)
    u = np.clip(rng.normal([20, 0, 0], [10, 0.4, 6], (41, 2, 3)), [15, -0.2, -3], [25, 0.2, 3])
    fine = flown(rng.normal(0, 20, (2, 4)), np.repeat(u, 10, axis=0), 0.005)
    states = fine[::100]
    rates = np.repeat(u, 10, axis=0)[::100]
    s = scenario((0.005, 0.05, 0.5), limits=LIMITS)
    paths = PathBounds.of(recorded(s, states, rates))
    position = fine[..., [0, 1, 3]]
    for k in range(len(states) - 1):
        share = np.linspace(0, 1, 101)[:, None, None]
        chord = (1 - share) * position[100 * k] + share * position[100 * k + 100]
        off = np.linalg.norm(position[100 * k : 100 * k + 101] - chord, axis=-1).max(axis=0)
        assert np.all(off <= paths.stray[k] + 1e-9)


@pytest.mark.parametrize(
    ("plant", "rates", "parts", "due"),
    [
        ("jsbsim", (0.02, 0.1, 0.1), {}, True),
        ("jsbsim", (0.02, 0.05, 0.1), {}, True),
        ("jsbsim", (0.02, 0.11, 0.11), {}, False),
        ("jsbsim", (0.02, 0.1, 0.1), {"plant": {}}, False),
        ("jsbsim", (0.02, 0.1, 0.1), {"filter": {}}, True),
        ("lagged", (0.02, 0.1, 0.1), {}, True),
        ("lagged", (0.02, 0.05, 0.1), {}, False),
        ("lagged", (0.02, 0.2, 0.2), {}, False),
        ("unicycle", (0.02, 0.1, 0.1), {}, False),
    ],
)
def test_a_record_resolves_the_motion_of_what_answers_slowly(
    plant: str, rates: Any, parts: Any, due: bool
) -> None:
    u = commands(n=2)
    s = scenario(rates, plant=plant)
    assert resolved(recorded(s, flown(np.zeros((2, 4)), u, 0.1), u, parts=parts)) is due


# After the last row


def test_the_tail_is_what_the_fastest_may_have_flown_since_the_last_row() -> None:
    """The last of six rows, 0.5 s apart, is at 2.5 s; the run goes on to 4 s at 25 m/s and 3 m/s of climb."""
    assert PathBounds.of(straight([20.0], THIN, duration_s=4.0)).tail == pytest.approx(1.5 * np.hypot(25, 3))
    assert PathBounds.of(straight([20.0], THIN, duration_s=2.5)).tail == 0.0
    assert PathBounds.of(straight([20.0], THIN, duration_s=2.0)).tail == 0.0
    fast = PathBounds.of(straight([40.0, 20.0], THIN, duration_s=4.0, climb=3.0))
    assert fast.tail == pytest.approx(1.5 * np.hypot(np.hypot(40, 3), 3))
    ended = PathBounds.of(straight([20.0], THIN, duration_s=4.0, ended=STOPPED))
    assert ended.tail == pytest.approx(0.5 * np.hypot(25, 3))
    almost = straight([20.0], THIN, duration_s=2.5 + 5e-10)
    assert PathBounds.of(almost).tail == 0.0
    shortly = straight([20.0], THIN, duration_s=2.5 + 1e-6)
    assert PathBounds.of(shortly).tail == pytest.approx(1e-6 * np.hypot(25, 3), rel=1e-6)


# Pairs


def test_distances_and_ways_of_pairs_are_those_of_straight_lines() -> None:
    """The second overtakes the first by 2 m a row, from 5 m behind it to 5 m ahead, 10 m aside."""
    run = straight([20.0, 24.0, 20.0], THIN)
    run.vehicles["x_m"] = run.vehicles["x_m"] - np.array([0.0, 5.0, 0.0])
    paths = PathBounds.of(run)
    along = -5.0 + 2.0 * np.arange(T)
    apart = paths.apart()
    assert apart.shape == (T, 3, 3)
    np.testing.assert_allclose(
        apart[:, 0], np.stack([-along, np.full(T, -10.0), np.zeros(T)], axis=-1), atol=1e-9
    )
    np.testing.assert_allclose(paths.distance()[:, 0], np.hypot(along, 10.0))
    np.testing.assert_allclose(paths.distance()[:, 1], 20.0)
    ways = paths.ways()
    assert ways.shape == (T - 1, 3)
    np.testing.assert_allclose(
        ways[:, 0], [np.hypot(3, 10), np.hypot(1, 10), 10.0, np.hypot(1, 10), np.hypot(3, 10)]
    )
    np.testing.assert_allclose(ways[:, 1], 20.0)
    # to any other points
    np.testing.assert_allclose(paths.chords(np.zeros((4, 2, 3))), np.zeros((3, 2)))
    to = np.array([[[3.0, -4.0, 1.0]], [[3.0, 4.0, 1.0]], [[3.0, 4.0, 1.0]], [[9.0, 12.0, 1.0]]])
    slow = np.array([[[-0.25, 1.0, 0.0]], [[0.25, 1.0, 0.0]]])
    np.testing.assert_allclose(paths.chords(slow), [[1.0]])
    np.testing.assert_allclose(paths.chords(to)[:, 0], [np.hypot(3, 1), np.hypot(5, 1), np.hypot(5, 1)])


def test_a_passing_is_within_half_a_step_of_a_step() -> None:
    """A pair that closes at 4 m/s moves 8 cm in a step of 20 ms: the nearest step is within half of that."""
    run = straight([20.0, 24.0], THIN)
    run.vehicles["x_m"] = run.vehicles["x_m"] - np.array([0.0, 5.0])
    paths = PathBounds.of(run)
    stray = paths.stray.sum(axis=1)
    assert paths.passing().shape == (T - 1, 1)
    np.testing.assert_allclose(paths.passing()[:, 0], np.hypot(paths.ways()[:, 0] + stray, 0.5 * 0.02 * 4.0))


def test_who_has_left_is_nobody_any_more() -> None:
    run = straight([20.0, 20.0, 20.0], THIN, left_s=np.array([np.inf, 1.0, np.inf]))
    paths = PathBounds.of(run)
    gone = np.array([False, False, True, True, True, True])
    # at the instant of leaving it was still there
    assert np.array_equal(paths.gone_at(False)[:, 1], [False, False, False, True, True, True])
    assert np.array_equal(paths.gone_at(True)[:, 1], gone[:-1]) and not paths.gone_at(True)[:, [0, 2]].any()
    distance, ways, passing = paths.distance(), paths.ways(), paths.passing()
    assert np.array_equal(np.isinf(distance[:, 0]), [False, False, False, True, True, True])
    assert (
        np.array_equal(np.isinf(distance[:, 2]), np.isinf(distance[:, 0]))
        and np.isfinite(distance[:, 1]).all()
    )
    assert np.array_equal(np.isinf(ways[:, 0]), gone[:-1]) and np.array_equal(np.isinf(ways[:, 2]), gone[:-1])
    assert (
        np.isfinite(ways[:, 1]).all()
        and np.allclose(distance[:3, 0], 10.0)
        and np.allclose(ways[:2, 0], 10.0)
    )
    # one may have left before they passed
    assert np.array_equal(np.isinf(passing[:, 0]), gone[1:]) and np.isfinite(passing[:, 1]).all()
    nobody = PathBounds.of(straight([20.0, 20.0], THIN))
    assert nobody.gone_at(False) is None and nobody.gone_at(True) is None
    assert ROUNDING == 1e-6
