"""The QP solver against published vectors, an independent solver, and the optimality conditions."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from filters.qp import single
from filters.qp.single import Status

SOLVERS = ("auto", "osqp")

VECTORS = json.loads((Path(__file__).parent / "reference" / "vectors.json").read_text())


def vector_problems():
    """(name, target, rows, rhs, lower, upper, u) of every QP in vectors.json, one per vehicle if limited."""
    for case in VECTORS["qp"]:
        k = case["k"]
        lie_i, lie_j, h = (np.array(case[f]) for f in ("Lgh_i", "Lgh_j", "h"))
        gamma, target, u = (np.array(case[f]) for f in ("gamma", "u_hat", "u"))
        lower, upper = np.array(case["lo"]), np.array(case["hi"])
        name = f"{case['name']}-{case['mode']}"
        if case["mode"] == "centralized":
            rows = np.zeros((len(h), k, 3))
            for p, (i, j) in enumerate(case["pairs"]):
                rows[p, i], rows[p, j] = lie_i[p], lie_j[p]
            flat = rows.reshape(len(h), -1)
            yield name, target.ravel(), flat, -0.1 * h**3, np.tile(lower, k), np.tile(upper, k), u.ravel()
            continue
        for n in range(k):
            mine = []
            for p, (i, j) in enumerate(case["pairs"]):
                share = 0.5 * (lie_j[p] @ gamma[j] - lie_i[p] @ gamma[i])
                mine += [(lie_i[p], -0.05 * h[p] ** 3 - share)] if n == i else []
                mine += [(lie_j[p], -0.05 * h[p] ** 3 + share)] if n == j else []
            rows, rhs = (np.array(a) for a in zip(*mine, strict=True))
            yield f"{name}-{n + 1}", target[n], rows, rhs, lower, upper, u[n]


PROBLEMS = {name: rest for name, *rest in vector_problems()}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_reference_qps_are_solved_to_1e_6_through_osqp_and_beside_it(name, solver):
    target, rows, rhs, lower, upper, u = PROBLEMS[name]
    found = single.solve(target, rows, rhs, lower, upper, solver)
    assert found.status == Status.SOLVED
    assert found.iterations > 0  # not by the shortcut
    assert found.residual <= 1e-9
    np.testing.assert_allclose(found.u, u, rtol=0, atol=1e-6)


def random_problem(rng, n, m, feasible=True):
    """Rows scaled like a barrier's (1, 100, 0.1), some of them huge, and a target partly outside the box."""
    half = np.resize([5.0, 0.2269, 3.9], n)
    centre = np.resize([20.0, 0.0, 0.0], n)
    rows = rng.normal(size=(m, n)) * np.resize([1.0, 100.0, 0.1], n) * 10.0 ** rng.uniform(-1, 1, (m, 1))
    inside = centre + half * rng.uniform(-0.9, 0.9, n)
    gap = np.linalg.norm(rows * half, axis=1) * rng.uniform(-0.3, 0.3 if not feasible else 0.0, m)
    return centre + half * rng.normal(0, 2, n), rows, rows @ inside + gap, centre - half, centre + half


def kkt_error(u, target, rows, rhs, lower, upper):
    """Distance of `u` from the optimum's conditions, with multipliers found by non-negative least squares."""
    from scipy.optimize import nnls

    norm = np.linalg.norm(rows, axis=1)
    rows, rhs = rows / norm[:, None], rhs / norm
    active = rows[rows @ u - rhs < 1e-7]
    normals = np.vstack([active, np.eye(u.size)[u - lower < 1e-9], -np.eye(u.size)[upper - u < 1e-9]])
    return nnls(normals.T, u - target)[1] if len(normals) else float(np.linalg.norm(u - target))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    ("n", "m", "cases"), [(3, 5, 60), (3, 19, 60), (12, 6, 20), (30, 45, 10), (60, 190, 4)]
)
def test_random_qps_satisfy_the_optimality_conditions(n, m, cases, solver):
    rng = np.random.default_rng(n * 1000 + m)
    for _ in range(cases):
        problem = random_problem(rng, n, m)
        found = single.solve(*problem, solver)
        assert found.status == Status.SOLVED
        assert found.residual <= 1e-6
        assert np.all((found.u >= problem[3]) & (found.u <= problem[4]))
        # Sufficient for the optimum of a convex problem. healthy 1e-9, wrong active set > 1e-3
        assert kkt_error(found.u, *problem) <= 1e-6


