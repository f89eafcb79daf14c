"""Works out what vehicles in layers want that know of the evading turn, by formulas of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import floor, inf, pi, sqrt

# Beyond Ds, between heights to park at [m]; what counts as nearer to the goal [m].
SPARE_M, NEARER_M = 3.0, 1.0
# So many changes of layer are worked out; then their heights come again.
CHANGES = 100
GOLDEN = (sqrt(5.0) - 1.0) / 2.0


def parking_height(layers: Sequence[tuple[float, int]], k: int, d_safe: float) -> float:
    """The height [m] of its own at which vehicle k (from 0) flies the turn after its goal.

    layers  height and vehicle of all that fly in layers

    The lower half of them parks below the lowest layer, the others above the highest, those of the middle
    layers nearest; vehicles in one layer are in the order of their numbers.
    """
    order = sorted(layers)
    rank, half = [v for _, v in order].index(k), len(order) // 2
    gap = d_safe + SPARE_M
    return order[0][0] - gap * (half - rank) if rank < half else order[-1][0] + gap * (rank - half + 1)


def changed_layer(layers: Sequence[tuple[float, int]], k: int, changes: int) -> float | None:
    """The layer [m] of vehicle k (from 0) after so many changes, from 1 on; None where there is no other.

    Each change goes up the distinct layers, and from the highest on to the lowest. The m-th of vehicle number
    n goes up by 1 + floor(f (count - 1)) layers, f being the fraction of n m (sqrt(5) - 1) / 2.
    """
    heights = sorted({round(height, 6) for height, _ in layers})
    if len(heights) < 2:
        return None
    own = next(height for height, v in layers if v == k)
    at = min(range(len(heights)), key=lambda m: abs(heights[m] - own))
    for m in range(1, (changes - 1) % CHANGES + 2):
        at += 1 + floor((k + 1) * m * GOLDEN % 1.0 * (len(heights) - 1))
    return heights[at % len(heights)]


@dataclass
class Waiting:
    """Which layer a vehicle is in that changes it after half a circle without coming nearer to its goal.

    layers  of all that fly in layers;  k  the vehicle, from 0;  layer  its own [m]
    turn    rad/s, of the evading turn
    """

    layers: Sequence[tuple[float, int]]
    k: int
    layer: float
    turn: float
    nearest: float = field(default=inf, init=False)
    since: float = field(default=0.0, init=False)
    changes: int = field(default=0, init=False)

    def at(self, t: float, away: float, there: bool) -> float:
        """The layer [m] at t [s], the goal `away` [m]; who has been there waits no more."""
        if away < self.nearest - NEARER_M:
            self.nearest, self.since = away, t
        if t - self.since > pi / abs(self.turn) and not there:
            self.nearest, self.since = away, t
            self.changes += 1
            other = changed_layer(self.layers, self.k, self.changes)
            self.layer = self.layer if other is None else other
        return self.layer
