"""Remedies on the filter: margins on rows, predicted poses, the air's frame, each against a known answer."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.kinematic import KinematicFleet, Lag
from filters.barriers.class_k import cubic, linear
from filters.barriers.closed_form import TurnBarrier
from filters.cbf.collision import CollisionFilter, Passthrough
from filters.cbf.constraints import manoeuvres, own_rows, pair_rows, shares
from filters.model import Command, Limits, State, View, step
from filters.qp.single import Status
from filters.wrappers.air_mass import AirMass
from filters.wrappers.pose_prediction import Horizon, LaggedPose, Predicted
from filters.wrappers.row_margins import BoundedError, InputToState, Sum

OMEGA_MAX = np.deg2rad(13)
LIMITS = Limits(15.0, 25.0, OMEGA_MAX, 3.9)
TURN = TurnBarrier(16.0, 0.9 * OMEGA_MAX, 5.0, smoothing=30.0)
GAMMA = TURN.manoeuvre(2)
ALPHA = cubic(0.1)
MODES = ("centralised", "limited")
BOUNDS = BoundedError(v=0.5, omega=np.deg2rad(1.0), zeta=0.2)


def rows_of(state):
    """The rows of all pairs."""
    return pair_rows(TURN.values(state), state, ALPHA)


def own_of(rows, n):
    """Every vehicle's share of them."""
    return own_rows([rows], [shares(rows, manoeuvres(TURN, rows, n, TURN.manoeuvre(n).array()))])


def rng_of(seed):
    return np.random.default_rng(seed)


def random_state(rng, n=2, radius=60.0):
    return State(*rng.uniform(-radius, radius, (2, n)), rng.uniform(-np.pi, np.pi, n), rng.uniform(-5, 5, n))


def random_rates(rng, n=2):
    return Command(rng.uniform(15, 25, n), rng.uniform(-0.22, 0.22, n), rng.uniform(-3, 3, n))


def pose_error(a, b):
    """Largest difference of two states [m, rad], courses modulo a turn."""
    d = a.array() - b.array()
    d[..., 2] = np.angle(np.exp(1j * d[..., 2]))
    return np.max(np.abs(d))


@dataclass
class Seen:
    """A filter that keeps what it was asked and passes everything."""

    views: list
    nominals: list
    limits: list = field(default_factory=list)

    def __call__(self, view, nominal, limits):
        self.views.append(view)
        self.nominals.append(nominal)
        self.limits.append(limits)
        return Passthrough()(view, nominal, limits)