def brute_force(target, rows, rhs, lower, upper):
    """The optimum by trying every active set of up to n constraints."""
    n = target.size
    normals = np.vstack([rows, np.eye(n), -np.eye(n)])
    levels = np.concatenate([rhs, lower, -upper])
    best, best_cost = None, np.inf
    for size in range(n + 1):
        for active in itertools.combinations(range(levels.size), size):
            g, h = normals[list(active)], levels[list(active)]
            u = target + np.linalg.lstsq(g, h - g @ target, rcond=None)[0] if size else target
            if np.all(normals @ u - levels >= -1e-9 * np.maximum(1, np.abs(levels))):
                cost = np.sum((u - target) ** 2)
                best, best_cost = (u, cost) if cost < best_cost else (best, best_cost)
    return best


@pytest.mark.parametrize("solver", SOLVERS)
def test_small_qps_agree_with_the_enumeration_of_all_active_sets(solver):
    rng = np.random.default_rng(4)
    for _ in range(25):
        problem = random_problem(rng, 3, 4)
        np.testing.assert_allclose(single.solve(*problem, solver).u, brute_force(*problem), rtol=0, atol=1e-7)


def test_a_medium_qp_agrees_with_slsqp():
    target, rows, rhs, lower, upper = random_problem(np.random.default_rng(5), 9, 8)
    size = np.linalg.norm(rows, axis=1)
    other = minimize(
        lambda u: 0.5 * np.sum((u - target) ** 2),
        np.clip(target, lower, upper),
        jac=lambda u: u - target,
        bounds=list(zip(lower, upper, strict=True)),
        constraints={
            "type": "ineq",
            "fun": lambda u: (rows @ u - rhs) / size,
            "jac": lambda u: rows / size[:, None],
        },
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    np.testing.assert_allclose(single.solve(target, rows, rhs, lower, upper).u, other.x, rtol=0, atol=1e-5)


def test_a_target_that_satisfies_all_rows_once_clipped_is_returned_without_a_solver():
    found = single.solve([30.0, 0.0], [[1.0, 0.0]], [10.0], [15.0, -1.0], [25.0, 1.0])
    assert found.status == Status.SOLVED
    assert found.iterations == 0
    np.testing.assert_array_equal(found.u, [25.0, 0.0])


def test_the_shortcut_agrees_with_the_full_solution():
    rng = np.random.default_rng(6)
    for _ in range(10):
        target, rows, rhs, lower, upper = random_problem(rng, 3, 5)
        clipped = np.clip(target, lower, upper)
        rhs = np.minimum(rhs, rows @ clipped - 0.01)
        norm = np.linalg.norm(rows, axis=1)
        exact = single.nearest(target, rows / norm[:, None], rhs / norm, lower, upper, np.ones(5, dtype=bool))
        np.testing.assert_allclose(exact, clipped, rtol=0, atol=1e-9)


def test_a_qp_with_neither_rows_nor_room_works():
    assert single.solve([3.0], np.zeros((0, 1)), [], [0.0], [1.0]).u == [1.0]
    found = single.solve([0.0, 9.0], [[1.0, 1.0]], [5.0], [2.0, 0.0], [2.0, 9.5])
    np.testing.assert_allclose(found.u, [2.0, 9.0])


def test_entries_with_equal_limits_are_kept_at_them():
    found = single.solve([0.0, 0.0], [[1.0, 1.0]], [5.0], [2.0, 0.0], [2.0, 9.5])
    assert found.status == Status.SOLVED
    np.testing.assert_allclose(found.u, [2.0, 3.0], atol=1e-9)


def test_entries_in_no_row_keep_their_target_to_the_last_bit():
    rng = np.random.default_rng(10)
    target, rows, rhs, lower, upper = random_problem(rng, 6, 3)
    target[[2, 5]] = 0.1, 9.9
    rows[:, [2, 5]] = 0.0
    found = single.solve(target, rows, rhs - 1e-3, lower, upper)
    assert found.iterations > 0
    np.testing.assert_array_equal(found.u[[2, 5]], np.clip(target, lower, upper)[[2, 5]])


def test_refinement_starts_from_nothing_as_well():
    # Every constraint slack at the target: scipy's nnls must not be called without columns (it crashes).
    t, lo, hi = np.zeros(2), -np.ones(2), np.ones(2)
    exact = single.nearest(t, np.eye(2), np.full(2, -0.5), lo, hi, None)
    np.testing.assert_array_equal(exact, t)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_contradiction_is_infeasible_and_returns_the_least_bad_input(solver):
    found = single.solve([0.0, 0.0], [[1.0, 0.0], [-1.0, 0.0]], [0.3, 0.1], [-1.0, -1.0], [1.0, 1.0], solver)
    assert found.status == Status.INFEASIBLE
    assert found.margin == pytest.approx(-0.2, abs=1e-7)
    assert found.residual == pytest.approx(0.2, abs=1e-7)
    assert found.u[0] == pytest.approx(0.1, abs=1e-7)
    assert isinstance(found.iterations, int) and found.refined is False


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("gap", [0.0, 1e-8, 1e-4])
def test_rows_that_leave_a_sliver_are_solved_not_called_infeasible(gap, solver):
    rows = np.array([[1.0, 200.0], [-1.0, -200.0]])
    found = single.solve([40.0, -3.0], rows, [20.0, -20.0 - gap], [15.0, -0.2], [25.0, 0.2], solver)
    assert found.status == Status.SOLVED
    assert found.residual <= 1e-6


def test_infeasible_is_not_taken_from_osqp_on_trust(monkeypatch):
    target, rows, rhs, lower, upper = random_problem(np.random.default_rng(7), 6, 4)
    honest = single.solve(target, rows, rhs, lower, upper, "osqp")
    assert honest.iterations > 0
    monkeypatch.setattr(
        single, "by_osqp", lambda t, A, b, lo, hi, **_: (np.clip(t, lo, hi), np.zeros(b.size), 1, True)
    )
    found = single.solve(target, rows, rhs, lower, upper, "osqp")
    assert found.status == Status.SOLVED
    np.testing.assert_allclose(found.u, honest.u, rtol=0, atol=1e-7)


def test_a_bad_osqp_answer_is_refined_to_the_exact_one(monkeypatch):
    problem = random_problem(np.random.default_rng(8), 9, 12)
    honest = single.solve(*problem, "osqp")
    monkeypatch.setattr(single, "by_osqp", lambda t, A, *_, **__: (t * 0, np.ones(len(A)), 4000, False))
    found = single.solve(*problem, "osqp")
    assert found.refined and found.status == Status.SOLVED
    np.testing.assert_allclose(found.u, honest.u, rtol=0, atol=1e-7)


@pytest.mark.parametrize("solver", SOLVERS)
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 8), m=st.integers(1, 12))
def test_status_and_residual_never_contradict_each_other(solver, seed, n, m):
    problem = random_problem(np.random.default_rng(seed), n, m, feasible=False)
    _, rows, rhs, lower, upper = problem
    found = single.solve(*problem, solver)
    assert np.all((found.u >= lower) & (found.u <= upper))
    assert found.residual == single.violation(found.u, rows, rhs)
    margin, _ = single.best_margin(rows, rhs, lower, upper)
    assert found.status == (Status.SOLVED if found.residual <= single.RESIDUAL else Status.INFEASIBLE)
    if found.status == Status.INFEASIBLE:
        assert margin < 0
    else:
        assert margin >= -single.RESIDUAL


