"""The collision filter: exact shortcuts, the paper's theorems on random states, and failing QPs."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.barriers.class_k import cubic, linear
from filters.barriers.closed_form import StraightBarrier, TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.barriers.pairs import PairValues
from filters.barriers.per_pair import PerPair
from filters.cbf.collision import CollisionFilter, Passthrough, Problem
from filters.cbf.constraints import manoeuvres, observed_rows, own_rows, pair_rows, shares
from filters.model import Command, Limits, State, View
from filters.qp import single
from filters.qp.single import Status

OMEGA_MAX = np.deg2rad(13)
LIMITS = Limits(15.0, 25.0, OMEGA_MAX, 3.9)
TURN = TurnBarrier(16.0, 0.9 * OMEGA_MAX, 5.0, smoothing=30.0)
ALPHA = cubic(0.1)
MODES = ("centralised", "limited")
VECTORS = json.loads((Path(__file__).parent / "reference" / "vectors.json").read_text())


def rows_of(state, barrier=TURN, alpha=ALPHA):
    """The rows of all pairs."""
    return pair_rows(barrier.values(state), state, alpha)


def own_of(rows, n):
    """Every vehicle's share of them."""
    return own_rows([rows], [shares(rows, manoeuvres(TURN, rows, n, TURN.manoeuvre(n).array()))])


def random_state(rng, n, radius=60.0):
    return State(*rng.uniform(-radius, radius, (2, n)), rng.uniform(-np.pi, np.pi, n), rng.uniform(-5, 5, n))


def safe_state(rng, n, radius=60.0, barrier=TURN):
    while True:
        state = random_state(rng, n, radius)
        if np.all(barrier.values(state).h >= 0):
            return state


def random_nominal(rng, n):
    return Command(rng.uniform(10, 40, n), rng.uniform(-3, 3, n), rng.uniform(-5, 5, n))


def view_of(state):
    return View(state, Command(np.full(len(state), 20.0), 0.0, 0.0))


@pytest.mark.parametrize("case", VECTORS["qp"], ids=lambda c: f"{c['name']}-{c['mode']}")
def test_the_filter_reproduces_the_reference_solutions(case):
    k, gamma = case["k"], np.array(case["gamma"])
    if case["kind"] == "turn":
        barrier = TurnBarrier(gamma[0, 0], gamma[0, 1], 5.0, delta=case["delta"])
    else:
        barrier = StraightBarrier(gamma[:, 0], zeta=0.0, d_safe=5.0)
    mode = "limited" if case["mode"] == "limited_communication" else "centralised"
    limits = Limits(case["lo"][0], case["hi"][0], case["hi"][1], case["hi"][2])
    decision = CollisionFilter(barrier, ALPHA, mode)(
        view_of(State.of(case["X"])), Command.of(case["u_hat"]), limits
    )
    np.testing.assert_allclose(decision.pairs.h, case["h"], rtol=0, atol=1e-8)
    np.testing.assert_allclose(decision.command.array().reshape(k, 3), case["u"], rtol=0, atol=1e-6)


@pytest.mark.parametrize("mode", MODES)
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(2, 7))
def test_inside_the_safe_set_every_qp_is_solved_inside_the_limits(mode, seed, n):
    rng = np.random.default_rng(seed)
    state = safe_state(rng, n, 40.0 * np.sqrt(n))
    decision = CollisionFilter(TURN, ALPHA, mode)(view_of(state), random_nominal(rng, n), LIMITS)
    assert np.all(decision.status == Status.SOLVED)
    assert np.max(decision.residual) <= single.RESIDUAL
    assert np.all(LIMITS.contains(decision.command))
    # The barrier's promise, whichever QP it was (Theorem 4 for the limited one).
    assert np.all(decision.hdot_predicted >= -ALPHA(decision.pairs.h) - 1e-6)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(2, 8))
