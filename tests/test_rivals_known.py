"""Rivals against their defining properties, on cases with a known answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from filters.barriers.class_k import linear
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.cbf.collision import CollisionFilter
from filters.cbf.constraints import pair_rows
from filters.cbf.problem import Problem, input_set
from filters.model import Command, Limits, State, View, step
from filters.qp.batch import solve_each
from filters.qp.single import Status, best_margin
from filters.rivals.collision_cone import CollisionConeFilter, cone
from filters.rivals.least_violation import solve_or_violate_least
from filters.rivals.optimal_decay import OptimalDecayFilter
from filters.rivals.velocity_obstacles import VelocityObstacleFilter, least_change, least_height, velocity
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from testbed.verification.check import verify
from tests.forgery import copied, differing, edit_entry, edit_table, entry, read, seal, write

DS = 5.0
BOX = (15.0, 25.0, np.radians(13.0), 3.9)


def limits(n: int) -> Limits:
    return Limits(*(np.full(n, x) for x in BOX))


def wanted(n: int) -> Command:
    return Command(np.full(n, 20.0), np.zeros(n), np.zeros(n))


def meeting(miss: float = 0.0, apart: float = 100.0) -> View:
    """Two at 20 m/s on opposite courses, `apart` m, the second `miss` m to the left of the first's path."""
    state = State(np.array([0.0, apart]), np.array([0.0, miss]), np.array([0.0, np.pi]), np.zeros(2))
    return View(state, wanted(2))


vectors = st.tuples(*[st.floats(-200, 200)] * 3).map(np.array)
velocities = st.tuples(st.floats(-40, 40), st.floats(-40, 40), st.floats(-4, 4)).map(np.array)


def distance(p: np.ndarray, w: np.ndarray, until: float) -> float:
    """m, the least |p + w t| over t in [0, until]."""
    t = np.clip(-(p @ w) / max(w @ w, 1e-300), 0.0, until)
    return float(np.linalg.norm(p + w * t))


@pytest.mark.parametrize("still", [False, True])
def test_inputs_are_the_qps_where_it_has_a_solution_and_violate_least_where_not(still: bool) -> None:
    rng, n = np.random.default_rng(3), 40
    owner = np.repeat(np.arange(n), 4)
    rows, level = rng.normal(size=(4 * n, 3)), rng.uniform(-10, 14, 4 * n)
    lower, upper = (
        np.tile([14.0, -5.0, 0.0 if still else -4.0], (n, 1)),
        np.tile([25.0, 5, 0 if still else 4], (n, 1)),
    )
    target = rng.uniform(-10, 30, (n, 3))
    exact, status = solve_each(target, owner, rows, level, lower, upper)
    u, said = solve_or_violate_least(target, owner, rows, level, lower, upper)
    assert (said == status).all() and {int(s) for s in status} == {1, 2}
    solved = status == Status.SOLVED
    assert np.allclose(u[solved], exact[solved], atol=1e-7)
    assert (u >= lower).all() and (u <= upper).all()
    unit = np.linalg.norm(rows, axis=1)
    for k in np.flatnonzero(~solved):
        own = owner == k
        scaled, due = rows[own] / unit[own, None], level[own] / unit[own]
        best, _ = best_margin(scaled, due, lower[k], upper[k])
        assert np.min(scaled @ u[k] - due) == pytest.approx(best, abs=1e-6)


# Collision cone


@settings(max_examples=200, deadline=None)
@given(vectors, velocities)
def test_the_cones_h_is_negative_where_keeping_the_velocities_comes_too_near(
    p: np.ndarray, w: np.ndarray
) -> None:
    # Nearer than 1.005 Ds the tangent is held at a least length.
    if np.linalg.norm(p) < 1.01 * DS or np.linalg.norm(w) < 1e-3:
        return
    nearest = distance(p, w, np.inf)
    h = float(cone(p[None], w[None], DS)[0][0])
    if abs(nearest - DS) > 1e-6:
        assert (h >= 0) == (nearest >= DS)


@pytest.mark.parametrize("apart", [6.0, 50.0, 400.0])
def test_the_cones_border_is_the_tangent(apart: float) -> None:
    half = np.arcsin(DS / apart)
    p = np.array([[apart, 0.0, 0.0]])
    w = -30.0 * np.array([[np.cos(half), np.sin(half), 0.0]])
    h, tangent, speed = cone(p, w, DS)
    assert abs(h[0]) < 1e-9 and speed[0] == pytest.approx(30.0)
    assert tangent[0] == pytest.approx(np.sqrt(apart**2 - DS**2))
    assert h[0] == pytest.approx(p[0] @ w[0] + apart * 30.0 * np.cos(half))