# --- margins on rows -------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(2, 4))
def test_bounded_errors_cannot_break_the_barrier_condition(mode, seed, n):
    rng = rng_of(seed)
    state = random_state(rng, n, 40.0 * np.sqrt(n))
    nominal = random_rates(rng, n)
    made = CollisionFilter(TURN, ALPHA, mode, margin=BOUNDS)(View(state, nominal), nominal, LIMITS)
    rows = rows_of(state)
    solved = made.status == Status.SOLVED
    both = solved[rows.vehicles[0]] & solved[rows.vehicles[1]]
    worst = np.array([BOUNDS.v, BOUNDS.omega, BOUNDS.zeta])
    for corner in rng.choice([-1.0, 1.0], (64, n, 3)):
        hdot = rows.left(made.command.array() + corner * worst)
        assert np.all((hdot - rows.rhs)[both] >= -1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_the_bounded_margin_is_the_smallest_that_does_it(mode):
    # Head-on and close: the row is active, and some corner of the box of errors uses the whole margin.
    state = State([-25.0, 25.0], [0.5, -0.5], [0.0, np.pi], [0.0, 0.0])
    nominal = Command([25.0, 25.0], 0.0, 0.0)
    made = CollisionFilter(TURN, ALPHA, mode, margin=BOUNDS)(View(state, nominal), nominal, LIMITS)
    assert np.all(made.status == Status.SOLVED) and np.all(made.override)
    rows = rows_of(state)
    worst = np.array([BOUNDS.v, BOUNDS.omega, BOUNDS.zeta])
    left = min(
        rows.left(made.command.array() + np.reshape(signs, (2, 3)) * worst)[0] - rows.rhs[0]
        for signs in product((-1.0, 1.0), repeat=6)
    )
    assert left == pytest.approx(0.0, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_a_margin_is_split_by_sides_and_limited_rows_still_add_up(seed):
    rows = rows_of(random_state(rng_of(seed), 4))
    own = own_of(rows, 4).raised(BOUNDS)
    i, j = np.split(own.rhs, 2)
    np.testing.assert_allclose(i + j, rows.raised(BOUNDS).rhs, rtol=1e-12, atol=1e-9)
    plain_i, _ = np.split(own_of(rows, 4).rhs, 2)
    np.testing.assert_allclose(i - plain_i, BOUNDS(rows.lie[0]), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("margin", [None, BOUNDS], ids=["none", "bounds"])
def test_vehicles_that_see_the_same_each_for_itself_do_what_they_do_in_one_world(margin):
    altered = 0
    for seed in range(8):
        rng, n = rng_of(seed), 4
        state, nominal = random_state(rng, n, 80.0), random_rates(rng, n)
        worlds = [np.tile(x.array(), (n, 1, 1)) for x in (state, nominal)]
        filter_ = CollisionFilter(TURN, ALPHA, "limited", margin=margin)
        alone = filter_(View(State.of(worlds[0]), Command.of(worlds[1])), nominal, LIMITS)
        together = filter_(View(state, nominal), nominal, LIMITS)
        np.testing.assert_array_equal(alone.status, together.status)
        np.testing.assert_allclose(alone.command.array(), together.command.array(), atol=1e-7)
        altered += together.override.sum()
    assert altered > 5


def test_the_input_to_state_margin_is_the_weighted_square_over_epsilon():
    lie = np.array([[1.0, 100.0, -2.0], [0.0, 0.0, 0.0]])
    margin = InputToState(epsilon=4.0, v=2.0, omega=0.05, zeta=0.5)
    np.testing.assert_allclose(margin(lie), [(2.0**2 + 5.0**2 + 1.0**2) / 4.0, 0.0])


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**31), size=st.floats(0.0, 10.0))
def test_an_error_of_any_size_costs_the_input_to_state_rows_at_most_its_square(seed, size):
    rng = rng_of(seed)
    margin = InputToState(epsilon=0.7, v=1.5, omega=0.04, zeta=0.3)
    lie = rng.normal(size=(1, 3)) * [1.0, 200.0, 1.0]
    direction = rng.normal(size=3)
    e = size * direction / np.linalg.norm(direction)
    lost = -(lie @ (np.array([1.5, 0.04, 0.3]) * e))
    assert (lost - margin(lie))[0] <= 0.7 * size**2 / 4 + 1e-9


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("margin", [BoundedError(), InputToState(1.0, 0.0, 0.0, 0.0), Sum(())])
def test_margins_of_nothing_change_nothing(mode, margin):
    for seed in range(20):
        rng = rng_of(seed)
        state, nominal = random_state(rng, 4), random_rates(rng, 4)
        plain, raised = (
            CollisionFilter(TURN, ALPHA, mode, margin=m)(View(state, nominal), nominal, LIMITS)
            for m in (None, margin)
        )
        for name in ("status", "residual", "override", "deviation", "hdot_predicted"):
            np.testing.assert_array_equal(getattr(plain, name), getattr(raised, name))
        np.testing.assert_array_equal(plain.command.array(), raised.command.array())


def test_rows_that_ask_too_much_are_infeasible_and_say_so():
    state = State([-25.0, 25.0], [0.5, -0.5], [0.0, np.pi], [0.0, 0.0])
    nominal = Command([25.0, 25.0], 0.0, 0.0)
    flown = CollisionFilter(TURN, ALPHA, margin=BoundedError(v=30.0))(View(state, nominal), nominal, LIMITS)
    assert np.all(flown.status == Status.INFEASIBLE)
    np.testing.assert_array_equal(flown.command.array(), GAMMA.array())


@pytest.mark.parametrize("amount", [np.nan, -1.0, np.inf])
def test_a_margin_that_is_negative_or_not_finite_is_an_error(amount):
    state = random_state(rng_of(1))
    nominal = random_rates(rng_of(1))
    broken = CollisionFilter(TURN, ALPHA, margin=lambda lie: np.full(len(lie), amount))
    with pytest.raises(ValueError, match="a margin must be finite and not negative"):
        broken(View(state, nominal), nominal, LIMITS)
    with pytest.raises(ValueError, match="omega must be finite and not negative"):
        BoundedError(omega=amount)
    with pytest.raises(ValueError, match="epsilon must be positive"):
        InputToState(epsilon=-abs(amount))


@pytest.mark.parametrize("name", ["v", "omega", "zeta"])
@pytest.mark.parametrize("value", [-1e-9, np.nan, np.inf])
def test_each_bound_and_weight_out_of_range_is_named(name, value):
    for make in (BoundedError, lambda **given: InputToState(1.0, **given)):
        with pytest.raises(ValueError, match=f"^{name} must be finite and not negative, got {value}"):
            make(**{name: value})
        make(**{name: 0.0})


@pytest.mark.parametrize("epsilon", [0.0, -1.0, np.nan, np.inf])
def test_an_epsilon_that_divides_by_nothing_is_refused(epsilon):
    with pytest.raises(ValueError, match=r"^epsilon must be positive and finite"):
        InputToState(epsilon)


def test_margins_have_the_sizes_their_formulas_say():
    lie = np.array([[1.0, -20.0, 3.0], [0.0, 0.0, -2.0]])
    np.testing.assert_allclose(BoundedError(0.5, 0.1, 2.0)(lie), [0.5 + 2.0 + 6.0, 4.0])
    # |W L_g h|^2 / epsilon: (2 * 1)^2 + (0.1 * 20)^2 + (3 * 3)^2 = 89
    np.testing.assert_allclose(InputToState(4.0, 2.0, 0.1, 3.0)(lie), [89.0 / 4.0, 36.0 / 4.0])
    np.testing.assert_allclose(InputToState(4.0)(lie), [410.0 / 4.0, 1.0])
    both = Sum((BoundedError(0.5, 0.1, 2.0), InputToState(4.0)))
    np.testing.assert_allclose(both(lie), [8.5 + 102.5, 4.0 + 1.0])


# --- predicted poses -------------------------------------------------------------------------------------


def test_prediction_is_exact_on_motion_at_constant_rates():
    rng = rng_of(2)
    state, rates = random_state(rng, 5), random_rates(rng, 5)
    fleet = KinematicFleet(5, dt=0.005)
    fleet.reset(state, rng)
    fleet.step(rates, np.zeros(3), 90)
    # 90 arcs against one: round-off
    assert pose_error(Horizon(0.45)(state, rates), fleet.state()) < 1e-10


def test_a_prediction_of_nothing_is_the_filter_itself():
    rng = rng_of(3)
    state, rates = random_state(rng, 4), random_rates(rng, 4)
    filter_ = CollisionFilter(TURN, ALPHA)
    plain, ahead = (f(View(state, rates), rates, LIMITS) for f in (filter_, Predicted(filter_, Horizon(0.0))))
    np.testing.assert_array_equal(plain.command.array(), ahead.command.array())
    np.testing.assert_array_equal(plain.pairs.h, ahead.pairs.h)


def test_a_predicting_filter_passes_the_nominal_on_and_reports_the_predicted_h():
    rng = rng_of(4)
    state, rates, nominal = random_state(rng), random_rates(rng), random_rates(rng)
    seen = Seen([], [])
    Predicted(seen, Horizon(0.3))(View(state, rates), nominal, LIMITS)
    assert seen.nominals == [nominal] and seen.limits == [LIMITS] and seen.views[0].rates is rates
    made = Predicted(CollisionFilter(TURN, ALPHA), Horizon(0.3))(View(state, rates), nominal, LIMITS)
    np.testing.assert_array_equal(made.pairs.h, TURN.values(step(state, rates, 0.3)).h)
    # What the run loop takes for the true h, it takes from a filter with this attribute only.
    assert not hasattr(Predicted(CollisionFilter(TURN, ALPHA), Horizon(0.3)), "barrier")


def test_views_of_their_own_are_predicted_observer_by_observer():
    rng = rng_of(5)
    state = State.of(rng.normal(size=(3, 3, 4)))
    rates = Command.of(rng.normal(size=(3, 3, 3)))
    held = Command(np.full(3, 16.0), np.full(3, 0.2), np.zeros(3))
    for pose in (Horizon(0.4), LaggedPose([LAGS], held)):
        all_at_once = pose(state, rates).array()
        for k in range(3):
            np.testing.assert_allclose(all_at_once[k], pose(state[k], rates[k]).array(), rtol=0, atol=1e-12)


LAGS = (Lag(1.0), Lag(0.35), Lag(0.3))
LATE = (Lag(1.0, 0.1), Lag(0.35, 0.25), Lag(0.0, 0.15))
STEPS = ("plain", LAGS), ("with delays", LATE), ("no lag", (Lag(), Lag(), Lag()))


@pytest.mark.parametrize(("name", "lags"), STEPS, ids=[s[0] for s in STEPS])
def test_the_lagged_pose_is_where_a_unicycle_ends_up_beside_the_lagged_vehicle(name, lags):
    rng = rng_of(6)
    state, speeds, u = random_state(rng, 6), rng.uniform(15, 25, 6), random_rates(rng, 6)
    fleet = KinematicFleet(6, dt=0.001, lags=lags)
    fleet.reset(state, rng, speed=speeds)
    pose = LaggedPose([lags], u)(fleet.state(), fleet.achieved())
    fleet.step(u, np.zeros(3), 15_000)
    # The plant turns half a step late, 1e-4 rad over 300 m; without the prediction it is metres.
    assert pose_error(step(pose, u, 15.0), fleet.state()) < 0.03


def test_the_lagged_pose_moves_as_the_unicycle_while_its_vehicle_flies_the_held_command():
    rng = rng_of(7)
    state, u = random_state(rng), random_rates(rng)
    fleet = KinematicFleet(2, dt=0.005, lags=LAGS)
    fleet.reset(state, rng, speed=25.0)
    pose = LaggedPose([LAGS], u)
    begin = pose(fleet.state(), fleet.achieved())
    for k in range(1, 11):
        fleet.step(u, np.zeros(3), 50)
        # 2e-3 m is the plant's; the vehicle itself is metres away.
        assert pose_error(pose(fleet.state(), fleet.achieved()), step(begin, u, 0.25 * k)) < 5e-3


def test_course_and_height_of_the_lagged_pose_follow_any_command_exactly():
    rng = rng_of(8)
    state = random_state(rng)
    fleet = KinematicFleet(2, dt=0.001, lags=LAGS)
    fleet.reset(state, rng, speed=20.0)
    pose = LaggedPose([LAGS], GAMMA)
    before = pose(fleet.state(), fleet.achieved())
    for _ in range(20):
        u = random_rates(rng)
        fleet.step(u, np.zeros(3), 100)
        after = pose(fleet.state(), fleet.achieved())
        np.testing.assert_allclose(after.theta - before.theta, 0.1 * u.omega, atol=1e-6)
        np.testing.assert_allclose(after.z - before.z, 0.1 * u.zeta, atol=1e-5)
        before = after


def test_h_of_the_lagged_pose_is_constant_while_lagged_vehicles_evade():
    state = State([-60.0, 50.0], [2.0, -4.0], [0.1, 3.0], [0.0, 1.0])
    fleet = KinematicFleet(2, dt=0.005, lags=LAGS)
    fleet.reset(state, rng_of(9), speed=25.0)
    pose = LaggedPose([LAGS], GAMMA)
    seen, true = [], []
    for _ in range(20):
        seen.append(TURN.values(pose(fleet.state(), fleet.achieved())).h[0])
        true.append(TURN.values(fleet.state()).h[0])
        fleet.step(GAMMA, np.zeros(3), 50)
    assert np.ptp(seen) < 5e-3 < 1.0 < np.ptp(true)


def carried_beyond(lags, rate, u, theta, seconds=60.0, steps=600_000):
    """m: where a lagging vehicle ends up beside one that flies `u` from now on, by the trapezoidal rule."""
    t = np.linspace(0.0, seconds, steps + 1)
    v, omega = lags[0], lags[1]

    def left(lag):
        late = np.maximum(t - lag.delay_s, 0.0)
        return np.exp(-late / lag.time_constant_s) if lag.time_constant_s else np.where(late > 0, 0.0, 1.0)

    speed = u[0] + (rate[0] - u[0]) * left(v)
    constant = omega.time_constant_s
    turned = np.minimum(t, omega.delay_s) + constant * (1.0 - left(omega))
    gap = (rate[1] - u[1]) * turned
    swung = (omega.time_constant_s + omega.delay_s) * (rate[1] - u[1])
    arc = theta + u[1] * t
    beyond = speed * np.exp(1j * (arc + gap)) - u[0] * np.exp(1j * (arc + swung))
    return 0.5 * np.sum(beyond[1:] + beyond[:-1]) * t[1]


def test_of_vehicles_with_lags_of_their_own_each_pose_is_displaced_by_what_its_transient_adds():
    mixed = [LAGS, LATE, (Lag(0.4, 0.3), Lag(2.0, 0.1), Lag(1.0))]
    rng = rng_of(13)
    state, rates, u = random_state(rng, 3), random_rates(rng, 3), random_rates(rng, 3)
    together = LaggedPose(mixed, u)(state, rates)
    for k, lags in enumerate(mixed):
        alone = LaggedPose([lags], u[[k]])(state[[k]], rates[[k]])
        assert pose_error(together[[k]], alone) < 1e-9
        moved = carried_beyond(lags, rates.array()[k], u.array()[k], state.theta[k])
        shift = together.x[k] - state.x[k] + 1j * (together.y[k] - state.y[k])
        # the rule's own error, 1e-8 m, more at a delay's end
        assert abs(shift - moved) < 1e-4
        whole = [lag.time_constant_s + lag.delay_s for lag in lags]
        beyond = (rates.array() - u.array())[k]
        assert together.theta[k] - state.theta[k] == pytest.approx(whole[1] * beyond[1])
        assert together.z[k] - state.z[k] == pytest.approx(whole[2] * beyond[2])


@pytest.mark.parametrize("seconds", [-0.1, np.nan, np.inf])
def test_a_horizon_out_of_range_is_an_error(seconds):
    with pytest.raises(ValueError, match="a prediction horizon must be finite"):
        Horizon(seconds)


@dataclass
class Raw:
    """A lag that checks nothing."""

    time_constant_s: float
    delay_s: float


def test_lags_that_do_not_fit_are_an_error():
    with pytest.raises(ValueError, match="2 vehicles need one or 2 triples of lags, got 3"):
        LaggedPose([LAGS] * 3, GAMMA)
    with pytest.raises(ValueError, match="time constant must be finite"):
        LaggedPose([(Lag(np.inf), Lag(), Lag())], GAMMA)
    with pytest.raises(ValueError, match=r"a delay must be finite and not negative, got .*-0.1"):
        LaggedPose([(Lag(), Raw(0.0, -0.1), Lag())], GAMMA)
    with pytest.raises(ValueError, match="2 vehicles need one or 2 triples of lags, got 1"):
        LaggedPose([LAGS[:2]], GAMMA)


# --- the frame of the air --------------------------------------------------------------------------------


def through_air(state, air_rates, wind):
    """The ground view of vehicles whose poses and rates relative to the air are given."""
    v = air_rates.v * np.exp(1j * state.theta) + wind
    turn = air_rates.v * air_rates.omega * np.cos(state.theta - np.angle(v)) / np.abs(v)
    return View(State(state.x, state.y, np.angle(v), state.z), Command(np.abs(v), turn, air_rates.zeta))


def air_command(ground, theta_air, wind):
    """What a vehicle flies relative to the air when it obeys a ground command with its nose at theta_air."""
    w = wind * np.exp(-1j * theta_air)
    v = np.sqrt(ground.v**2 - w.imag**2) - w.real
    return Command(v, ground.omega * ground.v**2 / (v * (v + w.real)), ground.zeta)


def test_the_air_frame_without_wind_is_the_filter_itself():
    for seed in range(20):
        rng = rng_of(seed)
        state, rates, nominal = random_state(rng, 3), random_rates(rng, 3), random_rates(rng, 3)
        nominal = Command(nominal.v - 22.0, nominal.omega * 5, nominal.zeta)
        for filter_ in (CollisionFilter(TURN, ALPHA), CollisionFilter(TURN, ALPHA, "limited")):
            calm, air = (
                f(View(state, rates), nominal, LIMITS) for f in (filter_, AirMass(filter_, (0.0, 0.0)))
            )
            np.testing.assert_array_equal(calm.command.array(), air.command.array())
            np.testing.assert_array_equal(calm.override, air.override)


@pytest.mark.parametrize("wind", [3 + 2j, -6 + 0j, 4j, -2 - 5j])
def test_relative_to_the_air_vehicles_in_wind_fly_as_in_calm(wind):
    """Galilean invariance: limits wide enough never to act, the same goal-free nominal in the air's frame."""
    wide = Limits(9.0, 60.0, 5.0, 3.9)
    filter_ = CollisionFilter(TURN, linear(1.0))
    seeker = Command([20.0, 20.0], [0.02, -0.03], 0.0)
    calm = windy = State([-80.0, 80.0], [3.0, -3.0], [0.05, np.pi - 0.02], [0.0, 0.5])
    rates = air_rates = Command([20.0, 20.0], 0.0, 0.0)
    acted = False
    for _ in range(160):
        view = through_air(windy, air_rates, wind)
        wanted = through_air(windy, seeker, wind).rates
        chosen = AirMass(filter_, (wind.real, wind.imag))(view, wanted, wide)
        air_rates = air_command(chosen.command, windy.theta, wind)
        windy = step(windy, air_rates, 0.05)  # in the frame of the air, which drifts
        made = filter_(View(calm, rates), seeker, wide)
        rates, acted = made.command, acted or bool(made.override.any())
        calm = step(calm, rates, 0.05)
    assert acted
    # QPs are solved to 1e-9 and the difference grows along the flight; without the frame it is metres.
    assert pose_error(windy, calm) < 1e-4


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), speed=st.floats(0.0, 14.0), towards=st.floats(-3.2, 3.2))
def test_every_command_of_the_air_frame_maps_into_the_ground_limits_without_being_clipped(
    seed, speed, towards
):
    rng = rng_of(seed)
    wind = speed * np.exp(1j * towards)

    @dataclass
    class Corner:
        """A filter that flies a random corner of the limits it is given."""

        command: Command | None = None

        def __call__(self, view, nominal, limits):
            pick = rng.choice([0.0, 0.5, 1.0], (len(view.state), 3))
            low, high = limits.lower.array(), limits.upper.array()
            self.command = Command.of(low + pick * (high - low))
            return replace(Passthrough()(view, self.command, limits), command=self.command)

    corner = Corner()
    state, rates = random_state(rng, 3), random_rates(rng, 3)
    made = AirMass(corner, (wind.real, wind.imag, 0.0))(View(state, rates), rates, LIMITS)
    assert np.all(LIMITS.contains(made.command))
    air = np.angle(rates.v * np.exp(1j * state.theta) - wind)
    back = air_command(made.command, air, wind)
    # Nothing was lost on the way: the command is the image of what the filter chose.
    np.testing.assert_allclose(back.array(), corner.command.array(), rtol=0, atol=1e-8)


