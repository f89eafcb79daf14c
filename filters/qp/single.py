"""Solves the safety filter's quadratic program: the input nearest to a target, inside a box and above rows.

    minimise  1/2 |u - target|^2   subject to   rows u >= rhs,   lower <= u <= upper

This is the only module that imports osqp, and it does so at the first solve. A solver (the dual active-set
method of `active_set`, or OSQP) finds which constraints are active; where that leaves an error, `nearest`
makes the answer exact. `solve` keeps no state between calls, so equal arguments give equal bytes whatever was
solved before.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.qp import active_set

Solver = Literal["auto", "osqp"]
"""Which solver goes first: "auto" the one measured to be faster (docs/decisions/0006), or always OSQP."""
SOLVERS = get_args(Solver)

Array = NDArray[np.float64]

# OSQP's efforts, tried in turn: (eps_abs = eps_rel, most iterations). The refinement solves what 1000
# iterations do not, sooner than more iterations would.
EFFORTS = ((1e-6, 1_000), (1e-9, 20_000))
# A solver's answer is taken as it is when its duality gap [1] and its violation of the rows, each
# divided by its norm, are below this; otherwise it is refined.
ACCEPT = 1e-9
# Largest violation of any row, in the unit of that row (m/s for a barrier's), of a solution called SOLVED.
RESIDUAL = 1e-6


class Status(enum.IntEnum):
    """How a QP ended. Only SOLVED carries a guarantee.

    NONE             no QP was solved for this input (the filter has none).
    SOLVED           the optimum; every row and the box hold within `RESIDUAL`.
    INFEASIBLE       no input in the box satisfies every row: a linear program, or multipliers, proved it.
    ITERATION_LIMIT  an input exists but was not found: report the arguments, it should not happen.
    """

    NONE = 0
    SOLVED = 1
    INFEASIBLE = 2
    ITERATION_LIMIT = 3


@dataclass(frozen=True, eq=False)
class Solution:
    """What `solve` found.

    u           (n,) the optimum if SOLVED; otherwise the input in the box that comes nearest to satisfying
                the rows, largest common margin first. Inside the box exactly, always finite.
    status      how it ended
    residual    largest violation over all rows given, in the rows' own unit, and the box; >= 0
    iterations  the solvers', over all attempts; 0 if none was needed
    refined     whether `nearest` replaced the solver's answer
    margin      the largest common row margin max_u min(rows u - rhs) if it was computed, else nan
    """

    u: Array
    status: Status
    residual: float
    iterations: int = 0
    refined: bool = False
    margin: float = float("nan")


def violation(u: Array, rows: Array, rhs: Array) -> float:
    """Largest shortfall of `rows u >= rhs` in the rows' unit; 0 if all hold or there are none."""
    return float(max(0.0, np.max(rhs - rows @ u, initial=0.0)))


