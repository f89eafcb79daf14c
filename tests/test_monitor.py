"""The monitor: it changes no decision, finds the theorems true where they apply, and counterexamples."""

import numpy as np
import pytest

from filters.barriers.class_k import cubic, linear
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.cbf.collision import CollisionFilter
from filters.cbf.constraints import own_rows
from filters.cbf.problem import Problem
from filters.cbf.theorem_monitor import Monitor, cosines, theorem_checks
from filters.filter import Check
from filters.model import Command, Limits, State, View, step
from filters.qp.single import Status

OMEGA_MAX = np.deg2rad(13)
LIMITS = Limits(15.0, 25.0, OMEGA_MAX, 3.9)
TURN = TurnBarrier(16.0, 0.9 * OMEGA_MAX, 5.0, smoothing=30.0)


def view_of(state):
    return View(state, Command(np.full(len(state), 20.0), 0.0, 0.0))


def fly_circle(decide, k=6, radius=100.0, seconds=8.0, dt=0.05):
    angle = np.pi + 2 * np.pi * np.arange(k) / k
    state = State(radius * np.cos(angle), radius * np.sin(angle), angle + np.pi, np.zeros(k))
    goal = -(state.x + 1j * state.y)
    for _ in range(round(seconds / dt)):
        pull = 0.1 * (goal - state.x - 1j * state.y) * np.exp(-1j * state.theta)
        state = step(state, decide(view_of(state), Command(pull.real, pull.imag, 0.0), LIMITS).command, dt)
    return state


@pytest.mark.parametrize("mode", ["centralised", "limited"])
def test_a_monitored_filter_flies_as_an_unmonitored_one(mode):
    plain = CollisionFilter(TURN, cubic(0.1), mode)
    monitor = Monitor(plain)
    np.testing.assert_array_equal(
        fly_circle(monitor, seconds=4).array(), fly_circle(plain, seconds=4).array()
    )
    assert monitor.record.steps == 80 and monitor.boundary == 0.05


def test_on_the_circle_theorems_3_and_4_hold_and_limited_communication_costs_more():
    monitor = Monitor(CollisionFilter(TURN, cubic(0.1), "limited"))
    fly_circle(monitor)
    record, checks = monitor.record, monitor.record.checks
    for name in (
        "limited_is_safe",
        "gamma_is_safe",
        "gamma_is_safe_limited",
        "solvable",
        "solvable_limited",
        "cheaper",
    ):
        assert checks[name].checked > 0, name
        assert checks[name].failed == 0, (name, checks[name])
    assert record.compared == record.steps == 160
    assert 0 < record.cost < record.cost_limited


def test_active_rows_of_disjoint_pairs_fail_the_second_part_of_theorem_3():
    # Two head-on pairs far apart: both rows active, their inner product exactly 0.
    state = State([-20.0, 20.0, 2980.0, 3020.0], [0.0] * 4, [0.0, np.pi, 0.0, np.pi], [0.0] * 4)
    monitor = Monitor(CollisionFilter(TURN, linear(0.2)))
    decision = monitor(view_of(state), Command(np.full(4, 20.0), 0.0, 0.0), LIMITS)
    assert np.all(decision.status == Status.SOLVED)
    aligned = monitor.record.checks["aligned"]
    assert aligned.failed == aligned.checked == 1
    assert aligned.worst == 0.0
    assert aligned.first == (0, (1, 2, 3, 4))


def test_a_pair_at_the_boundary_has_a_gradient():
    monitor = Monitor(CollisionFilter(TURN, cubic(0.1)), boundary=5.0)
    fly_circle(monitor)
    gradient = monitor.record.checks["gradient"]
    assert gradient.checked > 0 and gradient.failed == 0 and 0.1 < gradient.worst < np.inf


def test_without_a_manoeuvre_only_what_needs_none_is_checked():
    monitor = Monitor(CollisionFilter(EuclideanBarrier(5.0), linear(1.0)))
    state = State([-50.0, 50.0], [0.0, 0.0], [0.0, np.pi], [0.0, 0.0])
    monitor(view_of(state), Command([20.0, 20.0], 0.0, 0.0), LIMITS)
    assert monitor.record.checks["solvable"].checked == 1
    assert monitor.record.checks["limited_is_safe"].checked == 0