def test_the_rows_are_the_rate_of_h_along_the_motion() -> None:
    rng = np.random.default_rng(4)
    f = CollisionConeFilter(DS, 0.7, 0.8, 1.3, 1e4)
    state = State(*rng.uniform(-80, 80, (2, 4)), rng.uniform(-3, 3, 4), rng.uniform(-9, 9, 4))
    rates = Command(rng.uniform(15, 25, 4), np.zeros(4), rng.uniform(-3, 3, 4))
    u = np.column_stack([rng.uniform(15, 25, 4), rng.uniform(-0.2, 0.2, 4), rng.uniform(-3, 3, 4)])
    rows, other = f.rows(View(state, rates))
    hdot = rows.left(u) + rows.drift
    for r, (i, j) in enumerate(zip(rows.vehicles[0], other, strict=True)):

        def h(t: float, i: int = i, j: int = j) -> float:
            """With i under its command, its speeds changing as the model says, and j keeping its velocity."""
            v = rates.v[i] + (u[i, 0] - rates.v[i]) * t / 0.8
            climb = rates.zeta[i] + (u[i, 2] - rates.zeta[i]) * t / 1.3
            now = velocity(state.theta, rates)
            mine = velocity(state.theta[i] + u[i, 1] * t, Command.of(np.array([v, 0.0, climb])))
            p = state.position[j] + now[j] * t - state.position[i] - now[i] * t
            return float(cone(p[None], (now[j] - mine)[None], DS)[0][0])

        assert hdot[r] == pytest.approx((h(1e-5) - h(-1e-5)) / 2e-5, rel=1e-5, abs=1e-3)
        assert rows.rhs[r] == pytest.approx(-0.7 * rows.h[r] - rows.drift[r])


@settings(max_examples=100, deadline=None)
@given(vectors, velocities, st.floats(-np.pi, np.pi))
def test_whatever_the_state_some_acceleration_moves_the_cones_h(
    p: np.ndarray, w: np.ndarray, course: float
) -> None:
    """The authors' theorem, L_g h != 0: |p + w s / |w|| >= |p| - s = r^2 / (|p| + s), s the tangent."""
    far = np.linalg.norm(p)
    if far < 1.01 * DS or np.linalg.norm(w) < 1e-3:
        return
    state = State(*np.column_stack([np.zeros(3), p])[:2], np.array([0.0, course]), np.array([0.0, p[2]]))
    rates = Command(np.full(2, 20.0), np.zeros(2), np.array([0.0, w[2]]))
    rows, _ = CollisionConeFilter(DS, 1.0, 0.8, 1.3, 1e4).rows(View(state, rates))
    lever = np.linalg.norm(rows.lie[0] * np.array([0.8, 1 / 20.0, 1.3]), axis=1)
    assert (lever >= 0.999 * DS**2 / (far + np.sqrt(far**2 - DS**2)) - 1e-9).all()


def test_a_vehicle_outside_the_cone_stays_outside_while_the_other_keeps_its_velocity() -> None:
    f, dt = CollisionConeFilter(DS, 2.0, 0.02, 1.0, 1e4), 0.02
    state, rates, least = meeting(miss=6.0, apart=150.0).state, wanted(2), np.inf
    pull = Command(np.array([20.0, 20.0]), np.array([0.2, 0.0]), np.zeros(2))  # towards the other's path
    for _ in range(200):
        d = f(View(state, rates), pull, limits(2))
        rates = Command.of(np.vstack([d.command.array()[0], [20.0, 0.0, 0.0]]))
        state = step(state, rates, dt)
        least = min(least, float(np.hypot(state.x[0] - state.x[1], state.y[0] - state.y[1])))
    assert least >= DS - 0.02 and d.status[0] == Status.SOLVED
    # Unfiltered, the pull leads the first across the other's way.
    assert f.record.checks["cone_kept"].checked and f.record.checks["cone_start"].failed == 0


def test_the_cones_record_tells_who_was_met_inside() -> None:
    f = CollisionConeFilter(DS)
    f(meeting(), wanted(2), limits(2))
    assert f.record.checks["cone_start"].failed == 2 and f.record.checks["cone_kept"].checked == 0


# Optimal decay