def test_limited_rows_add_up_to_the_pairs_rows_and_gamma_satisfies_both(seed, n):
    rng = np.random.default_rng(seed)
    state = random_state(rng, n)
    rows = rows_of(state)
    own = own_of(rows, n)
    half = rows.rhs.size
    np.testing.assert_allclose(own.rhs[:half] + own.rhs[half:], rows.rhs, rtol=1e-12, atol=1e-9)
    gamma = TURN.manoeuvre(n).array()
    safe = rows.h >= 0
    assert np.all((rows.left(gamma) >= rows.rhs - 1e-9)[safe])  # Theorem 3
    assert np.all((own.left(gamma) >= own.rhs - 1e-9)[np.tile(safe, 2)])  # Theorem 4


def undropped(state, nominal, mode):
    """The same QPs with every row kept and all vehicles in one problem."""
    n = len(state)
    rows = rows_of(state)
    lower, upper = (np.broadcast_to(c.array(), (n, 3)) for c in (LIMITS.lower, LIMITS.upper))
    target = nominal.array()
    if mode == "centralised":
        matrix = np.zeros((rows.rhs.size, n, 3))
        for vehicle, lie in zip(rows.vehicles, rows.lie, strict=True):
            matrix[np.arange(rows.rhs.size), vehicle] = lie
        solution = single.solve(
            target.ravel(), matrix.reshape(-1, 3 * n), rows.rhs, lower.ravel(), upper.ravel()
        )
        return solution.u.reshape(n, 3)
    own = own_of(rows, n)
    mine = [own.vehicles[0] == v for v in range(n)]
    return np.array(
        [single.solve(target[v], own.lie[0][m], own.rhs[m], lower[v], upper[v]).u for v, m in enumerate(mine)]
    )


@pytest.mark.parametrize("mode", MODES)
def test_dropping_rows_and_splitting_into_groups_changes_no_solution(mode):
    rng = np.random.default_rng(11)
    for _ in range(20):
        n = int(rng.integers(2, 9))
        state, nominal = safe_state(rng, n, 25.0 * n), random_nominal(rng, n)
        decision = CollisionFilter(TURN, ALPHA, mode)(view_of(state), nominal, LIMITS)
        np.testing.assert_allclose(
            decision.command.array(), undropped(state, nominal, mode), rtol=0, atol=1e-6
        )


def test_two_distant_groups_are_solved_as_if_alone():
    rng = np.random.default_rng(12)
    a, b = safe_state(rng, 3, 30.0), safe_state(rng, 4, 35.0)
    both = State.of(np.concatenate([a.array(), b.array() + np.array([3000.0, 0, 0, 0])]))
    nominal = random_nominal(rng, 7)
    decide = CollisionFilter(TURN, ALPHA)
    together = decide(view_of(both), nominal, LIMITS).command.array()
    alone = [
        decide(view_of(both[part]), nominal[part], LIMITS).command.array()
        for part in (slice(0, 3), slice(3, 7))
    ]
    np.testing.assert_allclose(together, np.concatenate(alone), rtol=0, atol=1e-9)


@pytest.mark.parametrize("mode", MODES)
def test_far_apart_the_clipped_nominal_flies_and_no_qp_is_solved(mode, monkeypatch):
    monkeypatch.setattr(single, "solve", lambda *_: pytest.fail("a QP was solved"))
    state = State([0.0, 5000.0], [0.0, 0.0], [0.0, np.pi], [0.0, 0.0])
    nominal = Command([30.0, 20.0], [0.0, 0.1], [0.0, 0.0])
    decision = CollisionFilter(TURN, ALPHA, mode)(view_of(state), nominal, LIMITS)
    np.testing.assert_array_equal(decision.command.array(), LIMITS.clip(nominal).array())
    np.testing.assert_array_equal(decision.override, [False, False])
    np.testing.assert_array_equal(decision.deviation, [0.0, 0.0])


@pytest.mark.parametrize("mode", MODES)
def test_one_vehicle_needs_no_rows(mode):
    state = State([0.0], [0.0], [0.0], [0.0])
    decision = CollisionFilter(TURN, ALPHA, mode)(view_of(state), Command([40.0], [0.0], [0.0]), LIMITS)
    assert decision.command.v == [25.0]
    assert decision.hdot_predicted.shape == decision.pairs.h.shape == (0,)
    assert decision.residual == [0.0]