@pytest.mark.parametrize("form", ["root", "squared"])
def test_the_papers_three_vehicles_are_unsolvable_inside_the_safe_set_unless_they_share_gamma(form):
    # "Composition", Motivating Example: pair (1, 2) evades to the right, the others to the left; all h are 0.
    east, north = 2.5 * np.sqrt(0.19), 0.25
    state = State([0.0, east, east], [0.0, north, -north], [0.0, np.pi, np.pi], [0.0] * 3)
    limits = Limits(1.0, 2.0, 1.0, 1.0)
    nominal = Command([1.0] * 3, 0.0, 0.0)
    right, left = (TurnBarrier(1.0, w, 0.5, form=form) for w in (-1.0, 1.0))
    separate = CollisionFilter([right, left, left], cubic(1.0), shared=False)
    decision = separate(view_of(state), nominal, limits)
    np.testing.assert_allclose(decision.pairs.h, 0.0, atol=1e-12)
    np.testing.assert_array_equal(decision.status, [Status.INFEASIBLE] * 3)
    assert np.all(limits.contains(decision.command)) and np.all(decision.residual > 0.1)
    # Each pair's own gamma satisfies its row, yet no input satisfies all three.
    (rows,) = separate.constraints(view_of(state))
    gammas = separate.barrier.manoeuvres(*rows.vehicles, 3)
    assert np.all(np.sum(np.multiply(rows.lie, gammas), axis=(0, -1)) >= -1e-12)
    # Sharing gamma does not rescue this state but puts it outside the safe set.
    shared = CollisionFilter(left, cubic(1.0))(view_of(state), nominal, limits)
    assert shared.pairs.h[0] == pytest.approx({"root": -0.43845, "squared": -0.24621}[form], abs=1e-5)


def test_the_monitor_reports_an_unsolvable_qp_inside_the_safe_set():
    east, north = 2.5 * np.sqrt(0.19), 0.25 + 1e-9
    state = State([0.0, east, east], [0.0, north, -north], [0.0, np.pi, np.pi], [0.0] * 3)
    right, left = (TurnBarrier(1.0, w, 0.5) for w in (-1.0, 1.0))
    monitor = Monitor(CollisionFilter([right, left, left], cubic(1.0), shared=False))
    monitor(view_of(state), Command([1.0] * 3, 0.0, 0.0), Limits(1.0, 2.0, 1.0, 1.0))
    checks = monitor.record.checks
    assert checks["solvable"].failed == checks["solvable"].checked == 1
    assert checks["gamma_is_safe"].checked == 0  # there is no shared gamma


def test_a_check_remembers_the_first_failure_and_the_worst_and_counts_nan_as_failing():
    check = Check("x", 0.0)
    v = np.array([0, 1])
    check.see(3, np.array([1.0, -1.0]), v)
    check.see(4, np.array([-2.0, np.nan]), v)
    assert (check.checked, check.failed, check.first) == (4, 3, (3, (2,)))
    check.see(5, np.array([-3.0]), v)
    assert (check.worst, check.worst_at) == (-3.0, (5, (1,)))


def test_a_check_of_nothing_but_nan_has_failures_and_no_worst():
    check = Check("x", 0.0)
    check.see(2, np.array([np.nan]), np.array([4]))
    assert (check.checked, check.failed, check.first) == (1, 1, (2, (5,)))
    assert check.worst == np.inf and check.worst_at is None
    check.see(3, np.zeros(0), np.zeros(0, dtype=int))
    assert check.checked == 1


def test_exactly_at_its_bound_a_check_passes():
    check = Check("x", -1.0)
    check.see(0, np.array([-1.0]), np.array([0]))
    assert (check.failed, check.first, check.worst) == (0, None, -1.0)


def test_the_claims_are_those_of_the_theorems_with_their_units_and_bounds():
    claims = {name: (check.claim, check.least) for name, check in theorem_checks().items()}
    assert claims == {
        "limited_is_safe": ("limited-communication inputs satisfy the centralised rows [m/s]", -1e-6),
        "gamma_is_safe": ("gamma satisfies the row of every pair with h >= 0 [m/s]", -1e-6),
        "gamma_is_safe_limited": ("gamma satisfies both limited rows of such a pair [m/s]", -1e-6),
        "solvable": ("inside the safe set the centralised QP is solved (1 or 0)", 1.0),
        "solvable_limited": ("inside the safe set every limited QP is solved (1 or 0)", 1.0),
        "aligned": ("active rows of the centralised QP have positive inner products [cosine]", 1e-12),
        "aligned_limited": ("active rows of each limited QP have positive inner products [cosine]", 1e-12),
        "gradient": ("L_g h is not zero at the boundary [norm over m/s, rad/s, m/s]", 1e-12),
        "cheaper": ("the centralised QP costs no more than the limited ones", -1e-6),
    }