@pytest.mark.parametrize("wind", [(np.nan, 0.0), (1.0,), (15.0, 0.0), (9.0, 13.0)])
def test_a_wind_that_the_air_frame_cannot_take_is_an_error(wind):
    state, rates = random_state(rng_of(1)), random_rates(rng_of(1))
    with pytest.raises(ValueError, match="wind"):
        AirMass(CollisionFilter(TURN, ALPHA), wind)(View(state, rates), rates, LIMITS)


def test_a_measured_wind_is_asked_of_the_view():
    state, rates = random_state(rng_of(1)), random_rates(rng_of(1))
    filter_, view = CollisionFilter(TURN, ALPHA), View(state, rates)
    given, asked = (
        AirMass(filter_, w)(view, rates, LIMITS).command.array()
        for w in ((3.0, 1.0), lambda seen: np.array([3.0, 1.0]) if seen is view else np.full(2, np.nan))
    )
    np.testing.assert_array_equal(given, asked)


@pytest.mark.parametrize("wind", [0j, 3 + 2j, -6 + 0j, 4j, -2 - 5j])
def test_the_wrapped_filter_sees_poses_and_rates_relative_to_the_air(wind):
    rng = rng_of(11)
    state, air_rates = random_state(rng, 5), random_rates(rng, 5)
    seen = Seen([], [])
    AirMass(seen, (wind.real, wind.imag))(through_air(state, air_rates, wind), air_rates, LIMITS)
    assert pose_error(seen.views[0].state, state) < 1e-12
    np.testing.assert_allclose(seen.views[0].rates.array(), air_rates.array(), atol=1e-12)