@pytest.mark.parametrize("mode", MODES)
def test_limits_may_leave_no_choice(mode):
    state = safe_state(np.random.default_rng(13), 4)
    fixed = Limits(16.0, 16.0, 0.0, 0.0)
    decision = CollisionFilter(TURN, linear(0.01), mode)(
        view_of(state), random_nominal(np.random.default_rng(1), 4), fixed
    )
    np.testing.assert_array_equal(decision.command.array(), np.tile([16.0, 0.0, 0.0], (4, 1)))
    assert np.all(np.isfinite(decision.residual))


@dataclass(frozen=True)
class Broken:
    """A barrier with one bad value."""

    value: float
    d_safe: float = 5.0

    def manoeuvre(self, n):
        return TURN.manoeuvre(n)

    def values(self, state, i=None, j=None):
        good = TURN.values(state, i, j)
        h = good.h.copy()
        h[1] = self.value
        return PairValues(good.i, good.j, h, good.grad)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_bad_barrier_value_is_an_error_that_names_the_pair(mode, bad):
    state = safe_state(np.random.default_rng(14), 4)
    with pytest.raises(FloatingPointError, match=r"vehicles 1 and 3 \(row 2 of 6\)"):
        CollisionFilter(Broken(bad), ALPHA, mode)(
            view_of(state), random_nominal(np.random.default_rng(1), 4), LIMITS
        )


@dataclass(frozen=True)
class Steep:
    """A barrier with one bad or huge number in the gradient of its second pair."""

    value: float
    column: int
    d_safe: float = 5.0

    def values(self, state, i=None, j=None):
        good = TURN.values(state, i, j)
        grad = good.grad.copy()
        grad[1, self.column] = self.value
        return PairValues(good.i, good.j, good.h, grad)


@pytest.mark.parametrize("column", [1, 2, 3, 5, 6, 7])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_bad_derivative_is_an_error_that_names_the_pair_whatever_it_is_a_derivative_by(bad, column):
    state = safe_state(np.random.default_rng(14), 4)
    with (
        np.errstate(invalid="ignore"),
        pytest.raises(FloatingPointError, match=r"vehicles 1 and 3 \(row 2 of 6\) is not finite: h \d"),
    ):
        rows_of(state, Steep(bad, column))


def test_numbers_whose_sum_is_not_finite_are_refused_naming_the_largest():
    state = safe_state(np.random.default_rng(14), 4)
    h = TURN.values(state).h

    def alpha(h):
        return np.where(np.arange(h.size) == 3, 1.7e308, 1.6e308)

    with pytest.raises(FloatingPointError, match=r"vehicles 2 and 3 \(row 4 of 6\) .*L_f h -1.7e\+308$"):
        rows_of(state, alpha=alpha)
    assert h.size == 6
    infinite = np.where(np.arange(6) == 4, np.inf, 1.0)
    with pytest.raises(FloatingPointError, match=r"vehicles 2 and 4 \(row 5 of 6\)"):
        rows_of(state, alpha=lambda h: infinite)


def test_the_deviation_is_each_vehicles_largest_change_beyond_the_limits():
    state = State([-25.0, 25.0, 4000.0], [0.5, -0.5, 0.0], [0.0, np.pi, 0.0], 0.0)
    nominal = Command([22.0, 30.0, 30.0], [0.0, 0.0, 0.1], 0.0)
    limits = Limits(np.full(3, 15.0), 25.0, [0.05, 0.2, 0.2], 3.9)
    decision = CollisionFilter(TURN, ALPHA)(view_of(state), nominal, limits)
    change = np.abs(decision.command.array() - limits.clip(nominal).array()).max(axis=1)
    np.testing.assert_array_equal(decision.deviation, change)
    assert decision.override.tolist() == [True, True, False] and change[2] == 0.0
    assert 0.01 < change[0] != change[1] > 0.01