def test_cosines_are_those_of_every_pair_and_zero_with_nothing():
    vectors = np.array([[2.0, 0.0, 0.0], [3.0, 3.0, 0.0], [0.0, 0.0, 0.0], [-0.5, 0.0, 0.0]])
    half = np.sqrt(0.5)
    np.testing.assert_allclose(cosines(vectors), [half, 0.0, -1.0, 0.0, -half, 0.0], atol=1e-15)


def crowd():
    """Four vehicles about to meet, some pairs' rows active in both QPs, and what they want."""
    angle = np.pi / 2 * np.arange(4) + [0.11, 0.09, 0.03, -0.31]
    radius = 37.0 * np.array([1.09, 0.96, 1.0, 0.85])
    state = State(radius * np.cos(angle), radius * np.sin(angle), angle + np.pi, [0.0, 1.0, -1.0, 2.0])
    return view_of(state), Command(np.full(4, 24.0), 0.0, 0.0)


def worst_of(numbers, *vehicles):
    """Smallest number and the vehicles, from 1, of its place."""
    k = int(np.argmin(numbers))
    return numbers[k], tuple(int(v[k]) + 1 for v in vehicles)


def test_at_one_step_the_monitor_sees_what_the_rows_and_both_qps_say():
    view, nominal = crowd()
    filter_ = CollisionFilter(TURN, linear(0.2))
    monitor = Monitor(filter_, boundary=8.0)
    monitor.record.steps = 7  # not the first step
    monitor(view, nominal, LIMITS)
    seen = monitor.record.checks

    (rows,), gamma = filter_.constraints(view), filter_.gamma(4)
    problem = filter_.problem(view, nominal, LIMITS)
    own = own_rows([rows], filter_.shares([rows], 4))
    (u, status, _), (v, status_own, _) = problem.centralised([rows]), problem.limited(own)
    assert np.all(status == Status.SOLVED) and np.all(status_own == Status.SOLVED)
    (i, j), safe = rows.vehicles, rows.h >= 0
    edge = np.abs(rows.h) <= 8.0
    assert 0 < edge.sum() < 6
    size = np.linalg.norm(np.hstack(rows.lie), axis=1)
    twice = np.tile(safe, 2)
    expected = {
        "gradient": (size[edge], i[edge], j[edge]),
        "limited_is_safe": (rows.left(v) - rows.rhs, i, j),
        "gamma_is_safe": ((rows.left(gamma) - rows.rhs)[safe], i[safe], j[safe]),
        "gamma_is_safe_limited": ((own.left(gamma) - own.rhs)[twice], own.vehicles[0][twice]),
        "solvable": (np.ones(1),),
        "solvable_limited": (np.ones(4), np.arange(4)),
    }
    for name, (numbers, *vehicles) in expected.items():
        assert seen[name].checked == numbers.size > 0, name
        worst, who = worst_of(numbers, *vehicles)
        assert seen[name].worst == pytest.approx(worst, abs=1e-9), name
        assert seen[name].worst_at == (7, who), name

    cost, cost_limited = (np.sum((w - problem.target) ** 2) for w in (u, v))
    record = monitor.record
    assert (record.compared, record.steps) == (1, 8)
    assert (record.cost, record.cost_limited) == pytest.approx((cost, cost_limited))
    assert seen["cheaper"].worst == pytest.approx((cost_limited - cost) / max(1.0, cost))
    assert seen["cheaper"].worst_at == (7, ())
    monitor(view, nominal, LIMITS)
    assert (record.cost, record.cost_limited) == pytest.approx((2 * cost, 2 * cost_limited))
    assert (record.compared, record.steps, seen["cheaper"].checked) == (2, 9, 2)

    active = np.flatnonzero(np.abs(rows.left(u) - rows.rhs) <= 1e-6 * size)
    full = np.zeros((len(active), 4, 3))
    for r, p in enumerate(active):
        full[r, i[p]], full[r, j[p]] = rows.lie[0][p], rows.lie[1][p]
    unit = full.reshape(len(active), -1) / size[active, None]
    pairs = [(a, b) for a in range(len(active)) for b in range(a + 1, len(active))]
    assert seen["aligned"].checked == 2 * len(pairs) > 0
    worst = min(pairs, key=lambda ab: unit[ab[0]] @ unit[ab[1]])
    assert seen["aligned"].worst == pytest.approx(unit[worst[0]] @ unit[worst[1]], abs=1e-9)
    assert seen["aligned"].worst_at[0] == 7
    assert set(seen["aligned"].worst_at[1]) <= {1, 2, 3, 4} and len(seen["aligned"].worst_at[1]) == 4

    found = []
    for vehicle in range(4):
        mine = np.flatnonzero(own.vehicles[0] == vehicle)
        tight = mine[np.abs(own.left(v) - own.rhs)[mine] <= 1e-6 * np.linalg.norm(own.lie[0][mine], axis=1)]
        found += [(vehicle, c) for c in cosines(own.lie[0][tight])]
    assert seen["aligned_limited"].checked == 2 * len(found) > 0
    vehicle, cosine = min(found, key=lambda pair: pair[1])
    assert seen["aligned_limited"].worst == pytest.approx(cosine, abs=1e-9)
    assert seen["aligned_limited"].worst_at == (7, (vehicle + 1,))