TURN = TurnBarrier(16.0, np.radians(11.7), DS, smoothing=30.0)


def plain(view: View, u: Command, barrier: object = TURN, rate: float = 0.5) -> object:
    return CollisionFilter(barrier, linear(rate))(view, u, limits(len(view.state)))  # type: ignore[arg-type]


def test_with_a_dear_decay_it_is_the_plain_qp_and_with_a_cheap_one_it_alters_less() -> None:
    view = meeting(apart=60.0)
    exact = plain(view, wanted(2)).command.array()  # type: ignore[attr-defined]
    found = {
        p: OptimalDecayFilter(TURN, linear(0.5), p)(view, wanted(2), limits(2)).command.array()
        for p in (1e-3, 1e6)
    }
    assert np.abs(exact - wanted(2).array()).max() > 0.01
    assert np.allclose(found[1e6], exact, atol=1e-4)
    assert np.abs(found[1e-3] - wanted(2).array()).max() < 0.5 * np.abs(exact - wanted(2).array()).max()


def test_where_the_plain_rows_have_no_solution_it_has_one() -> None:
    """Squires et al. 2022, Motivating Example: head-on, the Euclidean distance falls whatever is flown."""
    barrier = EuclideanBarrier(DS, gamma=Command.of(np.array([16.0, 0.2, 0.0])))
    view = meeting(apart=8.0)
    refused = plain(view, wanted(2), barrier)
    assert (refused.status == Status.INFEASIBLE).all()  # type: ignore[attr-defined]
    f = OptimalDecayFilter(barrier, linear(0.5), 1.0)
    assert (f(view, wanted(2), limits(2)).status == Status.SOLVED).all()
    rows = pair_rows(barrier.values(view.state), view.state, linear(0.5))
    _, _, (decay,), residual = f.solve(Problem(*input_set(view, wanted(2), limits(2))), (rows,))
    # hdot is at best -2 v_min, and 3 m of h give 1.5 m/s: the factor has to be at least 20.
    assert decay[0] >= 2 * 15.0 / 1.5 - 1e-6 and residual.max() < 1e-6


def test_with_room_in_the_limits_the_optimum_of_one_row_is_in_closed_form() -> None:
    """Least |u - u_hat|^2 + p (w - 1)^2 with a u + w alpha + drift >= 0: along (a, alpha / p)."""
    view, p = meeting(miss=2.0, apart=58.0), 0.3
    wide = Limits(*(np.full(2, x) for x in (0.1, 500.0, 50.0, 500.0)))
    rows = pair_rows(TURN.values(view.state), view.state, linear(0.5))
    problem = Problem(*input_set(view, wanted(2), wide))
    u, _, (decay,), _ = OptimalDecayFilter(TURN, linear(0.5), p).solve(problem, (rows,))
    a, alpha = np.concatenate([rows.lie[0][0], rows.lie[1][0]]), 0.5 * rows.h[0]
    short = float(rows.rhs[0] - a @ problem.target.ravel())
    assert short > 0.1
    step_ = short / (a @ a + alpha**2 / p)
    assert u.ravel() == pytest.approx(problem.target.ravel() + step_ * a, abs=1e-6)
    assert decay[0] == pytest.approx(1.0 + step_ * alpha / p, rel=1e-6)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_optimum_is_that_of_a_general_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    view, p = meeting(miss=rng.uniform(-3, 3), apart=rng.uniform(45, 70)), rng.uniform(0.01, 1.0)
    rows = pair_rows(TURN.values(view.state), view.state, linear(0.5))
    problem = Problem(*input_set(view, wanted(2), limits(2)))
    u, status, (decay,), _ = OptimalDecayFilter(TURN, linear(0.5), p).solve(problem, (rows,))

    def cost(x: np.ndarray) -> float:
        return float(((x[:6] - problem.target.ravel()) ** 2).sum() + p * (x[6] - 1.0) ** 2)

    lie = np.concatenate([rows.lie[0][0], rows.lie[1][0], [-rows.rhs[0]]])
    ends = [*zip(problem.lower.ravel(), problem.upper.ravel(), strict=True), (0.0, 1e6)]
    x0 = np.append(problem.target.ravel(), 50.0)
    best = minimize(
        cost, x0, bounds=ends, constraints={"type": "ineq", "fun": lambda x: lie @ x, "jac": lambda x: lie},
        options={"ftol": 1e-13, "maxiter": 500},
    )  # fmt: skip
    x = np.append(u.ravel(), decay[0])
    assert (status == Status.SOLVED).all() and lie @ x >= -1e-9
    assert cost(x) == pytest.approx(best.fun, rel=1e-6, abs=1e-9)


