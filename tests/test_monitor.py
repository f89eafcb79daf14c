"""The monitor: it changes no decision, finds the theorems true where they apply, and counterexamples."""

import numpy as np
import pytest

from filters.alpha import cubic, linear
from filters.barrier import EuclideanBarrier, TurnBarrier
from filters.collision import CollisionFilter
from filters.monitor import Check, Monitor
from filters.qp import Status
from filters.unicycle import Command, Limits, State, View, step

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
    assert monitor.record.steps == 80


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
    rows = separate.rows(view_of(state))
    gammas = separate.barrier.manoeuvres(rows.i, rows.j, 3)
    assert np.all(np.sum(rows.lie_i * gammas[0], -1) + np.sum(rows.lie_j * gammas[1], -1) >= -1e-12)
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
