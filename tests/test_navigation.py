"""The navigation-function baseline: it seeks its goal, gives way, and stays inside the limits."""

import re
from dataclasses import fields

import numpy as np
import pytest

from filters.model import Command, Limits, State, View, step
from filters.qp.single import Status
from filters.rivals.navigation import NavigationFilter, fade

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


def test_alone_only_the_goal_holds_a_vehicle():
    """What a navigation function is for: the slope is nowhere zero and leads nearer to the goal."""
    x, y = (q.ravel() for q in np.meshgrid(np.linspace(-900, 900, 15), np.linspace(-880, 920, 15)))
    goal = np.tile([200.0, 0.0], (x.size, 1))
    state, nobody = State(x, y, 0 * x, 0 * x), np.zeros(x.size, dtype=bool)
    downhill = -NavigationFilter(goal, -goal).gradient(View(state, view_of(state).rates, known=nobody))
    ahead = (200.0 - x) - 1j * y
    assert (np.abs(downhill) > 0).all() and ((downhill * np.conj(ahead)).real > 0).all()


def test_behind_another_vehicle_on_its_way_the_swirl_leads_it_off_the_saddle():
    """Without it the slope in line with the other and the goal has no side: there is the saddle."""
    state = State([-12.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    goal, start = [[200.0, 0.0], [0.0, 200.0]], [[-200.0, 0.0], [0.0, -200.0]]
    sides = [
        NavigationFilter(goal, start, vehicle_margin=40.0, swirl=swirl).gradient(view_of(state))[0]
        for swirl in (1e-12, 0.08)
    ]
    assert abs(np.sin(np.angle(sides[0]))) < 1e-9 < 0.05 < abs(np.sin(np.angle(sides[1])))


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


def test_the_fade_is_two_parabolas_with_a_jump_between_them():
    r = np.array([-1.0, 0.0, 0.25, 0.5, 0.75, 1.0, 2.0])
    np.testing.assert_array_equal(fade(r), [0.0, 0.0, 0.0625, 0.75, 0.9375, 1.0, 1.0])


NEAR = {
    "path_radius": 50.0, "path_gain": 3.0, "exponent": 0.7, "swirl": 0.3, "vehicle_radius": 4.0,
    "vehicle_margin": 80.0, "disc_radius": 150.0, "disc_margin": 60.0, "sensing_range": 120.0, "step": 0.4,
}  # fmt: skip


def potential(place, vehicle, seen, goal, start, p):
    """V of one vehicle at `place`, by the formulas of the class, one vehicle at a time."""
    left, line = abs(place - goal[vehicle]), goal[vehicle] - start[vehicle]
    offset = ((place - start[vehicle]) * np.conj(line) / abs(line)).imag
    gamma = left**2 + p["path_gain"] * float(fade(np.array(left / p["path_radius"]))) * offset**2
    beta = 1.0
    for other in seen:
        beta *= float(fade(np.array((abs(place - other) - p["vehicle_radius"]) / p["vehicle_margin"])))
        beta *= float(fade(np.array((p["disc_radius"] - abs(place)) / p["disc_margin"])))
    return gamma / (gamma ** p["exponent"] + beta) ** (1 / p["exponent"])


@pytest.mark.parametrize("seed", range(6))
def test_the_gradient_is_that_of_the_potential_plus_the_swirl_of_every_vehicle_sensed(seed):
    rng, n, p = np.random.default_rng(seed), 4, NEAR
    place, goal, start = (rng.uniform(-70, 70, (n, 2)) @ [1, 1j] for _ in range(3))
    height = np.array([0.0, 10.0, 300.0, 310.0])  # two by two, out of each other's range
    state = State(place.real, place.imag, rng.uniform(-3, 3, n), height)
    steer = NavigationFilter(*(np.stack([q.real, q.imag], axis=-1) for q in (goal, start)), **p)
    found = steer.gradient(view_of(state))
    for k in range(n):
        apart = np.hypot(abs(place - place[k]), height - height[k])
        sensed = [m for m in range(n) if m != k and apart[m] <= p["sensing_range"]]
        assert set(sensed) <= {k ^ 1}
        east, west, north, south = (
            potential(place[k] + d * p["step"], k, place[sensed], goal, start, p) for d in (1, -1, 1j, -1j)
        )
        slope = (east - west + 1j * (north - south)) / (2 * p["step"])
        swirl = 0.0
        for m in sensed:
            # a unit vector square to the line of sight, weaker with distance
            away = place[k] - place[m]
            share = float(fade(np.array(1 - abs(away) / p["sensing_range"])))
            swirl += share * -1j * away / abs(away)
        assert found[k] == pytest.approx(slope - p["swirl"] * abs(slope) * swirl, rel=1e-9)


def test_a_vehicle_on_the_edge_of_the_sensing_range_is_seen():
    state = State([0.0, 300.0], [0.0, 0.0], [0.0, np.pi], [0.0, 400.0])
    points = [[600.0, 0.0], [-200.0, 0.0]], [[-10.0, 1.0], [410.0, 1.0]]
    for seen_from, alike in ((500.0, False), (499.0, True)):
        near = NavigationFilter(*points, sensing_range=seen_from)
        far = NavigationFilter(*points, sensing_range=1.0)
        assert np.array_equal(near.gradient(view_of(state)), far.gradient(view_of(state))) == alike


def test_the_decision_carries_no_qp_and_no_pairs_and_is_clipped_to_the_limits():
    state, nominal = State([0.0], [0.0], [0.5], [0.0]), Command([20.0], 0.0, 9.0)
    steer = NavigationFilter([[200, 0, 7]], [[-200, 0, 3]], speed=40.0, gain=100.0)
    made = steer(view_of(state), nominal, LIMITS)
    np.testing.assert_array_equal(made.command.array(), [[25.0, -np.deg2rad(13), 3.9]])
    assert made.status.tolist() == [Status.NONE] and made.residual.tolist() == [0.0]
    assert made.pairs is None and made.hdot_predicted.shape == (0,)
    # of three columns the height is not used
    flat = NavigationFilter([[200, 0]], [[-200, 0]], speed=40.0, gain=100.0)
    np.testing.assert_array_equal(flat.goal, steer.goal)


def test_the_defaults_are_the_settings_of_the_published_run():
    steer = NavigationFilter([[0.0, 0.0]], [[1.0, 0.0]])
    settings = {f.name: getattr(steer, f.name) for f in fields(steer) if f.name not in ("goal", "start")}
    assert settings == {
        "speed": 20.0, "gain": 0.6, "path_radius": 20.0, "path_gain": 20.0, "exponent": 0.2, "swirl": 0.08,
        "vehicle_radius": 0.0, "vehicle_margin": 5.0, "disc_radius": 2000.0, "disc_margin": 5.0,
        "sensing_range": 400.0, "step": 1.0,
    }  # fmt: skip


POSITIVE = ("speed", "path_radius", "exponent", "vehicle_margin", "disc_margin", "sensing_range", "step")


@pytest.mark.parametrize("name", POSITIVE)
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_a_length_that_divides_must_be_positive_and_is_named(name, value):
    with pytest.raises(ValueError, match=f"^{name} must be positive and finite, got {value}"):
        NavigationFilter([[0.0, 0.0]], [[1.0, 0.0]], **{name: value})


@pytest.mark.parametrize("points", [[0.0, 0.0], [[0.0]], [[0.0] * 4], [[0.0, np.inf]]])
def test_points_that_are_none_are_refused_by_name_and_shape(points):
    good = [[0.0, 0.0]]
    for name, given in (("goal", (points, good)), ("start", (good, points))):
        shape = re.escape(str(np.shape(points)))
        with pytest.raises(ValueError, match=rf"^{name} must be finite points .* got shape {shape}"):
            NavigationFilter(*given)


def test_at_the_goal_where_nothing_is_downhill_the_course_is_held():
    steer = NavigationFilter([[200.0, 0.0]], [[-200.0, 0.0]])
    made = steer(view_of(State([200.0], [0.0], [0.5], [0.0])), Command([20.0], 0.1, 0.0), LIMITS)
    np.testing.assert_array_equal(made.command.array(), [[20.0, 0.0, 0.0]])


def test_goals_and_starts_must_match_and_be_finite():
    with pytest.raises(ValueError, match="1 goals do not match 2 starts"):
        NavigationFilter([[0.0, 0.0]], [[1.0, 0.0], [2.0, 0.0]])
    with pytest.raises(ValueError, match="goal must be finite"):
        NavigationFilter([[np.nan, 0.0]], [[1.0, 0.0]])
    with pytest.raises(ValueError, match="step must be positive"):
        NavigationFilter([[0.0, 0.0]], [[1.0, 0.0]], step=0.0)
    with pytest.raises(ValueError, match="1 goals do not fit 2 vehicles"):
        NavigationFilter([[0.0, 0.0]], [[1.0, 0.0]])(
            view_of(State([0.0, 9.0], [0.0] * 2, [0.0] * 2, [0.0] * 2)), Command([20.0] * 2, 0.0, 0.0), LIMITS
        )
