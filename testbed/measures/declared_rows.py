"""Judges the rows that a user's own filter declares: whether they are satisfied, and had a solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from filters.constraints import Constraints
from filters.model import Array, Limits
from filters.qp.single import RESIDUAL, best_margin


@dataclass
class DeclaredRows:
    """What was found of the declared rows over a run, whatever the filter says of them.

    least       the smallest L_g h u - rhs of any row under the filter's commands; inf without rows, NaN once
                there was one
    t, vehicles of that row: s, and from 0
    unsolvable  filter steps at which no input in U satisfies all rows, by a linear program; `first` s of them
    """

    limits: Limits
    least: float = np.inf
    t: float = np.nan
    vehicles: tuple[int, ...] = ()
    unsolvable: int = 0
    first: float = np.nan

    def update(self, t: float, blocks: Sequence[Constraints], u: Array) -> None:
        """Take in the rows declared at time t [s], and the commands u (N, 3), finite."""
        low, high = self.limits.corners
        satisfied = bool(np.all((u >= low) & (u <= high)))
        for rows in blocks:
            if not rows.h.size:
                continue
            slack = rows.left(u) - rows.rhs
            worst = int(np.argmin(slack))
            satisfied &= bool(slack[worst] >= -RESIDUAL)
            if not slack[worst] >= self.least and not np.isnan(self.least):
                self.least, self.t = float(slack[worst]), t
                self.vehicles = tuple(int(v[worst]) for v in rows.vehicles)
        # Inputs that satisfy all rows are a solution; otherwise there may be another one.
        if not satisfied and not _solvable(blocks, low, high):
            self.unsolvable += 1
            self.first = t if np.isnan(self.first) else self.first


def _solvable(blocks: Sequence[Constraints], low: Array, high: Array) -> bool:
    """Whether some inputs between low and high (N, 3) satisfy all rows."""
    matrices, rhs = [], []
    for rows in blocks:
        matrix = np.zeros((rows.h.size, *low.shape))
        for vehicle, lie in zip(rows.vehicles, rows.lie, strict=True):
            matrix[np.arange(rows.h.size), vehicle] += lie
        matrices.append(matrix.reshape(rows.h.size, low.size))
        rhs.append(rows.rhs)
    if not matrices:
        return True
    try:
        margin, _ = best_margin(np.concatenate(matrices), np.concatenate(rhs), low.ravel(), high.ravel())
    except (RuntimeError, ValueError):  # the solver gave up, or a number is not finite: nothing is proved
        return False
    return margin >= -RESIDUAL