def test_without_wind_what_the_wrapped_filter_sees_is_the_same_to_the_last_bit():
    rng = rng_of(12)
    view = View(random_state(rng, 50), random_rates(rng, 50))
    seen = Seen([], [])
    AirMass(seen, (0.0, 0.0))(view, view.rates, LIMITS)
    np.testing.assert_array_equal(seen.views[0].state.array(), view.state.array())
    np.testing.assert_array_equal(seen.views[0].rates.array(), view.rates.array())
    np.testing.assert_array_equal(seen.nominals[0].array(), view.rates.array())
    np.testing.assert_array_equal(seen.limits[0].omega_max, np.full(50, OMEGA_MAX))


def test_a_vehicle_blown_backwards_faces_into_the_wind_and_shows_no_turn():
    # 2 m/s over the ground, in 5 m/s from behind: it heads the other way at 3 m/s
    view = View(State([0.0], 0.0, 0.0, 0.0), Command([2.0], 0.1, 0.0))
    seen = Seen([], [])
    AirMass(seen, (5.0, 0.0))(view, view.rates, LIMITS)
    assert abs(seen.views[0].state.theta[0]) == pytest.approx(np.pi)
    np.testing.assert_allclose(seen.views[0].rates.array(), [[3.0, 0.0, 0.0]], atol=1e-12)


