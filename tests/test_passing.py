"""How near pairs came between steps: closed forms of arcs and of constant accelerations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from testbed.verification.passing import BETWEEN_M, START_M, Passing
from testbed.verification.path_bounds import PathBounds
from testbed.verification.recorded import Recorded
from tests.hand_made_runs import flown, recorded, scenario

DECISIONS, EVERY = (0.02, 0.1, 0.1), (0.02, 0.02, 0.02)
INF = np.inf


def of(run: Recorded, d_safe: float = 5.0) -> Passing:
    return Passing.of(run, PathBounds.of(run), d_safe)


def arcs(start: Any, u: Any, steps: int = 6, ended: str | None = None, rates: Any = DECISIONS) -> Recorded:
    """Unicycles that fly constant commands (N, 3) from `start` (N, 4)."""
    command = np.broadcast_to(np.asarray(u, dtype=float), (steps, len(u), 3))
    return recorded(scenario(rates), flown(start, command, rates[2]), command, ended=ended)


HEAD_ON = [[-7.0, 0.0, 0.0, 0.0], [7.0, 3.0, np.pi, 0.0], [200.0, 90.0, 0.0, 0.0]]
FAST = [[20.0, 0.0, 0.0]] * 3


def test_unicycles_that_pass_between_steps_are_found_where_they_pass() -> None:
    """At 40 m/s they pass 3 m aside at 0.35 s, between the steps at 0.34 and 0.36 s."""
    found = of(arcs(HEAD_ON, FAST))
    assert found.least == pytest.approx(3.0, abs=1e-6) and found.radius == 0.0 and found.d_safe == 5.0
    assert found.vehicles == [1, 2] and (found.begin, found.end) == pytest.approx((0.3, 0.4))
    # Between the points that are looked at first.
    early = arcs([[-7.013, 0.0, 0.0, 0.0], *HEAD_ON[1:]], FAST)
    assert of(early).least == pytest.approx(3.0, abs=1e-9)
    first = arcs([[-5.002, 0.0, 0.0, 0.0], *HEAD_ON[1:]], FAST)  # at 0.30005 s, just after a decision
    assert of(first).least == pytest.approx(3.0, abs=1e-9)
    late = arcs([[-6.987, 0.0, 0.0, 0.0], *HEAD_ON[1:]], FAST)
    assert of(late).least == pytest.approx(3.0, abs=1e-9)
    third = arcs([HEAD_ON[2], *HEAD_ON[:2]], FAST)
    assert of(third).vehicles == [2, 3] and of(third).least == pytest.approx(3.0, abs=1e-6)


def test_arcs_that_curve_between_steps_are_followed() -> None:
    """In formation on a circle two vehicles stay 4 m apart; chords of one that turns alone cut its arc."""
    around = arcs([[0.0, 0.0, 0.0, 0.0], [0.0, 4.0, 0.0, 0.0]], [[20.0, 1.0, 0.0]] * 2)
    assert of(around).least == pytest.approx(4.0, abs=1e-9)
    # One stands still (nearly), the other turns around it at 2 m: 4 m/s at 2 rad/s.
    circle = arcs(
        [[0.0, 0.0, 0.0, 0.0], [0.0, -2.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [4.0, 2.0, 0.0]],
        rates=(0.25, 0.5, 0.5),
    )
    assert of(circle).least == pytest.approx(2.0, abs=1e-9)
    # A climb through another's height.
    above = arcs([[0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -1.05]], [[20.0, 0.0, 0.0], [20.0, 0.0, 3.0]])
    assert of(above).least == pytest.approx(1.0, abs=1e-6)


def test_far_from_ds_a_bound_below_the_chords_is_enough() -> None:
    """50 m apart, turning at 0.5 rad/s: the arcs leave chords of 20 ms by v omega T^2 / 8 each."""
    side = arcs([[0.0, 0.0, 0.0, 0.0], [0.0, 50.0, 0.0, 0.0]], [[20.0, 0.5, 0.0]] * 2)
    found = of(side)
    assert found.least == pytest.approx(50.0 - 2 * 20 * 0.5 * 0.02**2 / 8, abs=1e-12)
    assert found.radius == 0.0 and (found.begin, found.end) == (0.0, 0.1)
    # One that turns far away takes nothing from two that fly straight.
    start = [[0.0, 0.0, 0.0, 0.0], [0.0, 50.0, 0.0, 0.0], [0.0, 150.0, 0.0, 0.0]]
    third = arcs(start, [[20.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 1.0, 0.0]])
    assert of(third).least == pytest.approx(50.0, abs=1e-12)
    near = of(side, 60.0)
    assert near.least == pytest.approx(50.0, abs=1e-9)


def test_of_several_near_passings_the_nearest_counts() -> None:
    start = [[-7.0, 0.0, 0.0, 0.0], [7.0, 3.0, np.pi, 0.0], [-15.0, -2.0, 0.0, 0.0], [-1.0, -3.5, np.pi, 0.0]]
    found = of(arcs(start, [[20.0, 0.0, 0.0]] * 4, steps=8))
    # 3 and 4 pass 1.5 m aside; 2 meets 3 later, 5 m aside, and 1 meets 4 3.5 m aside.
    assert found.vehicles == [3, 4] and found.least == pytest.approx(1.5, abs=1e-6)
    assert found.begin <= 0.35 <= found.end


def test_a_run_whose_vehicles_flew_on_has_the_last_period_too() -> None:
    stops = "deciding failed: no, at 0.400 s; run stopped"
    short = arcs(HEAD_ON, FAST, steps=4)
    assert of(short).least == pytest.approx(np.hypot(2.0, 3.0), abs=1e-9)
    flew_on = arcs(HEAD_ON, FAST, steps=4, ended=stops)
    assert flew_on.flew_on and of(flew_on).least == pytest.approx(3.0, abs=1e-6)
    assert (of(flew_on).begin, of(flew_on).end) == pytest.approx((0.3, 0.4))


def test_a_single_instant_has_no_passing() -> None:
    found = of(arcs(HEAD_ON[:2], FAST[:2], steps=1))
    assert (found.least, found.radius, found.vehicles) == (np.hypot(14, 3), None, [])
    assert (found.begin, found.end, found.d_safe) == (0.0, 0.0, 5.0)
    nobody = of(arcs(HEAD_ON[:1], FAST[:1], steps=1))
    assert nobody.least == INF


# Others than unicycles


def accelerating(a: list[float], rates: Any = EVERY, steps: int = 7, apart: float = 20.0) -> Recorded:
    """East from rest side by side, at these accelerations [m/s^2]."""
    t = rates[2] * np.arange(steps)
    states = np.zeros((steps, len(a), 4))
    states[..., 0] = 0.5 * np.array(a) * t[:, None] ** 2
    states[..., 1] = apart * np.arange(len(a)) ** 2
    speeds = np.zeros((steps, len(a), 3))
    return recorded(scenario(rates, plant="jsbsim"), states, speeds)


def test_where_every_step_is_recorded_paths_bend_by_twice_the_acceleration_seen() -> None:
    """2 a T^2 / 8 of each of a pair; the first two are 20 m apart, and the nearest."""
    a, dt = [100.0, 200.0, 600.0], 0.02
    found = of(accelerating(a))
    bends = 2 * (a[0] + a[1]) * dt**2 / 8
    assert found.least == pytest.approx(20.0 + bends) and found.radius == pytest.approx(2 * bends)
    assert found.vehicles == [1, 2] and found.d_safe == 5.0
    # They never come nearer than at the start: that chord's end is the first step.
    assert found.begin < dt < found.end and found.end - found.begin == pytest.approx(2e-6)


def test_the_nearest_pair_is_named_with_the_step_after_its_passing() -> None:
    """The last two, on the fourth way; the pair that bends least is another, and so is the first."""
    run = accelerating([0.0, 0.0, 0.0, 600.0, 600.0])
    run.vehicles["y_m"] = np.broadcast_to(np.array([0.0, 60.0, 130.0, 300.0, 315.0]), (7, 5))
    run.vehicles["z_m"] = np.zeros((7, 5))
    run.vehicles["z_m"][:, 4] = 9.0 - 2.5 * np.arange(7)
    found = of(run)
    assert found.vehicles == [4, 5]
    assert found.begin < 0.08 < found.end and found.least == pytest.approx(15.0 + 2 * 1200.0 * 0.02**2 / 8)


def test_what_may_be_and_what_must_be_can_be_of_two_pairs() -> None:
    """The first pair is 20 m apart and hardly bends; the second 20.5 m, and bends by more than that."""
    run = accelerating([0.0, 0.0, 20000.0, 20000.0])
    run.vehicles["y_m"] = np.broadcast_to(np.array([0.0, 20.0, 100.0, 120.5]), (7, 4))
    found, bends = of(run), 2 * 40000.0 * 0.02**2 / 8
    assert found.least == pytest.approx(20.0) and found.vehicles == [1, 2]
    assert found.least - found.radius == pytest.approx(20.5 - bends)


def test_kinks_at_the_ends_of_filter_periods_bend_no_path_between_steps() -> None:

    def jumps(at: int, rates: Any) -> Passing:
        """It goes on at 5 m a step from this step on."""
        run = accelerating([0.0, 0.0], rates)
        x = 5.0 * np.maximum(np.arange(7.0) - at, 0.0)
        run.vehicles["x_m"] = np.stack([x, np.zeros(7)], axis=-1)
        return of(run)

    # Three steps a period: the ends of periods are steps 3 and 6.
    assert jumps(3, (0.02, 0.06, 0.02)).radius == 0.0
    for at in (1, 2, 4, 5):
        assert jumps(at, (0.02, 0.06, 0.02)).radius == pytest.approx(2 * 5.0 / 4), at
    for at, radius in ((2, 0.0), (4, 0.0), (3, 2.5)):
        assert jumps(at, (0.02, 0.04, 0.02)).radius == pytest.approx(radius), at
    assert jumps(3, EVERY).radius == pytest.approx(2 * 5.0 / 4)


@pytest.mark.parametrize("vehicles", [2, 4])
def test_two_steps_show_no_bend(vehicles: int) -> None:
    found = of(accelerating([1.0] * vehicles, steps=2))
    assert (found.least, found.radius, found.vehicles) == (INF, INF, [1, 2])


def test_a_thin_record_gives_the_chords_and_no_radius() -> None:
    thin = accelerating([0.0, 0.0], (0.02, 0.1, 0.1))
    found = of(thin)
    assert (found.least, found.radius, found.vehicles, found.begin, found.end) == (20.0, None, [], 0.0, 0.0)
    assert found.d_safe == 5.0


# What a run may say


def passing(least: float, radius: float | None, d_safe: float = 5.0) -> Passing:
    return Passing(least, radius, d_safe, [1, 2], 0.0, 1.0)


def test_without_a_radius_a_bound_is_at_most_the_value() -> None:
    unknown = passing(3.0, None)
    for possible, value, fine in ((2.0, 3.0, True), (3.0, 3.0, True), (3.0 + 9e-7, 3.0, True),
                                  (3.0 + 2e-6, 3.0, False), (-INF, 3.0, True)):  # fmt: skip
        assert unknown.allows(possible, value) is fine
    assert str(unknown) == "a bound below the value"


def test_of_what_is_known_a_bound_is_tight_below_ds() -> None:
    known = passing(3.0, 0.0)
    for possible, fine in ((3.0, True), (3.0 + 9e-7, True), (3.0 - 9e-7, True), (3.0 + 2e-6, False),
                           (3.0 - 2e-6, False)):  # fmt: skip
        assert known.allows(possible, 9.0) is fine, possible
    far = passing(30.0, 0.0)
    for possible, fine in ((5.0, True), (5.0 - 9e-7, True), (5.0 - 2e-6, False), (17.0, True), (30.0, True),
                           (30.0 + 9e-7, True), (30.0 + 2e-6, False)):  # fmt: skip
        assert far.allows(possible, 9.0) is fine, possible
    assert str(known) == "3, or Ds at least" and BETWEEN_M == 1e-9


def test_of_bends_unknown_there_is_no_bound() -> None:
    assert passing(3.0, INF).allows(-INF, 3.0) and not passing(3.0, INF).allows(2.0, 3.0)
    assert not passing(3.0, INF).allows(INF, 3.0)


def test_of_bends_known_the_bound_is_that_or_a_little_lower() -> None:
    """A run bends its first path from where the start was asked for, at most START_M lower."""
    bent = passing(4.0, 0.5)
    assert START_M == 1e-4
    for possible, fine in ((3.5, True), (3.5 + 9e-7, True), (3.5 + 2e-6, False), (3.5 - 0.9e-4, True),
                           (3.5 - 1.2e-4, False)):  # fmt: skip
        assert bent.allows(possible, 9.0) is fine, possible
    # The value itself is a bound of what may be.
    assert bent.allows(3.0, 3.0) and not bent.allows(3.5, 3.0) and not bent.allows(2.9, 3.0)
    assert str(bent) == "3.5"
