"""One attempt at a quadratic program by a dual active-set method: the only module that imports daqp.

Such a method ends at the optimum itself, to rounding, after about as many steps as constraints are active, so
it suits QPs with few of them. Its answers are checked by the caller like any other solver's.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Largest violation of a unit row that passes for none. daqp's own 1e-6 would leave that much unsolved;
# rounding at inputs of some 40 m/s is 1e-14.
PRIMAL_TOLERANCE = 1e-11
# What daqp takes for infinity.
UNBOUNDED = 1e30
# The only exit flag of daqp that claims an optimum.
OPTIMAL = 1


@lru_cache(maxsize=64)
def _identity(n: int) -> Array:
    return np.eye(n)


def attempt(t: Array, A: Array, b: Array, lo: Array, hi: Array) -> tuple[Array, Array, int, bool]:
    """The input nearest to `t` (n,) with A u >= b, `A` (m, n) of unit rows, and lo <= u <= hi.

    Returns u (n,), the rows' multipliers (m,) >= 0, iterations, and whether it found no u. Nothing is kept
    between calls, so equal arguments give equal bytes.
    Source  Arnstroem, Bemporad & Axehill, IEEE Trans. Automatic Control 67(8), 2022.
    """
    import daqp

    n, m = t.size, b.size
    upper = np.full(n + m, UNBOUNDED)
    upper[:n] = hi
    x, _, flag, info = daqp.solve(
        _identity(n), -t, A, upper, np.concatenate((lo, b)), primal_tol=PRIMAL_TOLERANCE
    )
    # daqp's multipliers are negative at a lower bound.
    return x, np.maximum(-info["lam"][n:], 0.0), info["iterations"], flag != OPTIMAL