def turn_ratio(v, drift):
    """Turn rate in the air over that above the ground, at airspeed v, the wind along and left `drift`."""
    return abs(v + drift) ** 2 / (v * (v + drift.real))


@pytest.mark.parametrize("wind", [5 + 0j, -8 + 3j, -14 + 1j, 6j, -4 - 9j, -6 - 6j])
def test_turn_rates_are_kept_to_what_the_worst_airspeed_allows(wind):
    view = View(State([0.0], 0.0, 0.0, 0.0), through_air(State([0.0], 0.0, 0.0, 0.0), GAMMA[[0]], wind).rates)
    ahead = through_air(State([0.0], 0.0, 0.0, 0.0), GAMMA[[0]], wind)
    seen = Seen([], [])
    AirMass(seen, (wind.real, wind.imag))(ahead, view.rates, LIMITS)
    box = seen.limits[0]
    # ground speeds of 15 and 25 m/s with the nose to the east
    v = np.sqrt(np.array([15.0, 25.0]) ** 2 - wind.imag**2) - wind.real
    np.testing.assert_allclose([box.v_min[0], box.v_max[0]], v)
    grid = np.linspace(*v, 200_001)
    assert box.omega_max[0] == pytest.approx(OMEGA_MAX * turn_ratio(grid, wind).min(), rel=1e-9)


