"""Measures the barrier that a user's own filter declares: h, its condition and rows at the true states."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from filters.barriers.pairs import PairValues
from filters.constraints import dot, taken
from filters.model import Array, State
from testbed.measures.extreme import Extreme


@dataclass
class DeclaredBarrier:
    """Extremes per pair (P,) over a run, computed from the declared barrier and alpha at the true states.

    alpha      whether the filter declares an alpha; without one there are no condition and no rows
    h          at every filter step
    condition  hdot + alpha(h) along the motion that followed, over each filter period
    rows       L_g h u + alpha(h) under the filter's commands
    """

    pairs: int
    alpha: bool
    h: Extreme = field(init=False)
    condition: Extreme = field(init=False)
    rows: Extreme = field(init=False)

    def __post_init__(self) -> None:
        self.h, self.condition, self.rows = (Extreme.of(self.pairs) for _ in range(3))

    def update(self, t: Array, values: Array, new: int, dt: float) -> None:
        """Take in the values (3, S, P) of `at_one_step` at the times t (S,), `dt` [s] apart.

        new  the first of these steps that was not taken in before; their motion since is new of all but it
        """
        h, alpha_h, left = values
        self.h.update(t[new:], h[new:])
        if not self.alpha:
            return
        self.rows.update(t[new:], left[new:])
        if len(t) > 1:
            left = np.isposinf(h[1:])  # a pair that has left by then
            rate = np.diff(np.where(np.isposinf(h), 0.0, h), axis=0) / dt
            self.condition.update(t[:-1], np.where(left, np.inf, rate + alpha_h[:-1]))


def at_one_step(pairs: PairValues, alpha_h: Array | None, state: State, u: Array | None) -> Array:
    """h, alpha(h) and L_g h u + alpha(h) of all pairs, (3, P).

    pairs    the declared barrier's values at the true `state` (N,)
    alpha_h  (P,); None, where the filter declares no alpha, gives nan
    u        (N, 3) the filter's commands; None, where the vehicles fly others, gives inf
    """
    found = np.full((3, len(pairs.h)), np.nan)
    found[0] = pairs.h
    if alpha_h is not None:
        lie_i, lie_j = pairs.lie(state)
        found[1], found[2] = alpha_h, np.inf
        if u is not None:
            found[2] = dot(lie_i, taken(u, pairs.i)) + dot(lie_j, taken(u, pairs.j)) + alpha_h
    return found
