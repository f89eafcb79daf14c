"""Proves that a quadratic program has no solution, faster than by finding its largest common margin."""

from __future__ import annotations

import numpy as np

from filters.model import Array
from filters.qp import single


def impossible(rows: Array, rhs: Array, lower: Array, upper: Array) -> bool:
    """Whether multipliers prove that every input in the box leaves some row short by more than `qp.RESIDUAL`.

    False is no proof of the contrary. With weights w >= 0 of the rows no input does better than
    max over the box of w (rows u - rhs) = -gap, so the largest common margin is at most -gap / sum w.
    The weights are Farkas', by non-negative least squares; they are checked here.
    """
    from scipy.optimize import nnls

    centre, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    matrix, level = rows * half, rhs - rows @ centre
    size = np.maximum(np.abs(matrix).max(axis=1), 1e-12)
    matrix, level, box = matrix / size[:, None], level / size, np.eye(half.size)
    constraints = np.vstack([np.vstack([matrix, box, -box]).T, np.r_[level, np.full(2 * half.size, -1.0)]])
    try:
        weights, _ = nnls(constraints, np.eye(half.size + 1)[half.size])
    except RuntimeError:
        return False
    weights = weights[: rhs.size]
    gap = weights @ level - np.abs(weights @ matrix).sum()
    return bool(gap > single.RESIDUAL * (weights / size).sum())
