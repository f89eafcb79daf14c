"""Gives every pair a barrier of its own, which the paper's Assumption 1 excludes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.barriers.pairs import Barrier, Index, PairValues, chosen_pairs, vehicle_of
from filters.model import Array, Command, State


@dataclass(frozen=True)
class PerPair:
    """A barrier of its own for every pair, in the order (1,2), (1,3), ..., (2,3), ...

    Breaks the shared-manoeuvre assumption (Squires et al. 2022, Assumption 1) unless all manoeuvres agree, so
    rows may contradict each other inside the safe set. This class exists to show that.
    """

    barriers: tuple[Barrier, ...]

    @property
    def d_safe(self) -> float:
        """The largest Ds of the barriers, m."""
        return max(b.d_safe for b in self.barriers)

    def manoeuvre(self, n: int) -> Command | None:
        """None: the pairs share no manoeuvre."""
        return None

    def values(self, state: State, i: Index | None = None, j: Index | None = None) -> PairValues:
        """As `Barrier.values`, each pair by its own barrier.

        Raises  ValueError if the state has another number of pairs than there are barriers.
        """
        i, j = chosen_pairs(state, i, j)
        h, grad = np.empty(vehicle_of(i).size), np.empty((vehicle_of(i).size, 8))
        for p, barrier in enumerate(self._of(i, j, len(state))):
            one = barrier.values(state, _only(i, p), _only(j, p))
            h[p], grad[p] = one.h[0], one.grad[0]
        return PairValues(i, j, h, grad)

    def manoeuvres(self, i: Index, j: Index, n: int) -> tuple[Array, Array] | None:
        """gamma of each pair's own barrier for its two vehicles, (P, 3) each; None if one has none."""
        found = [barrier.manoeuvre(n) for barrier in self._of(i, j, n)]
        own = [gamma.array() for gamma in found if gamma is not None]
        if len(own) < len(found):
            return None
        gamma = np.array(own).reshape(-1, n, 3)
        p = np.arange(len(gamma))
        return gamma[p, vehicle_of(i)], gamma[p, vehicle_of(j)]

    def _of(self, i: Index, j: Index, n: int) -> list[Barrier]:
        if n * (n - 1) // 2 != len(self.barriers):
            raise ValueError(
                f"{n} vehicles have {n * (n - 1) // 2} pairs, but {len(self.barriers)} barriers were given"
            )
        a, b = np.minimum(vehicle_of(i), vehicle_of(j)), np.maximum(vehicle_of(i), vehicle_of(j))
        return [self.barriers[p] for p in a * (2 * n - a - 1) // 2 + b - a - 1]


def _only(index: Index, p: int) -> Index:
    return tuple(_only(a, p) for a in index) if isinstance(index, tuple) else index[p : p + 1]