@pytest.mark.parametrize("solver", SOLVERS)
def test_solutions_do_not_depend_on_what_was_solved_before(solver):
    rng = np.random.default_rng(9)
    problems = [random_problem(rng, 12, 8) for _ in range(4)]
    first = [single.solve(*p, solver).u.tobytes() for p in problems]
    backwards = [single.solve(*p, solver).u.tobytes() for p in problems[::-1]][::-1]
    assert first == backwards


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused(bad):
    with pytest.raises(ValueError, match="rhs of a QP must be finite"):
        single.solve([0.0], [[1.0]], [bad], [-1.0], [1.0])
    with pytest.raises(ValueError, match="rows of a QP must be finite"):
        single.solve([0.0], [[bad]], [0.0], [-1.0], [1.0])


@pytest.mark.parametrize("name", ["target", "rows", "rhs", "lower", "upper"])
def test_what_is_not_finite_is_named_with_its_value(name):
    given = {"target": [0.0], "rows": [[1.0]], "rhs": [0.0], "lower": [-1.0], "upper": [1.0]}
    given[name] = np.full_like(given[name], np.inf)
    with pytest.raises(ValueError, match=f"^the {name} of a QP must be finite, got inf"):
        single.solve(**given)


@pytest.mark.parametrize(("lower", "upper"), [([1.0], [-1.0]), ([0.0, 0.0], [1.0]), ([0.0], [1.0, 1.0])])
def test_limits_that_cross_or_do_not_fit_are_refused(lower, upper):
    with pytest.raises(ValueError, match="a QP needs 1 limits with lower <= upper, got "):
        single.solve([0.0], [[1.0]], [0.0], lower, upper)