@pytest.mark.parametrize("mode", MODES)
def test_where_only_osqp_may_be_asked_nothing_else_is(mode, monkeypatch):
    for name in ("attempt", "attempt_each"):
        monkeypatch.setattr(f"filters.qp.active_set.{name}", lambda *_: pytest.fail("not OSQP"))
    state = State([-25.0, 25.0], [0.5, -0.5], [0.0, np.pi], 0.0)
    decision = CollisionFilter(TURN, ALPHA, mode, solver="osqp")(
        view_of(state), Command([22.0, 25.0], 0.0, 0.0), LIMITS
    )
    assert np.all(decision.status == Status.SOLVED) and np.all(decision.override)


def test_the_shared_manoeuvre_a_filter_keeps_cannot_be_written():
    with pytest.raises(ValueError, match="read-only"):
        CollisionFilter(TURN, ALPHA).gamma(3)[0, 0] = 0.0


def test_commands_for_another_number_of_vehicles_are_refused():
    state = safe_state(np.random.default_rng(15), 3)
    with pytest.raises(ValueError, match=r"^3 vehicles need nominal commands of shape \(3,\), got \(2,\)$"):
        CollisionFilter(TURN, ALPHA)(view_of(state), Command([20.0, 20.0], 0.0, 0.0), LIMITS)


def test_barriers_per_pair_are_those_of_their_pairs_and_ds_is_the_largest():
    rng = np.random.default_rng(22)
    state = random_state(rng, 4)
    each = [TurnBarrier(16.0, 0.1 + 0.02 * p, 5.0 + p) for p in range(6)]
    together = PerPair(tuple(each))
    assert together.d_safe == 10.0
    values = together.values(state)
    gamma_i, gamma_j = together.manoeuvres(values.i, values.j, 4)
    for p, barrier in enumerate(each):
        alone = barrier.values(state)
        assert values.h[p] == alone.h[p]
        np.testing.assert_array_equal(values.grad[p], alone.grad[p])
        np.testing.assert_array_equal([gamma_i[p], gamma_j[p]], np.tile([16.0, 0.1 + 0.02 * p, 0.0], (2, 1)))
    # the other way round it is the same pair, and some of them are these
    some = together.values(state, np.array([3, 2]), np.array([1, 0]))
    assert some.h == pytest.approx([each[4].values(state).h[4], each[1].values(state).h[1]])
    assert together.manoeuvre(4) is None
    with pytest.raises(ValueError, match="Assumption 1"):
        CollisionFilter(together, ALPHA)
    with pytest.raises(
        ValueError, match=r"^an empty list of barriers; give one for all pairs, or one per pair$"
    ):
        CollisionFilter([], ALPHA)


def test_every_observers_rows_are_its_own_of_the_world_it_sees():
    rng = np.random.default_rng(23)
    n = 4
    worlds = [random_state(rng, n) for _ in range(n)]
    view = View(State.of([w.array() for w in worlds]), Command.of(np.tile([20.0, 0.0, 0.0], (n, n, 1))))
    found = observed_rows(TURN, ALPHA, view, TURN.manoeuvre(n).array())
    for v, world in enumerate(worlds):
        rows = own_of(rows_of(world), n)
        mine, seen = rows.vehicles[0] == v, found.vehicles[0] == v
        expected = np.column_stack([rows.lie[0], rows.rhs])[mine]
        got = np.column_stack([found.lie[0], found.rhs])[seen]
        order = np.argsort(expected[:, 0]), np.argsort(got[:, 0])
        np.testing.assert_allclose(got[order[1]], expected[order[0]], rtol=1e-9, atol=1e-9)


def test_a_bad_nominal_command_is_an_error_that_names_the_vehicle():
    state = safe_state(np.random.default_rng(15), 3)
    with pytest.raises(ValueError, match="nominal command of vehicle 2"):
        CollisionFilter(TURN, ALPHA)(view_of(state), Command([20.0, np.nan, 20.0], 0.0, 0.0), LIMITS)


