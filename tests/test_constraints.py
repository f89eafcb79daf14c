"""Constraints over one, two and three vehicles, with L_f h, in one filter: checked with another QP solver."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

from filters.barriers.class_k import cubic, linear
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.cbf.collision import CollisionFilter
from filters.cbf.theorem_monitor import Monitor
from filters.constraints import Constraints
from filters.filter import declaration
from filters.model import Command, Limits, State, View
from filters.qp.single import Status
from filters.wrappers.pose_prediction import Horizon, Predicted
from filters.wrappers.row_margins import BoundedError

OMEGA_MAX = np.deg2rad(13)
LIMITS = Limits(15.0, 25.0, OMEGA_MAX, 3.9)
TURN = TurnBarrier(16.0, 0.9 * OMEGA_MAX, 5.0, smoothing=30.0)
ALPHA = linear(1.0)
MODES = ["centralised", "limited"]
# The fence moves towards the vehicles; the point that the centroid of three of them must avoid moves too.
FENCE_SPEED = 3.0
POINT_VELOCITY = np.array([1.5, -2.0, 0.5])
POINT, RADIUS = np.array([10.0, -5.0, 3.0]), 12.0


def headings(state):
    return np.stack([np.cos(state.theta), np.sin(state.theta), np.zeros(len(state))], axis=-1)


def fence(view):
    """h = y + 60 - 3 t at t = 0, of every vehicle: L_f h = -3."""
    n = len(view.state)
    lie = np.zeros((n, 3))
    lie[:, 0] = np.sin(view.state.theta)
    h = view.state.y + 60.0
    return (Constraints.of((np.arange(n),), (lie,), h, ALPHA(h), np.full(n, -FENCE_SPEED)),)


def centroid(view):
    """h = |c - p| - R of the centroid c of vehicles 1 to 3 and a point p that moves: L_f h = -n p'."""
    c = view.state.position[:3].mean(axis=0) - POINT
    away = c / np.linalg.norm(c)
    along = headings(view.state)[:3] @ away / 3
    lies = tuple(np.array([[along[s], 0.0, away[2] / 3]]) for s in range(3))
    h = np.array([np.linalg.norm(c) - RADIUS])
    vehicles = tuple(np.array([s]) for s in range(3))
    return (Constraints.of(vehicles, lies, h, ALPHA(h), np.array([-away @ POINT_VELOCITY])),)


def scene(seed, n=4):
    rng = np.random.default_rng(seed)
    x, y, theta, z = (rng.uniform(*ends, n) for ends in ((-60, 60), (-45, 40), (-9, 9), (-5, 5)))
    state = State(x, y, theta, z)
    v, omega, zeta = rng.uniform(12, 28, n), rng.uniform(-0.3, 0.3, n), rng.uniform(-5, 5, n)
    return View(state, Command(np.full(n, 20.0), 0.0, 0.0)), Command(v, omega, zeta)


def nearest(target, matrix, rhs, lower, upper):
    """The QP by other means, every row kept: linear programming for whether it has a solution, then its dual.

    None where no input satisfies all rows; a case too close to call is not looked at.
    """
    m, n = matrix.shape
    best = linprog(
        np.r_[np.zeros(n), -1.0],
        A_ub=np.column_stack([-matrix, np.ones(m)]),
        b_ub=-rhs,
        bounds=[*zip(lower, upper, strict=True), (None, 100.0)],
    )
    assume(abs(best.x[-1]) > 1e-4)
    if best.x[-1] < 0:
        return None
    length = np.linalg.norm(matrix, axis=1)
    rows, level = matrix / length[:, None], rhs / length

    def dual(y):
        u = np.clip(target + y @ rows, lower, upper)
        return -0.5 * np.sum((u - target) ** 2) - y @ (level - rows @ u), rows @ u - level

    options = {"ftol": 0, "gtol": 1e-12, "maxiter": 5000}
    y = minimize(
        dual,
        np.zeros(m),
        jac=True,
        bounds=[(0, None)] * m,
        options=options,
    ).x
    # Exact for the rows and limits found active.
    active = y > 1e-7
    wanted = target + y @ rows
    free = (wanted > lower) & (wanted < upper)
    u = np.clip(wanted, lower, upper)
    a = rows[np.ix_(active, free)]
    short = level[active] - rows[active] @ np.where(free, target, u)
    u[free] = target[free] + np.linalg.lstsq(a, short, rcond=None)[0] if active.any() else target[free]
    return u