def test_a_solver_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="unknown QP solver 'cvx'; choose one of auto, osqp"):
        single.solve([0.0], [[1.0]], [0.0], [-1.0], [1.0], "cvx")


def test_whole_numbers_are_no_reason_to_answer_in_whole_numbers():
    found = single.solve([0, 0, 9], [[2, 0, 0]], [3], [-9, -9, -9], [9, 9, 9])
    np.testing.assert_allclose(found.u, [1.5, 0.0, 9.0], atol=1e-9)
    margin, u = single.best_margin([[1, 1]], [1], [0, 0], [2, 1])
    assert margin == pytest.approx(2.0) and u == pytest.approx([2.0, 1.0])


def test_exactly_on_its_rows_a_target_needs_no_solver():
    found = single.solve([2.0, 1.0], [[1.0, 0.0], [0.0, -3.0]], [2.0, -3.0], [0.0, 0.0], [3.0, 3.0])
    assert (found.status, found.iterations, found.residual) == (Status.SOLVED, 0, 0.0)
    assert found.u.tolist() == [2.0, 1.0]


def test_limits_that_leave_no_choice_are_the_answer_and_the_residual_is_what_is_short():
    rows, fixed = [[1.0, 1.0]], [2.0, 1.0]
    for rhs, status, short in ((3.0 + 1e-7, Status.SOLVED, 1e-7), (3.5, Status.INFEASIBLE, 0.5)):
        found = single.solve([0.0, 0.0], rows, [rhs], fixed, fixed)
        assert (found.status, found.iterations, found.refined) == (status, 0, False)
        assert found.u.tolist() == fixed
        assert found.residual == pytest.approx(short) and found.margin == pytest.approx(-short)


def test_the_residual_of_a_qp_with_fixed_entries_counts_them():
    found = single.solve([0.0, 0.0], [[1.0, 1.0]], [9.0], [2.0, 0.0], [2.0, 3.0])
    assert found.status == Status.INFEASIBLE
    assert found.residual == pytest.approx(4.0) and found.u == pytest.approx([2.0, 3.0])


def test_the_largest_common_margin_has_known_values():
    # Between walls at 1 and -0.2 that face each other the best is the middle, and nothing else matters.
    margin, u = single.best_margin([[1.0, 0.0], [-1.0, 0.0]], [1.0, 0.2], [-3.0, -2.0], [9.0, 5.0])
    assert margin == pytest.approx(-0.6) and u[0] == pytest.approx(0.4)
    # A row as large as may be: the far corner of an unequal box.
    margin, u = single.best_margin([[2.0, -100.0]], [7.0], [1.0, -3.0], [4.0, 5.0])
    assert margin == pytest.approx(8.0 + 300.0 - 7.0) and u == pytest.approx([4.0, -3.0])
    margin, u = single.best_margin(np.zeros((0, 2)), [], [1.0, -3.0], [4.0, 5.0])
    assert margin == np.inf and u.tolist() == [2.5, 1.0]