def best_margin(rows: ArrayLike, rhs: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> tuple[float, Array]:
    """The largest t such that some input in the box has rows u - t >= rhs, and that input (n,).

    Negative t [unit of the rows] means that the rows contradict each other or the box. Linear program,
    solved by HiGHS. Raises RuntimeError if HiGHS cannot solve it (it is feasible and bounded).
    """
    from scipy.optimize import linprog

    A, b = np.atleast_2d(np.asarray(rows, float)), np.asarray(rhs, float)
    lo, hi = np.asarray(lower, float), np.asarray(upper, float)
    n = lo.size
    if b.size == 0:
        return float("inf"), 0.5 * (lo + hi)
    # Unit boxes and rows keep HiGHS's absolute tolerances meaningful; t stays in the unit of the rows.
    centre, half = 0.5 * (lo + hi), 0.5 * (hi - lo)
    scaled = A * half
    size = np.maximum(np.abs(scaled).max(axis=1), 1.0)
    matrix = np.column_stack([-scaled, np.ones(b.size)]) / size[:, None]
    result = linprog(
        np.r_[np.zeros(n), -1.0],
        A_ub=matrix,
        b_ub=(A @ centre - b) / size,
        bounds=[(-1.0, 1.0)] * n + [(None, None)],
        method="highs",
    )
    if result.x is None:
        raise RuntimeError(f"the margin program failed: {result.message}")
    u = np.clip(centre + half * result.x[:n], lo, hi)
    return float(np.min(A @ u - b)), u


def solve(
    target: ArrayLike,
    rows: Any,
    rhs: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    solver: Solver = "auto",
) -> Solution:
    """The input nearest to `target` inside the box and above the rows.

    target        (n,)    finite; it may lie outside the box
    rows, rhs     (m, n)  dense or scipy sparse, and (m,); any scale, m may be 0
    lower, upper  (n,)    lower <= upper
    solver        see `Solver`; either way OSQP is tried last, before ITERATION_LIMIT
    Returns a Solution; infeasibility is a status, not an exception.
    Raises  ValueError if shapes disagree, a number is not finite, lower > upper or the solver is unknown.
    Source  Squires et al. 2022, eqs. (9) and the limited-communication QP of "Control calculation".
    """
    check_solver(solver)
    t, b = np.array(target, float).ravel(), np.array(rhs, float).ravel()
    lo, hi = np.array(lower, float).ravel(), np.array(upper, float).ravel()
    A = np.asarray(rows.toarray() if hasattr(rows, "toarray") else rows, float).reshape(b.size, t.size)
    for name, a in (("target", t), ("rows", A), ("rhs", b), ("lower", lo), ("upper", hi)):
        if not np.isfinite(a).all():
            raise ValueError(f"the {name} of a QP must be finite, got {a[~np.isfinite(a)][0]}")
    if lo.shape != t.shape or hi.shape != t.shape or np.any(lo > hi):
        raise ValueError(f"a QP needs {t.size} limits with lower <= upper, got {lo} and {hi}")

    # The box is where each entry may go alone, so the clipped target is the optimum if the rows allow it.
    u = np.clip(t, lo, hi)
    if np.all(A @ u >= b):
        return Solution(u, Status.SOLVED, 0.0)
    # Entries with equal limits, or in no row, are constants. Leaving them out is exact in floating point
    # too, so vehicles in one plane stay in it: rounding in a climb rate would grow, since climbing apart is
    # safer.
    free = (lo < hi) & A.any(axis=0)
    if free.all():
        return _solve_active(t, A, b, lo, hi, solver)
    if not free.any():
        short = violation(u, A, b)
        return Solution(u, Status.SOLVED if short <= RESIDUAL else Status.INFEASIBLE, short, margin=-short)
    inner = _solve_active(t[free], A[:, free], b - A[:, ~free] @ u[~free], lo[free], hi[free], solver)
    u[free] = inner.u
    return replace(inner, u=u, residual=violation(u, A, b))


def check_solver(solver: str) -> None:
    """Raises ValueError for the name of no solver."""
    if solver not in SOLVERS:
        raise ValueError(f"unknown QP solver {solver!r}; choose one of {', '.join(SOLVERS)}")


def _solve_active(t: Array, A: Array, b: Array, lo: Array, hi: Array, solver: Solver) -> Solution:
    # Row norms reach hundreds per rad/s beside 1 per m/s, and a cubic alpha makes any rhs: unit rows.
    norm = np.linalg.norm(A, axis=1)
    norm[norm == 0.0] = 1.0
    unit, level = A / norm[:, None], b / norm
    iterations, margin = 0, float("nan")
    attempts: list[Callable[..., tuple[Array, Array, int, bool]]] = [
        partial(by_osqp, tolerance=tolerance, most=most) for tolerance, most in EFFORTS
    ]
    if solver == "auto":
        attempts.insert(0, active_set.attempt)
    for attempt in attempts:
        u, dual, used, claims_infeasible = attempt(t, unit, level, lo, hi)
        iterations += used
        if not claims_infeasible:
            u = np.clip(u, lo, hi)
            if optimality_error(u, dual, t, unit, level, lo, hi) <= ACCEPT and violation(u, A, b) <= RESIDUAL:
                return Solution(u, Status.SOLVED, violation(u, A, b), iterations)
        guess = None if claims_infeasible else (dual[: b.size] > 0) | (unit @ u - level < 1e-6)
        refined = None if claims_infeasible else nearest(t, unit, level, lo, hi, guess)
        if refined is not None and violation(refined, A, b) <= RESIDUAL:
            return Solution(refined, Status.SOLVED, violation(refined, A, b), iterations, refined=True)
        if np.isnan(margin):
            margin, fallback = best_margin(A, b, lo, hi)
            if margin < -0.5 * RESIDUAL:
                return Solution(
                    fallback, Status.INFEASIBLE, violation(fallback, A, b), iterations, False, margin
                )
    # Rows that only just contradict each other have no exact solution: relax them by less than RESIDUAL.
    for slack in (0.0, 0.4 * RESIDUAL + max(0.0, -margin)):
        refined = nearest(t, unit, level - slack / norm, lo, hi, None)
        if refined is not None and violation(refined, A, b) <= RESIDUAL:
            return Solution(refined, Status.SOLVED, violation(refined, A, b), iterations, True, margin)
    return Solution(fallback, Status.ITERATION_LIMIT, violation(fallback, A, b), iterations, False, margin)


def by_osqp(
    t: Array, A: Array, b: Array, lo: Array, hi: Array, tolerance: float, most: int
) -> tuple[Array, Array, int, bool]:
    """OSQP from a cold start: u (n,), the rows' multipliers (m,) >= 0, iterations, whether it found no u."""
    import osqp
    from scipy import sparse

    n, m = t.size, b.size
    matrix = sparse.csc_matrix(np.vstack([A, np.eye(n)]))
    upper = np.concatenate([np.full(m, np.inf), hi])
    solver = osqp.OSQP()
    # rho adapts by iteration count: adapting by elapsed time would make results depend on the machine's load.
    solver.setup(
        sparse.identity(n, format="csc"),
        -t,
        matrix,
        np.concatenate([b, lo]),
        upper,
        eps_abs=tolerance,
        eps_rel=tolerance,
        max_iter=most,
        adaptive_rho=1,
        adaptive_rho_interval=50,
        polishing=True,
        verbose=False,
    )
    result = solver.solve(raise_error=False)
    status = osqp.SolverStatus
    infeasible = result.info.status_val in (
        status.OSQP_PRIMAL_INFEASIBLE,
        status.OSQP_PRIMAL_INFEASIBLE_INACCURATE,
    )
    finite = result.x is not None and np.isfinite(result.x).all() and np.isfinite(result.y).all()
    if infeasible or not finite:
        return np.clip(t, lo, hi), np.zeros(m), int(result.info.iter), True
    # OSQP's multipliers are negative at a lower bound.
    return np.array(result.x), np.maximum(0.0, -result.y[:m]), int(result.info.iter), False


def optimality_error(u: Array, y: Array, t: Array, A: Array, b: Array, lo: Array, hi: Array) -> float:
    """How far (u, y) is from the Karush-Kuhn-Tucker conditions; 0 at the optimum, u being inside the box.

    With y >= 0 fixed the Lagrangian is least at clip(t + A' y); beside that every row needs the smaller of
    its multiplier and its slack to be zero. With unit rows all terms are in the unit of u.
    """
    # A QP without a solution may have infinite multipliers; the result is then nan, which is not trusted.
    with np.errstate(invalid="ignore"):
        stationary = np.abs(u - np.clip(t + y @ A, lo, hi)).max(initial=0.0)
    return float(max(stationary, np.abs(np.minimum(y, A @ u - b)).max(initial=0.0)))


def nearest(
    t: Array, A: Array, b: Array, lo: Array, hi: Array, guess: NDArray[np.bool_] | None
) -> Array | None:
    """The exact optimum by least-distance programs over a growing set of constraints; None if there is none.

    The optimum over some of the constraints is the optimum over all as soon as it satisfies all, so it starts
    from those in `guess` (m,) and adds the violated ones; every round adds one at least, so it ends. Each
    round is Lawson & Hanson, Solving Least Squares Problems (1974), ch. 23: min |x| with G x >= h by
    non-negative least squares.
    """
    from scipy.optimize import nnls

    n, m = t.size, b.size
    G = np.vstack([A, np.eye(n), -np.eye(n)])
    h = np.concatenate([b - A @ t, lo - t, t - hi])
    scale = max(1.0, float(np.abs(np.clip(t, lo, hi) - t).max(initial=0.0)))
    working = np.zeros(h.size, dtype=bool)
    if guess is not None:
        working[:m] = guess
    working[m:] = h[m:] > 0
    # scipy 1.17's nnls frees memory twice when it gets no columns: start from the most violated constraint.
    working[np.argmax(h)] = True
    while True:
        index = np.flatnonzero(working)
        try:
            y, _ = nnls(
                np.vstack([G[index].T, h[index] / scale]), np.eye(n + 1)[n], maxiter=30 * (n + index.size)
            )
        except RuntimeError:
            return None
        last = 1.0 - h[index] @ y / scale
        if last < 1e-12:
            return None  # a non-negative combination of the constraints says 0 >= 1
        x = scale * (y @ G[index]) / last
        # The active constraints as equations, to rounding; only the multipliers' support came from nnls.
        active = index[y > 0]
        exact = np.linalg.lstsq(G[active], h[active], rcond=None)[0]
        if np.max(h[index] - G[index] @ exact, initial=0.0) <= np.max(h[index] - G[index] @ x, initial=1e-12):
            x = exact
        violated = (h - G @ x > 1e-11 * scale) & ~working
        if not violated.any():
            return np.asarray(np.clip(t + x, lo, hi))
        working |= violated
