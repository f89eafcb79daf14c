"""The solvers agree on ordinary and on degenerate QPs; many QPs at once are the same QPs one by one."""

from importlib.metadata import version

import numpy as np
import pytest

from filters.barriers.class_k import cubic
from filters.barriers.closed_form import TurnBarrier
from filters.cbf.collision import CollisionFilter
from filters.model import Command, Limits, State, View, step
from filters.qp import active_set, single
from filters.qp.batch import solve_each
from filters.qp.infeasibility import impossible
from filters.qp.single import Status

CENTRE, HALF = np.array([20.0, 0.0, 0.0]), np.array([5.0, 0.2269, 3.9])
OMEGA_MAX = np.deg2rad(13)
LIMITS = Limits(15.0, 25.0, OMEGA_MAX, 3.9)


def degenerate(rng, kind, n, m):
    """A feasible QP (a contradictory one if so named) whose rows are scaled like a barrier's."""
    centre, half = np.resize(CENTRE, n), np.resize(HALF, n)
    rows = rng.normal(size=(m, n)) * np.resize([1.0, 100.0, 0.1], n) * 10.0 ** rng.uniform(-1, 1, (m, 1))
    inside = centre + half * rng.uniform(-0.9, 0.9, n)
    if kind in ("duplicate", "parallel"):
        rows = rows[rng.integers(0, max(1, m // 3), m)]
    if kind == "parallel":
        rows = rows * rng.choice([1.0, -1.0, 0.5, 3.0], (m, 1))
    if kind == "scaled":
        rows *= 10.0 ** rng.uniform(-4, 3, (m, 1))
    if kind == "steep":
        rows[:, 1::3] *= 100.0
    if kind == "corner":
        inside = centre + half * rng.choice([-1.0, 1.0], n)
    size = np.linalg.norm(rows * half, axis=1)
    gap = {
        "plain": size * rng.uniform(-0.3, 0.0, m),
        "vertex": np.zeros(m),
        "corner": np.zeros(m),
        "contradictory": size * rng.uniform(-0.3, 0.3, m),
    }.get(kind, np.where(rng.random(m) < 0.5, 0.0, -size * rng.uniform(0, 0.2, m)))
    return centre + half * rng.normal(0, 2, n), rows, rows @ inside + gap, centre - half, centre + half


KINDS = ("plain", "duplicate", "parallel", "scaled", "steep", "vertex", "corner", "contradictory")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_both_solvers_agree(kind):
    rng = np.random.default_rng(KINDS.index(kind))
    for n, m, cases in ((3, 2, 100), (3, 6, 100), (3, 19, 60), (12, 20, 15), (60, 100, 2)):
        for _ in range(cases):
            problem = degenerate(rng, kind, n, m)
            ours, osqp = (single.solve(*problem, solver) for solver in ("auto", "osqp"))
            assert ours.status == osqp.status
            assert (ours.status == Status.INFEASIBLE) <= (kind == "contradictory")
            assert max(ours.residual, osqp.residual) <= single.RESIDUAL or ours.status != Status.SOLVED
            # healthy 1e-10, a wrong active set > 1e-3
            np.testing.assert_allclose(ours.u, osqp.u, rtol=0, atol=1e-8)


def by_vehicle(rng, vehicles, kinds=KINDS):
    """QPs of many vehicles as `solve_each` takes them: rows in no order, one vehicle without any."""
    problems = [
        degenerate(rng, kinds[v % len(kinds)], 3, int(rng.integers(1, 9))) for v in range(vehicles - 1)
    ]
    problems.insert(2, (rng.normal(0, 40, 3), np.zeros((0, 3)), np.zeros(0), CENTRE - HALF, CENTRE + HALF))
    owner = np.repeat(np.arange(vehicles), [p[2].size for p in problems])
    shuffle = rng.permutation(owner.size)
    target, lower, upper = (np.array([p[k] for p in problems]) for k in (0, 3, 4))
    rows, rhs = (np.concatenate([p[k] for p in problems])[shuffle] for k in (1, 2))
    return problems, (target, owner[shuffle], rows, rhs, lower, upper)


@pytest.mark.parametrize("seed", range(6))
def test_many_qps_at_once_are_the_same_qps_one_by_one(seed):
    problems, together = by_vehicle(np.random.default_rng(seed), 25)
    u, status = solve_each(*together)
    for v, problem in enumerate(problems):
        alone = single.solve(*problem)
        assert status[v] == alone.status
        np.testing.assert_allclose(u[v], alone.u, rtol=0, atol=1e-9)


def test_one_vehicles_trouble_changes_no_other_vehicles_bytes():
    rng = np.random.default_rng(7)
    _, (target, owner, rows, rhs, lower, upper) = by_vehicle(rng, 12, ("plain",))
    u, status = solve_each(target, owner, rows, rhs, lower, upper)
    assert np.all(status == Status.SOLVED)
    hopeless = np.append(owner, 5), np.vstack([rows, np.ones(3)]), np.append(rhs, 1e4)
    v, changed = solve_each(target, *hopeless, lower, upper)
    np.testing.assert_array_equal(np.flatnonzero(changed != Status.SOLVED), [5])
    assert np.delete(v, 5, axis=0).tobytes() == np.delete(u, 5, axis=0).tobytes()


def test_entries_without_a_choice_or_a_row_keep_their_value_to_the_last_bit():
    rng = np.random.default_rng(8)
    _, (target, owner, rows, rhs, lower, upper) = by_vehicle(rng, 12, ("plain",))
    target[:, 2], rows[:, 2] = 0.1, 0.0
    lower[4, 1] = upper[4, 1] = 0.05
    u, status = solve_each(target, owner, rows, rhs - 50.0, lower, upper)
    np.testing.assert_array_equal(u[:, 2], 0.1)
    assert u[4, 1] == 0.05
    for v in np.flatnonzero(status == Status.SOLVED):
        mine = owner == v
        alone = single.solve(target[v], rows[mine], rhs[mine] - 50.0, lower[v], upper[v])
        np.testing.assert_allclose(u[v], alone.u, rtol=0, atol=1e-9)


def forbidden(*_, **__):
    raise AssertionError("this solver was not to be asked")


@pytest.mark.parametrize("seed", range(4))
def test_ordinary_qps_are_all_solved_in_the_one_pass(seed, monkeypatch):
    """What is not trusted goes to `qp.solve`, which hides any mistake made before at twice the price."""
    rng = np.random.default_rng(20 + seed)
    _, (target, owner, rows, rhs, lower, upper) = by_vehicle(rng, 15, ("plain", "vertex", "corner"))
    # vehicle 4 has an entry without a choice, 5 one in no row, 6 a row of zeros
    lower[4, 1] = upper[4, 1] = 0.5 * (lower[4, 1] + upper[4, 1])
    rhs[owner == 4] -= 0.5 * np.linalg.norm(rows[owner == 4], axis=1) + 40.0
    rows[owner == 5, 2] = 0.0
    rhs[owner == 5] -= 40.0
    zero = np.flatnonzero(owner == 6)[0]
    rows[zero], rhs[zero] = 0.0, -1.0
    expected = []
    for v in range(15):
        mine = owner == v
        expected.append(single.solve(target[v], rows[mine], rhs[mine], lower[v], upper[v], "osqp"))
    assert all(e.status == Status.SOLVED for e in expected)
    asked, solve = [], single.solve
    monkeypatch.setattr(single, "solve", lambda *of: asked.append(of) or solve(*of))
    u, status = solve_each(target, owner, rows, rhs, lower, upper)
    np.testing.assert_array_equal(status, Status.SOLVED)
    np.testing.assert_allclose(u, [e.u for e in expected], rtol=0, atol=1e-8)
    # daqp before 0.11 leaves one or two in fifteen short of 1e-9
    assert len(asked) <= (2 if version("daqp").startswith("0.10.") else 0)


def test_an_entry_without_a_choice_counts_in_its_rows_in_the_one_pass(monkeypatch):
    # 2 m/s are given, so the others must make up the rest of 5, or of 1 in the opposite direction
    target = np.array([[0.0, 0.0, 0.0], [9.0, 9.0, 9.0]])
    rows, owner = np.array([[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]]), np.array([0, 1])
    lower, upper = np.tile([2.0, -9.0, -9.0], (2, 1)), np.tile([2.0, 9.0, 9.0], (2, 1))
    monkeypatch.setattr(single, "solve", forbidden)
    u, status = solve_each(target, owner, rows, np.array([5.0, -1.0]), lower, upper)
    np.testing.assert_array_equal(status, Status.SOLVED)
    np.testing.assert_allclose(u, [[2.0, 3.0, 0.0], [2.0, -1.0, 9.0]], atol=1e-10)


def test_where_only_osqp_may_be_asked_nothing_else_is(monkeypatch):
    _, together = by_vehicle(np.random.default_rng(11), 8)
    honest, honest_status = solve_each(*together)
    for name in ("attempt", "attempt_each"):
        monkeypatch.setattr(active_set, name, forbidden)
    u, status = solve_each(*together, "osqp")
    np.testing.assert_array_equal(status, honest_status)
    np.testing.assert_allclose(u, honest, rtol=0, atol=1e-7)


def test_crossed_limits_of_one_vehicle_are_refused():
    _, together = by_vehicle(np.random.default_rng(12), 4, ("plain",))
    together[4][0, 0] = together[5][0, 0] + 1.0
    with pytest.raises(ValueError, match="lower <= upper"):
        solve_each(*together)


@pytest.mark.parametrize(
    ("u", "dual", "why"),
    [
        ([2.0, 0.0, 0.0], [0.0, 0.0], "it satisfies the rows but another is nearer"),
        ([1.5, 0.0, 0.0], [1.5, 0.0], "it is pulled as far as it goes, beyond need"),
        ([0.9, 0.0, 0.0], [0.9, 0.0], "the first row is short"),
        ([1.0, 0.0, 0.0], [2.0, 0.0], "the pull is too strong"),
        ([1.0, 0.0, 0.0], [1.0, 0.5], "a row that is far away pulls"),
    ],
)
def test_no_part_of_a_claimed_optimum_is_taken_on_trust(u, dual, why, monkeypatch):
    """At least 1 m/s, which is the nearest to 0; the second row asks for no less than -5."""
    rows, rhs = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]), np.array([1.0, -5.0])
    box = np.full((1, 3), -9.0), np.full((1, 3), 9.0)
    lie = np.array([u]), np.array(dual), np.ones(1, dtype=int), np.ones(1, dtype=bool)
    monkeypatch.setattr(active_set, "attempt_each", lambda *_: lie)
    found, status = solve_each(np.zeros((1, 3)), np.zeros(2, dtype=int), rows, rhs, *box)
    assert status.tolist() == [Status.SOLVED], why
    np.testing.assert_allclose(found, [[1.0, 0.0, 0.0]], atol=1e-9, err_msg=why)


def test_the_active_set_method_answers_with_the_optimum_its_multipliers_and_its_effort():
    # The nearest point to (3, 1) with x <= 1 is (1, 1), pulled by 2; to (-8, 4) with y >= 6 it is (-8, 6).
    t, count = np.array([[3.0, 1.0], [-8.0, 4.0], [5.0, 5.0]]), np.array([2, 1, 1])
    A = np.array([[-1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [1.0, 0.0]])
    b = np.array([-1.0, -5.0, 6.0, 20.0])
    lo, hi = np.full((3, 2), -9.0), np.full((3, 2), 9.0)
    u, dual, iterations, found = active_set.attempt_each(t, count, A, b, lo, hi)
    np.testing.assert_allclose(u[:2], [[1.0, 1.0], [-8.0, 6.0]], atol=1e-11)
    np.testing.assert_allclose(dual[:3], [2.0, 0.0, 2.0], atol=1e-11)
    assert found.tolist() == [True, True, False] and found.dtype == bool
    assert np.all(iterations > 0) and iterations.dtype.kind == "i"
    one, multipliers, used, none = active_set.attempt(t[0], A[:2], b[:2], lo[0], hi[0])
    assert one.tolist() == u[0].tolist() and multipliers.tolist() == dual[:2].tolist()
    assert isinstance(used, int) and used == iterations[0] and not none


def test_impossible_is_said_only_with_a_proof(monkeypatch):
    rows, box = np.array([[1.0, 1.0], [-1.0, 0.0], [0.0, 0.0]]), (np.array([-1.0, 2.0]), np.array([3.0, 4.0]))
    # x + y reaches 7 in the corner, and 5 where x must not exceed 1
    for rhs, proved in (
        ([7.0, -9.0, -1.0], False),
        ([7.1, -9.0, -1.0], True),
        ([5.0, -1.0, -1.0], False),
        ([5.1, -1.0, -1.0], True),
        ([0.0, -9.0, 0.1], True),
        ([7.0 + 1e-7, -9.0, -1.0], False),  # short by less than passes for solved
    ):
        assert impossible(rows, np.array(rhs), *box) is proved, rhs

    def tired(*_, **__):
        raise RuntimeError("too many iterations")

    monkeypatch.setattr("scipy.optimize.nnls", tired)
    assert impossible(rows, np.array([7.1, -9.0, -1.0]), *box) is False


@pytest.mark.parametrize("lie", ["no solution", "wrong", "not a number", "unbounded multipliers"])
def test_the_active_set_solver_is_not_taken_on_trust(lie, monkeypatch):
    problems, together = by_vehicle(np.random.default_rng(9), 10)
    honest, honest_status = solve_each(*together)

    def liar(t, count, A, b, lo, hi):
        u = np.full(t.shape, np.nan) if lie == "not a number" else lo
        # Infinite multipliers in every other row: inf * 0, inf - inf, as daqp leaves them of a hopeless QP.
        dual = np.where(np.arange(b.size) % 2, np.inf, 0.0) if lie == "unbounded multipliers" else 0.0 * b
        return u, dual, np.ones(len(t), dtype=int), np.full(len(t), lie != "no solution")

    monkeypatch.setattr(active_set, "attempt_each", liar)
    u, status = solve_each(*together)
    np.testing.assert_array_equal(status, honest_status)
    np.testing.assert_allclose(u, honest, rtol=0, atol=1e-7)
    np.testing.assert_allclose(single.solve(*problems[0]).u, honest[0], rtol=0, atol=1e-7)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", ["target", "rows", "rhs"])
def test_numbers_that_are_not_finite_are_refused(field, bad):
    _, together = by_vehicle(np.random.default_rng(10), 4, ("plain",))
    place = {"target": 0, "rows": 2, "rhs": 3}[field]
    together[place][0] = bad
    with pytest.raises(ValueError, match=f"{field} of a QP must be finite"):
        solve_each(*together)


def test_an_unknown_solver_is_refused_by_name():
    with pytest.raises(ValueError, match="unknown QP solver 'fast'"):
        single.solve([0.0], [[1.0]], [0.0], [-1.0], [1.0], "fast")
    with pytest.raises(ValueError, match="unknown QP solver 'fast'"):
        CollisionFilter(TurnBarrier(16.0, 0.2, 5.0), cubic(0.1), solver="fast")


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["centralised", "limited"])
@pytest.mark.parametrize("k", [8, 20])
def test_a_circle_is_flown_alike_with_either_solver(k, mode):
    angle = np.pi + 2 * np.pi * np.arange(k) / k
    state = State(200 * np.cos(angle), 200 * np.sin(angle), angle + np.pi, np.zeros(k))
    goal = -(state.x + 1j * state.y)
    barrier = TurnBarrier(16.0, 0.9 * OMEGA_MAX, 5.0, delta=0.01)
    auto, osqp = (CollisionFilter(barrier, cubic(0.1), mode, solver=name) for name in ("auto", "osqp"))
    solved = 0
    for _ in range(120):
        pull = 0.1 * (goal - state.x - 1j * state.y) * np.exp(-1j * state.theta)
        view = View(state, Command(np.full(k, 20.0), 0.0, 0.0))
        nominal = Command(pull.real, pull.imag, -0.1 * state.z)
        one = auto(view, nominal, LIMITS)
        other = osqp(view, nominal, LIMITS) if 60 <= solved < 75 else one
        solved += bool(one.override.any())
        np.testing.assert_array_equal(one.status, other.status)
        np.testing.assert_allclose(one.command.array(), other.command.array(), rtol=0, atol=1e-8)
        assert auto(view, nominal, LIMITS).command.array().tobytes() == one.command.array().tobytes()
        state = step(state, one.command, 0.1)
    np.testing.assert_array_equal(state.z, 0.0)
