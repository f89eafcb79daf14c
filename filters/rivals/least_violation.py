"""Solves each vehicle's QP, or finds the input that violates its rows least where none satisfies them all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.constraints import Indices, dot
from filters.model import Array
from filters.qp import active_set, single
from filters.qp.single import Status

# Weight of the largest violation against the distance to the target. A violation with a price above the
# multipliers of the rows is made only where it has to be: then the program with it has the QP's solution.
WEIGHT = 1e4
# Largest violation that is looked for, in inputs.
MOST = 1e6


def solve_or_violate_least(
    target: Array, owner: Indices, rows: Array, level: Array, lower: Array, upper: Array
) -> tuple[Array, NDArray[np.int_]]:
    """The inputs nearest to each vehicle's target inside its box with rows u >= level, as far as that goes.

    target, lower, upper  (N, 3)     owner, rows, level  (R,), (R, 3), (R,)
    Where no input satisfies a vehicle's rows, it gets the one whose largest shortfall, each divided by its
    row's norm, is least; its status is INFEASIBLE. One QP a vehicle, with the shortfall as a fourth entry.
    Returns u (N, 3) and `qp.Status` (N,); without rows the clipped target, SOLVED.
    """
    u = np.minimum(np.maximum(target, lower), upper)
    status = np.full(len(u), int(Status.SOLVED))
    norm = np.sqrt(dot(rows, rows))
    order = np.argsort(owner, kind="stable")
    order = order[norm[order] > 0]
    if not order.size:
        return u, status
    owner, unit = owner[order], rows[order] / norm[order, None]
    level = level[order] / norm[order]
    # An entry without a choice is a constant: its part goes to the right-hand side, its limits apart.
    choice = lower < upper
    matrix = np.where(choice[owner], unit, 0.0)
    due = level - dot(unit - matrix, u[owner])
    low, high = np.where(choice, lower, u - 1.0), np.where(choice, upper, u + 1.0)
    count = np.bincount(owner, minlength=len(u))
    who = np.flatnonzero(count)
    wide = np.column_stack([matrix, np.ones(owner.size)])
    box = np.insert(low[who], 3, 0.0, axis=1), np.insert(high[who], 3, MOST, axis=1)
    goal = np.insert(np.where(choice, target, u)[who], 3, -WEIGHT, axis=1)
    found, _, _, fine = active_set.attempt_each(goal, count[who], wide, due, *box)
    for k in np.flatnonzero(~fine):
        own = owner == who[k]
        found[k] = single.solve(goal[k], wide[own], due[own], box[0][k], box[1][k]).u
    u[who] = np.where(choice[who], np.minimum(np.maximum(found[:, :3], lower[who]), upper[who]), u[who])
    short = np.zeros(len(u))
    np.maximum.at(short, owner, (level - dot(unit, u[owner])) * np.maximum(norm[order], 1.0))
    status[short > single.RESIDUAL] = int(Status.INFEASIBLE)
    return u, status