# Velocity obstacles


@settings(max_examples=150, deadline=None)
@given(vectors, velocities, st.floats(1.0, 20.0), st.integers(0, 2**31))
def test_u_leads_to_the_nearest_point_of_the_velocity_obstacles_border(
    apart: np.ndarray, relative: np.ndarray, horizon: float, seed: int
) -> None:
    if np.linalg.norm(apart) < 1.01 * DS:
        return
    u, normal = (x[0] for x in least_change(apart[None], relative[None], DS, horizon, 1.0))

    def collides(v: np.ndarray) -> bool:
        return distance(apart, -v, horizon) < DS

    length = np.linalg.norm(u)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    assert abs(abs(u @ normal) - length) < 1e-9
    if length < 1e-3:
        return
    inside = collides(relative)
    assert (u @ normal > 0) == inside
    assert collides(relative + 1.001 * u) != inside
    directions = np.random.default_rng(seed).normal(size=(40, 3))
    for d in directions / np.linalg.norm(directions, axis=1)[:, None]:
        assert collides(relative + 0.999 * length * d) == inside


def test_two_head_on_each_take_half_of_the_least_change_to_their_own_right() -> None:
    """In closed form: off the line of sight by asin(Ds / distance), the relative velocity being 40 m/s."""
    apart, sine = 100.0, DS / 100.0
    f = VelocityObstacleFilter(DS, horizon=1e3)
    observer, other, change, normal = f.half_spaces(meeting(apart=apart))
    assert list(observer) == [0, 1] and list(other) == [1, 0]
    assert np.allclose(np.linalg.norm(change, axis=1), 40.0 * sine)
    assert normal[0, 1] < 0 < normal[1, 1]  # eastbound to the south, westbound to the north
    assert np.allclose(change[0], -change[1])
    d = f(meeting(apart=apart), wanted(2), limits(2))
    # Both fly so that half of u is met: together the relative velocity is on the cone's border.
    flown = velocity(np.array([0.0, np.pi]) + d.command.omega * f.response, d.command)
    assert np.allclose(flown[0] - 0.5 * change[0], velocity(np.zeros(1), wanted(1))[0], atol=1e-9)
    assert distance(np.array([apart, 0, 0]), flown[1] - flown[0], np.inf) == pytest.approx(DS)
    assert d.command.omega[0] == pytest.approx(d.command.omega[1]) and d.command.omega[0] < 0