def forbidden(*_, **__):
    raise AssertionError("this solver was not to be asked")


@pytest.mark.parametrize("least", [0.0, 2.0], ids=["free", "one entry fixed"])
def test_auto_asks_the_active_set_method_and_osqp_only_if_that_fails(monkeypatch, least):
    problem = [0.5, -1.0], [[1.0, 1.0]], [5.0], [least, 0.0], [2.0, 9.5]
    with monkeypatch.context() as patch:
        patch.setattr(single, "by_osqp", forbidden)
        auto = single.solve(*problem)
    monkeypatch.setattr(single.active_set, "attempt", forbidden)
    osqp = single.solve(*problem, "osqp")
    assert auto.status == osqp.status == Status.SOLVED
    assert auto.iterations > 0 and not auto.refined
    np.testing.assert_allclose(auto.u, osqp.u, rtol=0, atol=1e-8)


def lying(u, dual, used, claims_infeasible=False):
    """A solver that answers this, whatever is asked."""
    return lambda t, A, b, *_, **__: (
        u(t) if callable(u) else u,
        np.full(b.size, dual),
        used,
        claims_infeasible,
    )


def test_a_poor_answer_is_refined_at_once_and_its_iterations_count(monkeypatch):
    problem = random_problem(np.random.default_rng(12), 6, 5)
    right = single.solve(*problem)
    monkeypatch.setattr(single, "by_osqp", forbidden)
    monkeypatch.setattr(single.active_set, "attempt", lying(np.zeros_like, 0.0, 7))
    found = single.solve(*problem)
    assert (found.status, found.refined, found.iterations) == (Status.SOLVED, True, 7)
    assert found.residual == single.violation(found.u, problem[1], problem[2])
    np.testing.assert_allclose(found.u, right.u, rtol=0, atol=1e-8)


def test_when_all_solvers_claim_there_is_no_input_and_a_program_finds_one_it_is_refined(monkeypatch):
    problem = random_problem(np.random.default_rng(13), 6, 5)
    right = single.solve(*problem)
    for module, name in ((single.active_set, "attempt"), (single, "by_osqp")):
        monkeypatch.setattr(module, name, lying(np.zeros_like, 0.0, 7, True))
    found = single.solve(*problem)
    assert (found.status, found.refined, found.iterations) == (Status.SOLVED, True, 21)
    assert found.margin == single.best_margin(*problem[1:])[0] >= 0.0
    assert found.residual <= 1e-9
    np.testing.assert_allclose(found.u, right.u, rtol=0, atol=1e-8)


def test_what_nothing_finds_though_it_exists_is_the_iteration_limit(monkeypatch):
    problem = random_problem(np.random.default_rng(14), 6, 5)
    for module, name in ((single.active_set, "attempt"), (single, "by_osqp")):
        monkeypatch.setattr(module, name, lying(np.zeros_like, 1.0, 7))
    monkeypatch.setattr(single, "nearest", lambda *_: None)
    found = single.solve(*problem)
    margin, u = single.best_margin(*problem[1:])
    assert (found.status, found.refined, found.iterations) == (Status.ITERATION_LIMIT, False, 21)
    assert (found.margin, found.residual) == (margin, 0.0)
    np.testing.assert_array_equal(found.u, u)


def test_rows_that_contradict_each_other_by_less_than_the_residual_give_way_by_so_much():
    rows = np.array([[1.0, 200.0], [-1.0, -200.0]])
    gap = 0.95 * single.RESIDUAL
    found = single.solve([40.0, -3.0], rows, [20.0, -20.0 + gap], [15.0, -0.2], [25.0, 0.2])
    assert (found.status, found.refined) == (Status.SOLVED, True)
    assert found.margin == pytest.approx(-0.5 * gap, rel=1e-3)
    assert (
        0.5 * gap * (1 - 1e-6) <= found.residual == single.violation(found.u, rows, np.r_[20.0, -20.0 + gap])
    )
    assert found.residual <= single.RESIDUAL and isinstance(found.iterations, int)
    exact = single.solve([40.0, -3.0], rows, [20.0, -20.0], [15.0, -0.2], [25.0, 0.2])
    np.testing.assert_allclose(found.u, exact.u, rtol=0, atol=1e-5)


