"""Least distances between straight paths, for arrays whose first axis is east, north and up."""

from __future__ import annotations

import numpy as np

from filters.model import Array


def square(v: Array) -> Array:
    """The squared length (...) of vectors (3, ...)."""
    x, y, z = v * v
    return np.asarray(x + y + z)


def closest(offset: Array) -> Array:
    """Least distance (n - 1, P) between straight paths whose offsets at n instants are `offset` (3, n, P)."""
    a, move = offset[:, :-1], np.diff(offset, axis=1)
    length = square(move)
    along = a * move
    share = -(along[0] + along[1] + along[2]) / np.where(length > 0.0, length, 1.0)
    nearest = a + np.minimum(np.maximum(share, 0.0), 1.0) * move
    return np.sqrt(square(nearest))