def test_a_pair_exactly_on_the_boundary_is_inside():
    straight = EuclideanBarrier(5.0, gamma=Command(16.0, 0.0, 0.0))
    monitor = Monitor(CollisionFilter(straight, linear(1.0)), boundary=0.0)
    monitor(view_of(State([0.0, 5.0], 0.0, 0.0, 0.0)), Command([16.0, 16.0], 0.0, 0.0), LIMITS)
    seen = monitor.record.checks
    for name, count in (("gamma_is_safe", 1), ("gamma_is_safe_limited", 2), ("solvable", 1), ("gradient", 1)):
        assert seen[name].checked == count, name


def test_outside_the_safe_set_nothing_is_claimed_of_gamma_or_of_solvability():
    monitor = Monitor(CollisionFilter(TURN, linear(1.0)))
    monitor(view_of(State([0.0, 3.0], 0.0, [0.0, np.pi], 0.0)), Command([20.0] * 2, 0.0, 0.0), LIMITS)
    seen = monitor.record.checks
    for name in ("gamma_is_safe", "gamma_is_safe_limited", "solvable", "solvable_limited"):
        assert seen[name].checked == 0, name


def test_what_was_not_solved_is_neither_compared_nor_blamed_on_the_theorems(monkeypatch):
    view, nominal = crowd()
    target, everyone = nominal.array(), np.full(4, int(Status.SOLVED))
    apart = target + 0.5  # costs 12 times 0.25 more than nothing

    def watch(status, status_limited):
        monkeypatch.setattr(Problem, "centralised", lambda self, rows: (target, status, np.zeros(4)))
        monkeypatch.setattr(Problem, "limited", lambda self, own: (apart, status_limited, np.zeros(4)))
        monitor = Monitor(CollisionFilter(TURN, linear(0.2)))
        monitor(view, nominal, LIMITS)
        return monitor.record

    record = watch(everyone, everyone)
    assert (record.compared, record.cost, record.cost_limited) == (1, 0.0, 3.0)
    assert record.checks["cheaper"].worst == 3.0
    unsolved = np.where(np.arange(4) == 1, int(Status.INFEASIBLE), everyone)
    record = watch(unsolved, everyone)
    assert record.compared == record.checks["cheaper"].checked == record.checks["aligned"].checked == 0
    assert record.checks["solvable"].failed == 1
    record = watch(everyone, unsolved)
    assert record.compared == 0 and record.checks["solvable_limited"].first == (0, (2,))
    assert record.checks["limited_is_safe"].checked == 3  # the pairs without vehicle 2


def test_the_monitor_solves_with_the_filters_own_solver(monkeypatch):
    def forbidden(*_):
        raise AssertionError("only OSQP was to be asked")

    for name in ("attempt", "attempt_each"):
        monkeypatch.setattr(f"filters.qp.active_set.{name}", forbidden)
    view, nominal = crowd()
    monitor = Monitor(CollisionFilter(TURN, linear(0.2), solver="osqp"))
    monitor(view, nominal, LIMITS)
    assert monitor.record.compared == 1
