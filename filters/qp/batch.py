"""Solves many small quadratic programs of one step: all prepared and checked together, each solved alone.

Preparing and checking a QP of three variables costs more than solving it, so both are done for all at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.constraints import dot, taken
from filters.qp import active_set, single
from filters.qp.infeasibility import impossible
from filters.qp.single import Solver, Status

Array = NDArray[np.float64]


def solve_each(
    target: Array,
    owner: NDArray[np.intp],
    rows: Array,
    rhs: Array,
    lower: Array,
    upper: Array,
    solver: Solver = "auto",
    fallback: Array | None = None,
) -> tuple[Array, NDArray[np.int_]]:
    """The inputs nearest to each vehicle's target inside its box and above its rows: `qp.solve` for each.

    target, lower, upper  (N, 3)
    owner      (R,)            whose row it is, from 0
    rows, rhs  (R, 3), (R,)
    fallback   (N, 3) inputs of those whose QP has no solution; None is what `qp.solve` gives, for which
               infeasible QPs take several times longer
    Returns u (N, 3) and `qp.Status` (N,); a vehicle without rows gets its clipped target, SOLVED.
    Raises  ValueError as `qp.solve`.
    """
    single.check_solver(solver)
    u = np.minimum(np.maximum(target, lower), upper)
    status = np.full(len(u), int(Status.SOLVED))
    if owner.size == 0:
        return u, status
    order = np.argsort(owner, kind="stable")
    rows, rhs = taken(rows, order), rhs[order]
    count = np.bincount(owner, minlength=len(u))
    who = np.flatnonzero(count)
    count = count[who]
    solved = np.zeros(who.size, dtype=bool)
    # What is not a proper QP is left to `qp.solve` to refuse. Finite sums of squares: so is every number.
    size = np.vdot(rows, rows) + np.vdot(rhs, rhs) + np.vdot(target, target) + np.vdot(u, u)
    proper = np.isfinite(size) and not (lower > upper).any()
    if solver == "auto" and proper:
        u[who], solved = _together(target[who], u[who], count, rows, rhs, lower[who], upper[who])
    if not solved.all():
        end = np.cumsum(count)
        for k in np.flatnonzero(~solved):
            v, own = who[k], slice(end[k] - count[k], end[k])
            if fallback is not None and proper and impossible(rows[own], rhs[own], lower[v], upper[v]):
                u[v], status[v] = fallback[v], int(Status.INFEASIBLE)
                continue
            solution = single.solve(target[v], rows[own], rhs[own], lower[v], upper[v], solver)
            u[v], status[v] = solution.u, int(solution.status)
    return u, status


def _together(
    target: Array,
    clipped: Array,
    count: NDArray[np.intp],
    rows: Array,
    rhs: Array,
    lower: Array,
    upper: Array,
) -> tuple[Array, NDArray[np.bool_]]:
    """One attempt at V QPs, the k-th having the next count[k] >= 1 rows: u (V, 3), and which to trust.

    Trusted is what `qp.solve` would take as it is: the conditions of optimality and all rows hold.
    """
    first = np.cumsum(count) - count
    place = np.repeat(np.arange(len(count)), count)
    # As in `qp.solve`: entries with equal limits, or in no row, are constants, kept to the last bit.
    choice = lower < upper
    free = choice & np.logical_or.reduceat(rows != 0.0, first, axis=0)
    t = np.where(free, target, clipped)
    matrix, level = rows, rhs
    if not choice.all():
        each = choice[place]
        level = rhs - dot(np.where(each, 0.0, rows), taken(clipped, place))
        matrix = np.where(each, rows, 0.0)
        # Limits moved apart on both sides, so that equal limits are no active constraints.
        lower, upper = np.where(choice, lower, clipped - 1.0), np.where(choice, upper, clipped + 1.0)
    norm = np.sqrt(dot(matrix, matrix))
    norm[norm == 0.0] = 1.0
    unit, level = matrix / norm[:, None], level / norm
    found, dual, _, trusted = active_set.attempt_each(t, count, unit, level, lower, upper)
    u = np.where(free, np.minimum(np.maximum(found, lower), upper), clipped)

    # A QP without a solution may have infinite multipliers; the result is then nan, which is not trusted.
    with np.errstate(invalid="ignore"):
        pull = np.add.reduceat(dual[:, None] * unit, first, axis=0)
    stationary = np.abs(u - np.minimum(np.maximum(t + pull, lower), upper)).max(axis=1)
    slack = dot(unit, taken(u, place)) - level
    fine = (np.abs(np.minimum(dual, slack)) <= single.ACCEPT) & (norm * slack >= -single.RESIDUAL)
    return u, trusted & (stationary <= single.ACCEPT) & np.logical_and.reduceat(fine, first)