@pytest.mark.parametrize("mode", MODES)
def test_without_a_solution_vehicles_fly_gamma_and_say_so(mode):
    # Head-on 12 m apart, deep outside the safe set, and a third vehicle far away that nothing concerns.
    state = State([-6.0, 6.0, 4000.0], [0.0, 0.0, 0.0], [0.0, np.pi, 0.0], [0.0, 0.0, 0.0])
    nominal = Command([20.0, 20.0, 20.0], 0.0, 0.0)
    barrier = StraightBarrier([16.16, 16.32, 16.48], zeta=0.0, d_safe=5.0)
    decision = CollisionFilter(barrier, cubic(10.0), mode)(
        view_of(state), nominal, Limits(15.0, 25.0, 0.01, 0.1)
    )
    np.testing.assert_array_equal(decision.status, [Status.INFEASIBLE, Status.INFEASIBLE, Status.SOLVED])
    np.testing.assert_array_equal(decision.command.v, [16.16, 16.32, 20.0])
    assert decision.residual[0] > 1.0
    assert decision.residual[2] == 0.0


def test_without_a_manoeuvre_vehicles_fly_the_least_bad_input():
    state = State([-3.0, 3.0], [0.0, 0.0], [0.0, np.pi], [0.0, 0.0])
    decision = CollisionFilter(EuclideanBarrier(5.0), linear(1.0))(
        view_of(state), Command([20.0, 20.0], 0.0, 0.0), LIMITS
    )
    np.testing.assert_array_equal(decision.status, [Status.INFEASIBLE] * 2)
    np.testing.assert_allclose(decision.command.v, [15.0, 15.0], atol=1e-9)


def test_limited_communication_without_a_manoeuvre_is_refused():
    state = safe_state(np.random.default_rng(16), 2)
    with pytest.raises(ValueError, match="manoeuvre"):
        CollisionFilter(EuclideanBarrier(5.0), ALPHA, "limited")(
            view_of(state), Command([20.0] * 2, 0.0, 0.0), LIMITS
        )


def test_a_barrier_per_pair_must_be_asked_for():
    with pytest.raises(ValueError, match="Assumption 1"):
        CollisionFilter([TURN, TURN, TURN], ALPHA)
    with pytest.raises(ValueError, match="mode"):
        CollisionFilter(TURN, ALPHA, "decentralised")


@pytest.mark.parametrize("mode", MODES)
def test_equal_barriers_per_pair_are_the_shared_barrier(mode):
    rng = np.random.default_rng(17)
    state, nominal = safe_state(rng, 4), random_nominal(rng, 4)
    shared = CollisionFilter(TURN, ALPHA, mode)(view_of(state), nominal, LIMITS)
    own = CollisionFilter([TURN] * 6, ALPHA, mode, shared=False)(view_of(state), nominal, LIMITS)
    np.testing.assert_allclose(own.command.array(), shared.command.array(), rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match="3 vehicles have 3 pairs"):
        CollisionFilter([TURN], ALPHA, mode, shared=False)(view_of(state[:3]), nominal[:3], LIMITS)


def seen_by_all(state):
    n = len(state)
    return View(State.of(np.tile(state.array(), (n, 1, 1))), Command.of(np.tile([20.0, 0.0, 0.0], (n, n, 1))))


@pytest.mark.parametrize("mode", MODES)
def test_equal_views_give_what_one_shared_view_gives(mode):
    rng = np.random.default_rng(18)
    state, nominal = safe_state(rng, 5), random_nominal(rng, 5)
    decide = CollisionFilter(TURN, ALPHA, mode)
    one, many = decide(view_of(state), nominal, LIMITS), decide(seen_by_all(state), nominal, LIMITS)
    np.testing.assert_allclose(many.command.array(), one.command.array(), rtol=0, atol=1e-9)
    np.testing.assert_allclose(many.residual, one.residual, rtol=0, atol=1e-9)