def test_osqp_itself_answers_with_multipliers_iterations_and_silence(capfd):
    # The nearest point to (3, 1) with x <= 1 is (1, 1), pulled by a force of 2.
    target, rows, rhs = np.array([3.0, 1.0]), np.array([[-1.0, 0.0], [0.0, 1.0]]), np.array([-1.0, -5.0])
    box = np.full(2, -9.0), np.full(2, 9.0)
    u, dual, used, infeasible = single.by_osqp(target, rows, rhs, *box, tolerance=1e-9, most=20_000)
    np.testing.assert_allclose(u, [1.0, 1.0], atol=1e-7)
    np.testing.assert_allclose(dual, [2.0, 0.0], atol=1e-7)
    assert 0 < used <= 20_000 and infeasible is False
    assert single.by_osqp(target, rows, rhs, *box, tolerance=1e-9, most=1)[2] == 1
    outside, beyond = np.array([30.0, -30.0]), np.array([10.0, 0.0])
    u, dual, _, infeasible = single.by_osqp(outside, -rows, beyond, *box, tolerance=1e-9, most=20_000)
    assert infeasible is True and u.tolist() == [9.0, -9.0] and dual.tolist() == [0.0, 0.0]
    assert capfd.readouterr().out == ""


def test_the_error_is_zero_at_the_optimum_and_the_distance_from_its_conditions_elsewhere():
    t, A, b = np.array([3.0, 1.0]), np.array([[-1.0, 0.0], [0.0, 1.0]]), np.array([-1.0, -5.0])
    lo, hi = np.full(2, -9.0), np.full(2, 9.0)
    for u, dual, error in (
        ([1.0, 1.0], [2.0, 0.0], 0.0),
        ([1.5, 1.0], [1.5, 0.0], 0.5),  # half a unit beyond the first row
        ([0.5, 1.0], [2.5, 0.0], 0.5),  # a force where there is no contact
        ([1.0, 1.0], [1.0, 0.0], 1.0),  # too little force
        ([1.0, 1.25], [2.0, 0.25], 0.25),  # a force of a row that is far away
    ):
        assert single.optimality_error(np.array(u), np.array(dual), t, A, b, lo, hi) == error
    # pressed against the box, any force outwards is right
    for edge in (9.0, -9.0):
        u, target = np.array([edge, 1.0]), np.array([10 * edge, 1.0])
        assert single.optimality_error(u, np.zeros(2), target, -A, b - 9.0, lo, hi) == 0.0


def test_a_row_of_zeros_is_a_statement_about_its_right_hand_side():
    rows, box = [[0.0, 0.0], [1.0, 1.0]], ([0.0, 0.0], [4.0, 9.0])
    np.testing.assert_allclose(single.solve([0.0, 1.0], rows, [-1.0, 5.0], *box).u, [2.0, 3.0], atol=1e-9)
    found = single.solve([0.0, 1.0], rows, [0.25, 5.0], *box)
    assert (found.status, found.residual) == (Status.INFEASIBLE, pytest.approx(0.25))


@pytest.mark.parametrize("guess", [None, np.zeros(2, dtype=bool), np.array([False, True])])
def test_refinement_ends_at_the_optimum_wherever_it_starts(guess):
    # The box holds the first entry at 2, the first row the sum at 5, the second row nothing.
    t, lo, hi = np.array([9.0, 0.0]), np.array([0.0, 0.0]), np.array([2.0, 9.0])
    A, b = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([5.0, 1.0])
    np.testing.assert_allclose(single.nearest(t, A, b, lo, hi, guess), [2.0, 3.0], atol=1e-12)
    assert single.nearest(t, A, np.array([12.0, 1.0]), lo, hi, guess) is None


def test_sparse_rows_are_accepted():
    from scipy.sparse import csr_array

    rows = np.array([[1.0, 1.0]])
    args = ([0.0, 0.0], [1.0], [-1.0, -1.0], [1.0, 1.0])
    np.testing.assert_array_equal(
        single.solve(args[0], csr_array(rows), *args[1:]).u, single.solve(args[0], rows, *args[1:]).u
    )
