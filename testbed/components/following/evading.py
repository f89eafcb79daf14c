"""What vehicles in layers do so as not to bar others: heights to park at, and other layers for who waits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from filters.model import Array, Command

# What counts as nearer to the goal [m], and the share of an evading circle after which a layer is changed.
NEARER_M, PATIENCE = 1.0, 0.5
# Jumps to other layers that are made up beforehand; then they are repeated.
_JUMPS, _GOLDEN = 100, 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True, eq=False)
class Evading:
    """What vehicles (N,) in layers know of the evading turn and of the layers.

    gamma    (N,) the evading turn
    others   of each the heights [m] of layers that it changes to, one after the other
    parking  (N,) m, the height beyond all layers that it flies gamma at after its goal
    """

    gamma: Command
    others: Sequence[Array]
    parking: Array

    def of(self, vehicles: np.ndarray) -> Evading:
        """The same of some vehicles."""
        return Evading(self.gamma[vehicles], [self.others[k] for k in vehicles], self.parking[vehicles])

    @property
    def sense(self) -> float:
        """+1 or -1, of the turn."""
        return float(np.sign(self.gamma.omega[0]))


def evading(gamma: Command, layer: Array, spacing: float) -> Evading:
    """Of vehicles whose layers (N,) m are known; nan of those that fly in none.

    Raises  ValueError where gamma does not turn, or not all of them in one sense
    """
    sides = np.sign(gamma.omega)
    if sides[0] == 0 or (sides != sides[0]).any():
        raise ValueError("vehicles that make way by an evading turn need one, and this manoeuvre has none")
    return Evading(gamma, _other_layers(layer), _parking(layer, spacing))


class Waiting:
    """Counts for how long vehicles come no nearer to their goals, and changes the layer of who waits.

    layer  (N,) m, at the start
    """

    def __init__(self, known: Evading, layer: Array) -> None:
        self.layer = layer.copy()
        self._known, n = known, len(layer)
        self._nearest, self._since = np.full(n, np.inf), np.zeros(n)
        self._changes = np.zeros(n, dtype=int)
        self._patience = PATIENCE * 2 * np.pi / np.abs(known.gamma.omega)

    def see(self, t: float, level: Array, arrived: np.ndarray) -> None:
        """At t [s] the goals are `level` (N,) m away; vehicles that have arrived wait for nothing."""
        nearer = level < self._nearest - NEARER_M
        self._nearest = np.where(nearer, level, self._nearest)
        self._since = np.where(nearer, t, self._since)
        for k in map(int, np.flatnonzero((t - self._since > self._patience) & ~arrived)):
            self._nearest[k], self._since[k] = level[k], t
            others = self._known.others[k]
            if len(others):
                self.layer[k] = float(others[int(self._changes[k]) % len(others)])
                self._changes[k] += 1


def _other_layers(layer: Array) -> list[Array]:
    """The layers that each vehicle changes to, of those of all (N,); nan flies in none.

    Each goes up by jumps of its own, cyclically: two that bar one another's way in one layer part.
    """
    heights = np.unique(np.round(layer[np.isfinite(layer)], 6))
    count, made = len(heights), []
    for k, own in enumerate(layer):
        if count < 2 or not np.isfinite(own):
            made.append(heights[:0])
            continue
        share = np.mod((k + 1) * np.arange(1, _JUMPS + 1) * _GOLDEN, 1.0)
        jumps = 1 + np.floor(share * (count - 1)).astype(int)
        made.append(heights[(int(np.argmin(np.abs(heights - own))) + np.cumsum(jumps)) % count])
    return made


def _parking(layer: Array, spacing: float) -> Array:
    """(N,) m, a height of each vehicle's own beyond all layers (N,): above them for the upper half."""
    made, there = layer.copy(), np.flatnonzero(np.isfinite(layer))
    order = there[np.argsort(layer[there], kind="stable")]
    half = len(order) // 2
    made[order[:half][::-1]] = layer[order[0]] - spacing * np.arange(1, half + 1)
    made[order[half:]] = layer[order[-1]] + spacing * np.arange(1, len(order) - half + 1)
    return made