def test_each_vehicle_decides_on_its_own_view():
    rng = np.random.default_rng(19)
    n = 4
    worlds = [safe_state(rng, n) for _ in range(n)]
    view = View(State.of([w.array() for w in worlds]), Command.of(np.tile([20.0, 0.0, 0.0], (n, n, 1))))
    nominal = random_nominal(rng, n)
    decide = CollisionFilter(TURN, ALPHA, "limited")
    decision = decide(view, nominal, LIMITS)
    for v, world in enumerate(worlds):
        alone = decide(view_of(world), nominal, LIMITS)
        np.testing.assert_allclose(decision.command[v].array(), alone.command[v].array(), rtol=0, atol=1e-9)
    own = observed_rows(TURN, ALPHA, view, decide.gamma(n))
    np.testing.assert_array_equal(np.bincount(own.vehicles[0]), [n - 1] * n)
    np.testing.assert_allclose(decision.pairs.h, TURN.values(view.own().state).h)


@pytest.mark.parametrize("mode", MODES)
def test_decisions_do_not_depend_on_earlier_ones(mode):
    rng = np.random.default_rng(20)
    cases = [(view_of(safe_state(rng, 6)), random_nominal(rng, 6)) for _ in range(4)]
    decide = CollisionFilter(TURN, ALPHA, mode)
    first = [decide(*c, LIMITS).command.array().tobytes() for c in cases]
    again = [decide(*c, LIMITS).command.array().tobytes() for c in cases[::-1]][::-1]
    assert first == again


def test_passthrough_clips_and_claims_nothing():
    nominal = Command([30.0, 20.0], [0.0, 1.0], [0.0, 0.0])
    decision = Passthrough()(view_of(random_state(np.random.default_rng(0), 2)), nominal, LIMITS)
    np.testing.assert_array_equal(decision.command.array(), LIMITS.clip(nominal).array())
    np.testing.assert_array_equal(decision.status, [Status.NONE] * 2)
    assert decision.pairs is None and decision.hdot_predicted.size == 0
    assert decision.residual.tolist() == [0.0, 0.0] and decision.status.dtype.kind == "i"


def test_limits_may_differ_between_vehicles():
    rng = np.random.default_rng(21)
    limits = Limits([15.0, 10.0, 12.0], [25.0, 30.0, 14.0], [0.2, 0.3, 0.1], [3.9, 1.0, 0.0])
    decision = CollisionFilter(TURN, linear(0.5))(view_of(safe_state(rng, 3)), random_nominal(rng, 3), limits)
    assert np.all(limits.contains(decision.command))


def circle(k, radius=200.0):
    angle = np.pi + 2 * np.pi * np.arange(k) / k
    return State(radius * np.cos(angle), radius * np.sin(angle), angle + np.pi, np.zeros(k))


@pytest.mark.slow
@pytest.mark.parametrize(("k", "mode"), [(20, "limited"), (20, "centralised"), (50, "centralised")])
def test_an_active_circle_is_solved_at_every_step(k, mode):
    from filters.model import step

    barrier = TurnBarrier(16.0, 0.9 * OMEGA_MAX, 5.0, delta=0.01)
    decide = CollisionFilter(barrier, ALPHA, mode)
    state = circle(k)
    goal = State(-state.x, -state.y, state.theta, state.z)
    for n in range(240):
        pull = 0.1 * ((goal.x - state.x) + 1j * (goal.y - state.y)) * np.exp(-1j * state.theta)
        decision = decide(view_of(state), Command(pull.real, pull.imag, -0.1 * state.z), LIMITS)
        assert np.all(decision.status == Status.SOLVED), (n, decision.status)
        assert np.max(decision.residual) <= 1e-6
        state = step(state, decision.command, 0.05)
    np.testing.assert_array_equal(state.z, 0.0)  # in one plane, no rounding lifts them out of it


def test_a_problem_without_a_barrier_still_ends_inside_the_box():
    state = State([-3.0, 3.0], [0.0, 0.0], [0.0, np.pi], [0.0, 0.0])
    rows = rows_of(state, EuclideanBarrier(5.0), linear(1.0))
    lower, upper = (np.tile(c.array(), (2, 1)) for c in (LIMITS.lower, LIMITS.upper))
    u, status, residual = Problem(np.tile([20.0, 0.0, 0.0], (2, 1)), lower, upper).centralised([rows])
    assert (
        np.all((u >= lower) & (u <= upper)) and np.all(status == Status.INFEASIBLE) and np.all(residual > 0)
    )
