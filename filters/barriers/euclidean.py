"""Computes the clearance of each pair now, which the paper shows to be no barrier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.barriers.pairs import (
    ARRAYS,
    Index,
    PairValues,
    by_blocks,
    check_separation,
    chosen_pairs,
    form_function,
)
from filters.model import Array, Command, State


@dataclass(frozen=True, eq=False)
class EuclideanBarrier:
    """The clearance of each pair now: the paper's example of a function that is no barrier.

    d_safe  m, separation to keep
    form    "root" (h in m) or "squared" (h in m^2, the paper's)
    gamma   what vehicles fly when there is no solution, (N,) or numbers for all; h itself uses no manoeuvre
    Raises  ValueError for parameters out of range.
    Source  Squires et al. 2022, Motivating Example. On its head-on state the sup of hdot + alpha(h) over the
            inputs is -4 Ds v_min + 8 eps zeta_max + alpha(4 eps^2) in squared form (printed: 2 eps zeta_max).
    """

    d_safe: float
    form: str = "root"
    gamma: Command | None = None

    def __post_init__(self) -> None:
        check_separation(self.d_safe)
        form_function(self.form)

    def manoeuvre(self, n: int) -> Command | None:
        """(n,): the fallback manoeuvre given, None without one."""
        if self.gamma is None:
            return None
        v, omega, zeta = (np.broadcast_to(c, n) for c in (self.gamma.v, self.gamma.omega, self.gamma.zeta))
        return Command(v, omega, zeta)

    def values(self, state: State, i: Index | None = None, j: Index | None = None) -> PairValues:
        """h and gradient (see `Barrier.values`)."""
        form = form_function(self.form)

        def kernel(i: Index, j: Index, grad: Array) -> Array:
            dx, dy, dz = (a[i] - a[j] for a in (state.x, state.y, state.z))
            h, slope = form(dx * dx + dy * dy + dz * dz, self.d_safe, ARRAYS)
            slope = 2.0 * slope
            grad[0], grad[1], grad[2], grad[3] = slope * dx, slope * dy, 0.0, slope * dz
            np.negative(grad[:4], out=grad[4:])
            return np.asarray(h)

        return by_blocks(*chosen_pairs(state, i, j), kernel)