@pytest.mark.parametrize("space", ["level", "full"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_velocities_in_all_half_spaces_do_not_collide_within_the_horizon(seed: int, space: str) -> None:
    """van den Berg et al. 2011: whoever chooses inside its own half spaces is safe with all who do."""
    rng, n = np.random.default_rng(seed), 5
    x, y = 120.0 * np.cos(np.arange(n)), 120.0 * np.sin(np.arange(n))
    z = rng.uniform(-2, 2, n) if space == "full" else np.zeros(n)
    state = State(x, y, np.arctan2(-y, -x) + rng.uniform(-0.3, 0.3, n), z)
    rates = Command(rng.uniform(15, 25, n), np.zeros(n), np.zeros(n))
    f = VelocityObstacleFilter(DS, horizon=8.0, space=space)  # type: ignore[arg-type]
    observer, _, change, normal = f.half_spaces(View(state, rates))
    now = velocity(state.theta, rates)
    level = ((now[observer] + 0.5 * change) * normal).sum(axis=1)
    far = np.full((n, 3), 1e3)
    if space == "level":
        far[:, 2] = 0.0
    chosen, status = solve_each(now, observer, normal, level, -far, far)
    assert (status == Status.SOLVED).all()
    for i in range(n):
        for j in range(i):
            p, w = state.position[j] - state.position[i], chosen[j] - chosen[i]
            assert distance(p, w, 8.0) >= DS - 1e-6


def test_who_stays_above_is_not_met_and_who_descends_is() -> None:
    assert list(least_height(np.array([8.0, 8.0, -8.0, 2.0]), np.array([0, -1.0, 0.5, 1.0]), 10.0)) == [
        8,
        0,
        3,
        2,
    ]
    high = State(np.array([0.0, 60.0]), np.zeros(2), np.array([0.0, np.pi]), np.array([0.0, 6.0]))
    f = VelocityObstacleFilter(DS)
    assert not f.half_spaces(View(high, wanted(2)))[0].size
    sinking = Command(np.full(2, 20.0), np.zeros(2), np.array([0.0, -1.0]))
    assert f.half_spaces(View(high, sinking))[0].size == 2


def test_beside_a_passive_vehicle_the_whole_change_is_taken() -> None:
    alone = VelocityObstacleFilter(DS, passive=(1,))(meeting(), wanted(2), limits(2))
    both = VelocityObstacleFilter(DS)(meeting(), wanted(2), limits(2))
    sides = [d.command.v[0] * np.sin(d.command.omega[0]) for d in (alone, both)]
    assert sides[0] == pytest.approx(2 * sides[1], rel=0.02)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: VelocityObstacleFilter(0.0), "d_safe must be positive"),
        (lambda: VelocityObstacleFilter(5.0, horizon=np.nan), "horizon must be positive"),
        (lambda: VelocityObstacleFilter(5.0, responsibility=1.5), "a share up to 1"),
        (lambda: VelocityObstacleFilter(5.0, range=-1.0), "range must be finite and not negative"),
        (lambda: VelocityObstacleFilter(5.0, space="flat"), "space is 'level' or 'full'"),  # type: ignore[arg-type]
        (lambda: CollisionConeFilter(5.0, decay=0.0), "decay must be positive"),
        (lambda: CollisionConeFilter(5.0, cost="cheap"), "cost is 'raw' or 'range'"),  # type: ignore[arg-type]
        (lambda: OptimalDecayFilter(TURN, linear(1.0), 0.0), "the weight of the decay must be positive"),
    ],
)
def test_numbers_out_of_range_are_refused(make: object, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make()  # type: ignore[operator]


# In a run


SHORT = ["radius_m=60", "lookahead_m=10", "duration_s=2.5", "filter_dt_s=0.05", "record_dt_s=0.05"]
RUNS = {
    "collision-cone": [],
    "optimal-decay": [],
    "late optimal-decay": ["network.latency_s=0.1"],
    "velocity-obstacles": [],
}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folders = {name: tmp_path_factory.mktemp("rivals") / name for name in RUNS}
    for name, more in RUNS.items():
        kind = f'filter.kind="{name.split()[-1]}"'
        run(load("paper-2-turn", [kind, *SHORT, "manoeuvre_instants=0", *more]), folders[name])
    return folders


@pytest.mark.parametrize("name", RUNS)
def test_the_second_opinion_agrees_with_a_run(flown: dict[str, Path], name: str) -> None:
    found = verify(flown[name])
    assert not [f.what for f in found if f.agrees is False]
    judged = {v["id"]: v["verdict"] for v in read(flown[name], "guarantees.json")}
    assert (judged["safe-set"] == "not applicable") == (name in ("collision-cone", "velocity-obstacles"))
    assert judged["qp-feasibility"] == ("holds" if "decay" in name else "not applicable")


def test_h_of_the_optimal_decay_filter_and_of_the_cones_is_computed_anew(
    flown: dict[str, Path], tmp_path: Path
) -> None:
    cones = flown["collision-cone"]
    said = [f for f in verify(cones) if "cone" in f.what]
    assert len(said) == 2 and all(f.agrees for f in said)
    for name in ("monitor-cone_start", "monitor-cone_kept"):
        e = entry(cones, name)
        if e["value"] is not None:
            folder = copied(cones, tmp_path / name)
            edit_entry(folder, name, value=e["value"] + 1.0, margin=e["margin"] + 1.0)
            seal(folder)
            assert name in differing(folder)
    folder = copied(flown["late optimal-decay"], tmp_path / "late")
    edit_table(folder, "pairs", lambda t: t.assign(h_filter_m=t.h_filter_m + 1e-3))
    seal(folder)
    assert "h_filter_m" in differing(folder)


@pytest.mark.parametrize("name", ["optimal-decay", "late optimal-decay"])
def test_commands_of_the_optimal_decay_filter_are_its_optimum_at_the_weight_said(
    flown: dict[str, Path], tmp_path: Path, name: str
) -> None:
    [minimal] = [f for f in verify(flown[name]) if f.what == "minimal"]
    assert minimal.agrees
    folder = copied(flown[name], tmp_path / "x")
    manifest = read(folder, "manifest.json")
    manifest["scenario"]["filter"]["decay_weight"] = 3.0
    write(folder, "manifest.json", manifest)
    seal(folder)
    assert "minimal" in differing(folder)