def dense(blocks, n):
    """All rows of the blocks over 3 n inputs."""
    lines, rhs = [], []
    for block in blocks:
        for r in range(block.rhs.size):
            line = np.zeros((n, 3))
            for vehicle, lie in zip(block.vehicles, block.lie, strict=True):
                line[vehicle[r]] = lie[r]
            lines.append(line.ravel())
            rhs.append(block.rhs[r])
    return np.array(lines), np.array(rhs)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_centralised_commands_are_the_nearest_that_satisfy_pairs_fence_and_centroid(seed):
    view, nominal = scene(seed)
    filter_ = CollisionFilter(TURN, ALPHA, also=[fence, centroid])
    blocks = filter_.constraints(view)
    assert [len(block.vehicles) for block in blocks] == [2, 1, 3]
    lower, upper = (np.tile(c.array(), (4, 1)).ravel() for c in (LIMITS.lower, LIMITS.upper))
    matrix, rhs = dense(blocks, 4)
    expected = nearest(nominal.array().ravel(), matrix, rhs, lower, upper)
    decision = filter_(view, nominal, LIMITS)
    u = decision.command.array()
    if np.all(decision.status == Status.SOLVED):
        assert np.all(matrix @ u.ravel() >= rhs - 1e-6) and np.all(LIMITS.contains(decision.command))
        assert np.max(decision.residual) <= 1e-6
        assert expected is not None
        np.testing.assert_allclose(u.ravel(), expected, rtol=0, atol=2e-5)
    else:
        assert expected is None


def test_rows_of_every_kind_bind_and_move_commands_in_both_modes():
    """The scenes above are no use if only pairs ever matter."""
    bound = dict.fromkeys(MODES, np.zeros(3, dtype=int))
    for mode in MODES:
        filter_ = CollisionFilter(TURN, ALPHA, mode, also=[fence, centroid])
        for seed in range(120):
            view, nominal = scene(seed)
            decision = filter_(view, nominal, LIMITS)
            if not np.all(decision.status == Status.SOLVED):
                continue
            u = decision.command.array()
            blocks = filter_.constraints(view)
            if mode == "centralised":
                tight = [np.any(np.abs(b.left(u) - b.rhs) < 1e-6) for b in blocks]
            else:
                each = filter_.shares(blocks, 4)
                tight = [
                    np.any(np.abs(np.array(b.parts(u)) - np.array(s)) < 1e-6)
                    for b, s in zip(blocks, each, strict=True)
                ]
            bound[mode] = bound[mode] + np.array(tight)
    assert all(np.all(count >= 3) for count in bound.values()), bound


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_limited_commands_are_the_nearest_that_satisfy_each_vehicles_shares(seed):
    view, nominal = scene(seed)
    filter_ = CollisionFilter(TURN, ALPHA, "limited", also=[fence, centroid])
    decision, blocks, gamma = filter_(view, nominal, LIMITS), filter_.constraints(view), filter_.gamma(4)
    u = decision.command.array()
    lower, upper = LIMITS.lower.array(), LIMITS.upper.array()
    for vehicle in range(4):
        lines, rhs = [], []
        for block in blocks:
            k = len(block.vehicles)
            for r in range(block.rhs.size):
                members = [int(v[r]) for v in block.vehicles]
                if vehicle not in members:
                    continue
                at_gamma = [lie[r] @ gamma[who] for lie, who in zip(block.lie, members, strict=True)]
                side = members.index(vehicle)
                lines.append(block.lie[side][r])
                # What all flying gamma leaves over, alpha(h) + L_f h + L_g h gamma, is shared by k.
                rhs.append(at_gamma[side] - (sum(at_gamma) - block.rhs[r]) / k)
        expected = nearest(nominal.array()[vehicle], np.array(lines), np.array(rhs), lower, upper)
        if decision.status[vehicle] == Status.SOLVED:
            assert expected is not None
            np.testing.assert_allclose(u[vehicle], expected, rtol=0, atol=2e-5)
        else:
            assert expected is None
    if np.all(decision.status == Status.SOLVED):  # limited communication implies the centralised rows
        matrix, rhs = dense(blocks, 4)
        assert np.all(matrix @ u.ravel() >= rhs - 1e-6)


def test_with_views_of_their_own_every_vehicle_takes_its_share_of_what_it_sees():
    worlds = [scene(seed)[0].state for seed in range(4)]
    view = View(State.of([w.array() for w in worlds]), Command.of(np.tile([20.0, 0.0, 0.0], (4, 4, 1))))
    _, nominal = scene(9)
    margin = BoundedError(0.2, 0.01, 0.1)
    decide = CollisionFilter(TURN, ALPHA, "limited", margin=margin, also=[fence, centroid])
    decision = decide(view, nominal, LIMITS)
    for vehicle, world in enumerate(worlds):
        alone = decide(View(world, view.of(vehicle).rates), nominal, LIMITS)
        np.testing.assert_allclose(
            decision.command[vehicle].array(), alone.command[vehicle].array(), rtol=0, atol=1e-9
        )
        assert decision.status[vehicle] == alone.status[vehicle]