@pytest.mark.parametrize(("wanted", "flown"), [(5.0, 15.0), (20.0, 20.0), (60.0, 25.0)])
def test_a_nominal_turn_is_that_of_the_nearest_speed_that_can_be_flown(wanted, flown):
    wind = -6 + 4j
    view = through_air(State([0.0], 0.0, 0.0, 0.0), GAMMA[[0]], wind)
    seen = Seen([], [])
    AirMass(seen, (wind.real, wind.imag))(view, Command([wanted], 0.1, 1.0), LIMITS)
    v = np.sqrt(flown**2 - wind.imag**2) - wind.real
    np.testing.assert_allclose(seen.nominals[0].omega, 0.1 * turn_ratio(v, wind))
    np.testing.assert_allclose(seen.nominals[0].v, np.sqrt(wanted**2 - wind.imag**2) - wind.real)


@pytest.mark.parametrize("mode", MODES)
def test_what_the_wrapped_filter_says_of_its_qps_is_passed_on(mode):
    state = State([-25.0, 25.0], [0.5, -0.5], [0.0, np.pi], [0.0, 0.0])
    rates = Command([25.0, 25.0], 0.0, 0.0)
    filter_, said = CollisionFilter(TURN, ALPHA, mode), []

    def listening(view, nominal, limits):
        said.append(filter_(view, nominal, limits))
        return said[0]

    made = AirMass(listening, (3.0, -4.0))(View(state, rates), rates, LIMITS)
    for name in ("status", "residual", "pairs", "hdot_predicted"):
        assert getattr(made, name) is getattr(said[0], name)
