"""Many small quadratic programs of one step: prepared and checked together, each solved for itself.

What surrounds a solver of three variables costs more than the solver, so it is done for all QPs in one pass.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters import active_set, qp
from filters.qp import Solver, Status

Array = NDArray[np.float64]


def solve_each(
    target: Array,
    owner: NDArray[np.intp],
    rows: Array,
    rhs: Array,
    lower: Array,
    upper: Array,
    solver: Solver = "auto",
) -> tuple[Array, NDArray[np.int_]]:
    """The inputs nearest to each vehicle's target inside its box and above its rows: `qp.solve` for each.

    target, lower, upper  (N, n)
    owner      (R,)            whose row it is, from 0
    rows, rhs  (R, n), (R,)
    Returns u (N, n) and `qp.Status` (N,); who owns no row gets its clipped target, SOLVED.
    Raises  ValueError as `qp.solve`.
    """
    qp.check_solver(solver)
    u = np.minimum(np.maximum(target, lower), upper)
    status = np.full(len(u), int(Status.SOLVED))
    if owner.size == 0:
        return u, status
    order = np.argsort(owner, kind="stable")
    owner, rows, rhs = owner[order], rows[order], rhs[order]
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    who = owner[first]
    last = np.append(first[1:], owner.size)
    solved = np.zeros(who.size, dtype=bool)
    # What is not a proper QP is left to `qp.solve` to refuse: its finite sum shows that no number is missing.
    proper = np.isfinite(rows.sum() + rhs.sum() + u.sum() + target.sum()) and not (lower > upper).any()
    if solver == "auto" and proper:
        u[who], solved = _together(target[who], u[who], first, last, rows, rhs, lower[who], upper[who])
    for k in np.flatnonzero(~solved):
        v, own = who[k], slice(first[k], last[k])
        solution = qp.solve(target[v], rows[own], rhs[own], lower[v], upper[v], solver)
        u[v], status[v] = solution.u, int(solution.status)
    return u, status


def _together(
    target: Array,
    clipped: Array,
    first: NDArray[np.intp],
    last: NDArray[np.intp],
    rows: Array,
    rhs: Array,
    lower: Array,
    upper: Array,
) -> tuple[Array, NDArray[np.bool_]]:
    """One attempt at each of V QPs, number k having the rows first[k]:last[k]: u (V, n), and which to trust.

    Trusted is what `qp.solve` would take as it is: the conditions of optimality and all rows hold.
    """
    count = last - first
    # As in `qp.solve`: entries without a choice, or in no row, are data, kept to the last bit.
    free = (lower < upper) & np.logical_or.reduceat(rows != 0.0, first, axis=0)
    matrix, level, t = rows, rhs, target
    if not free.all():
        each = np.repeat(free, count, axis=0)
        level = rhs - np.where(each, 0.0, rows * np.repeat(clipped, count, axis=0)).sum(axis=1)
        matrix = np.where(each, rows, 0.0)
        t = np.where(free, target, clipped)
        lower, upper = np.where(free, lower, clipped - 1.0), np.where(free, upper, clipped + 1.0)
    norm = np.sqrt(np.einsum("rn,rn->r", matrix, matrix))
    norm[norm == 0.0] = 1.0
    unit, level = matrix / norm[:, None], level / norm
    found, dual = np.empty_like(t), np.empty_like(level)
    claims_none = np.zeros(len(t), dtype=bool)
    for k, (a, b) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        found[k], dual[a:b], _, claims_none[k] = active_set.attempt(
            t[k], unit[a:b], level[a:b], lower[k], upper[k]
        )
    u = np.where(free, np.minimum(np.maximum(found, lower), upper), clipped)

    pull = np.add.reduceat(dual[:, None] * unit, first, axis=0)
    stationary = np.abs(u - np.minimum(np.maximum(t + pull, lower), upper)).max(axis=1)
    at_rows = np.repeat(u, count, axis=0)
    complementary = np.minimum(dual, np.einsum("rn,rn->r", unit, at_rows) - level)
    short = rhs - np.einsum("rn,rn->r", rows, at_rows)
    trusted = ~claims_none & (stationary <= qp.ACCEPT)
    trusted &= np.maximum.reduceat(np.abs(complementary), first) <= qp.ACCEPT
    trusted &= np.maximum.reduceat(short, first) <= qp.RESIDUAL
    return u, trusted