def test_the_drift_of_h_moves_what_a_row_asks_for():
    h = np.array([2.0])
    still, moving = (
        Constraints.of((np.array([0]),), (np.array([[1.0, 0.0, 0.0]]),), h, ALPHA(h), drift)
        for drift in (0.0, np.array([-3.0]))
    )
    assert moving.rhs[0] == still.rhs[0] + 3.0 and still.rhs[0] == -ALPHA(2.0)


def test_margins_are_added_for_each_vehicle_of_a_row():
    view, _ = scene(1)
    margin = BoundedError(0.5, 0.02, 0.1)
    for block in (*fence(view), *centroid(view)):
        due = block.rhs + sum(margin(lie) for lie in block.lie)
        np.testing.assert_allclose(block.raised(margin).rhs, due, rtol=1e-14)
    assert block.raised(None) is block


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["h", "alpha", "drift", "lie"])
def test_a_number_that_is_not_finite_is_refused_naming_the_vehicles_of_its_row(bad, where):
    vehicles = tuple(np.array([s, s + 1]) for s in (0, 2, 4))
    numbers = {name: np.ones(2) for name in ("h", "alpha", "drift")} | {"lie": np.ones((2, 3))}
    numbers[where][1] = bad
    lie = (np.ones((2, 3)), numbers["lie"], np.ones((2, 3)))
    with pytest.raises(FloatingPointError, match=r"vehicles 2 and 4 and 6 \(row 2 of 2\) is not finite"):
        Constraints.of(vehicles, lie, numbers["h"], numbers["alpha"], numbers["drift"])
    with pytest.raises(FloatingPointError, match=r"of vehicle 2 \(row 2 of 2\)"):
        Constraints.of(vehicles[:1], (numbers["lie"],), numbers["h"], numbers["alpha"], numbers["drift"])


def test_a_fence_needs_no_manoeuvre_and_rows_over_several_vehicles_do():
    view, nominal = scene(2)
    alone = CollisionFilter(EuclideanBarrier(5.0), cubic(0.1), "limited", also=[fence])
    with pytest.raises(ValueError, match="limited communication splits a row by an evading manoeuvre"):
        alone(view, nominal, LIMITS)
    one, wanted = (part[[0]] for part in (view.state, nominal))
    decision = alone(View(one, view.rates[[0]]), wanted, LIMITS)
    (block,) = fence(View(one, view.rates[[0]]))
    assert np.all(block.left(decision.command.array()) >= block.rhs - 1e-6)


def test_a_monitor_looks_at_rows_of_every_kind():
    view, nominal = scene(4)
    plain, composed = (Monitor(CollisionFilter(TURN, ALPHA, also=a)) for a in ((), (fence, centroid)))
    for monitor in (plain, composed):
        monitor(view, nominal, LIMITS)
    pairs, seen = plain.record.checks, composed.record.checks
    blocks = composed.filter.constraints(view)
    assert np.all(np.concatenate([b.h for b in blocks]) > 0) and seen["solvable"].checked == 1
    # six pairs, four fences, one centroid; one share for each vehicle of each
    assert pairs["gamma_is_safe"].checked == 6 and seen["gamma_is_safe"].checked == 11
    assert seen["gamma_is_safe_limited"].checked == 12 + 4 + 3
    slack = [b.left(composed.filter.gamma(4)) - b.rhs for b in blocks]
    assert seen["gamma_is_safe"].worst == pytest.approx(min(s.min() for s in slack))


def test_what_a_filter_declares_are_the_rows_it_solves():
    view, _ = scene(3)
    filter_ = CollisionFilter(TURN, ALPHA, also=[fence])
    said = declaration(filter_)
    assert said.barrier is TURN and said.alpha is ALPHA and said.solves_qp and said.paper
    assert [len(b.vehicles) for b in said.constraints(view)] == [2, 1]
    ahead = Predicted(filter_, Horizon(0.5))
    later = View(Horizon(0.5)(view.state, view.rates), view.rates)
    told = declaration(ahead)
    assert told.barrier is None and told.solves_qp and told.paper
    for got, due in zip(told.constraints(view), filter_.constraints(later), strict=True):
        np.testing.assert_array_equal(got.rhs, due.rhs)
    monitored = declaration(Predicted(Monitor(filter_), Horizon(0.5)))
    assert monitored.record is not None and monitored.record.steps == 0


def test_a_callable_that_declares_nothing_declares_nothing():
    class Bold:
        barrier = TURN

        def __call__(self, view, nominal, limits): ...

    said = declaration(Bold())
    assert (said.barrier, said.constraints, said.solves_qp, said.paper) == (None, None, False, False)
    wrapped = declaration(Predicted(Bold(), Horizon(0.5)))
    assert wrapped.constraints is None and not wrapped.paper
