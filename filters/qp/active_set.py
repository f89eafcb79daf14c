"""Tries to solve quadratic programs by a dual active-set method; the only module that imports daqp.

Such a method ends at the optimum itself, to rounding, after about as many steps as constraints are active, so
it suits QPs with few of them. Its answers are checked by the caller like any other solver's.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Largest violation of a unit row that counts as satisfied. daqp's own 1e-6 would leave that much unsolved;
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
    u, dual, iterations, found = attempt_each(t[None], np.array([b.size]), A, b, lo[None], hi[None])
    return u[0], dual, int(iterations[0]), not found[0]


def attempt_each(
    t: Array, count: Indices, A: Array, b: Array, lo: Array, hi: Array
) -> tuple[Array, Array, NDArray[np.int_], NDArray[np.bool_]]:
    """`attempt` at V QPs of n entries, t, lo and hi being (V, n); the k-th has the next count[k] of the rows.

    Returns u (V, n), multipliers (R,) >= 0, iterations (V,), and whether it found a u (V,). Each is solved
    for itself: no QP changes another's bytes.
    """
    import daqp

    V, n = t.shape
    end = np.cumsum(count)
    # daqp takes the limits of the entries and then of the rows: a line of these arrays, as far as it is used.
    lower, upper = np.full((2, V, n + int(count.max())), UNBOUNDED)
    lower[:, :n], upper[:, :n] = lo, hi
    owner = np.repeat(np.arange(V), count)
    lower[owner, np.arange(n, n + b.size) - (end - count)[owner]] = b
    u, dual = np.empty_like(t), np.empty_like(b)
    iterations, found = np.zeros(V, dtype=int), np.zeros(V, dtype=bool)
    solve, identity, linear, start = daqp.solve, _identity(n), -t, 0
    for k, stop in enumerate(end.tolist()):
        width = n + stop - start
        u[k], _, flag, info = solve(
            identity,
            linear[k],
            A[start:stop],
            upper[k, :width],
            lower[k, :width],
            primal_tol=PRIMAL_TOLERANCE,
        )
        dual[start:stop], iterations[k], found[k] = info["lam"][n:], info["iterations"], flag == OPTIMAL
        start = stop
    # daqp's multipliers are negative at a lower bound.
    return u, np.maximum(-dual, 0.0), iterations, found
