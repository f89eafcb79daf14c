"""Chooses the phases of gamma's circle at which a pair is looked at, so that those left out need no row.

The phases are a grid that stands still on the circles: as long as gamma is flown, the same points are looked
at in every period. Of this grid a pair needs the phase at which it is nearest, its neighbours, and others
further and further apart.

Why the rest may be left out: with D between the centres and q the difference of the arms, the squared
distance is C - 2 W cos(phi - phi*), W = |D| |q|. The rows keep a sample's distance d at d - kappa (d - Ds -
m) or more. So its square stays larger than that of the nearest phase phi' by at least (1 - kappa)^2 times
what it is now, 2 W (cos(phi' - phi*) - cos(phi - phi*)). Between two samples the least distance is at one
of them, or at the new phi*, within half their gap g of one of them; there the square is less than at that
sample by 2 W' (1 - cos(g / 2)) at most. So the samples suffice where W' <= W `limit` (1 - kappa)^2. For
other pairs, which fly almost parallel, the whole grid is looked at.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from filters.constraints import Indices
from filters.model import Array

_GROWTH = 1.8


class Phases:
    """The grid of phases, at most `step` rad apart.

    count   phases of the whole circle
    limit   see the module
    """

    def __init__(self, step: float) -> None:
        self.count = max(int(np.ceil(2 * np.pi / step)), 8)
        self.step = 2 * np.pi / self.count
        side = [0]
        while side[-1] < self.count // 2:
            side.append(min(self.count // 2, max(side[-1] + 1, int(_GROWTH * side[-1]))))
        self.limit = self._limit(side)
        self._offsets = np.array([-k for k in side[:0:-1]] + side)
        self._turn = np.exp(1j * self.step * np.arange(self.count))

    def _limit(self, side: list[int]) -> float:
        """How much larger W' may be than W, for kappa = 0; infinite if no phase is left out."""
        found = np.inf
        for a, b in itertools.pairwise(side):
            if b - a > 1:
                lost = 1 - np.cos(0.5 * (b - a) * self.step)
                # phi* is up to half a step from the nearest phase of the grid.
                found = min(found, (np.cos(0.5 * self.step) - np.cos((a - 0.5) * self.step)) / lost)
        return float(found)

    def chosen(
        self, nearest: Array, turned: float, whole: NDArray[np.bool_]
    ) -> tuple[Indices, NDArray[np.complex128]]:
        """Index of the pair, and exp(j phi), of all samples (S,).

        nearest  (L,) rad, phi* of the pairs
        turned   rad, from where the grid stands to where the arms are
        whole    (L,) which pairs need the whole grid
        """
        few, all_ = np.flatnonzero(~whole), np.flatnonzero(whole)
        index = np.round((nearest[few] + turned) / self.step).astype(int)
        index = (index[:, None] + self._offsets) % self.count
        pair = np.concatenate([np.repeat(few, self._offsets.size), np.repeat(all_, self.count)])
        turn = np.concatenate([self._turn[index.ravel()], np.tile(self._turn, all_.size)])
        return pair, turn * np.exp(-1j * turned)
