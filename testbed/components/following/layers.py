"""Guidance in layers of height: climbs to the layer, holds it, descends to the goal."""

from __future__ import annotations

from collections.abc import Sequence
from math import gcd

import numpy as np

from filters.model import Array, Command, Limits, View
from testbed.components.following.course import climb
from testbed.components.following.pursuit import pursue
from testbed.scenario.guidance import Layers as Table

# Beyond Ds, between layers; and of the climb rate limit, what the descent takes.
SPARE_M, CLIMB_SHARE = 3.0, 0.7
# What counts as nearer to the goal, and the share of an evading circle after which a layer is changed.
NEARER_M, PATIENCE = 1.0, 0.5
_TRIES, _GOLDEN = 100, 0.5 * (np.sqrt(5.0) - 1.0)


class Layers:
    """Flies straight to the goal; the height is the layer's but for the last of the way.

    goal    (N, 3) m; goal_radius m
    layer   (N,) m, heights
    speed   (N,) m/s; descent (N,) m/s, the climb rate of the descent
    gain    1/s, on the course; height_gain 1/s, on the height

    The height wanted at the level distance d from the goal differs from the goal's by as much as the descent
    takes from d to the goal radius, and at most by the layer's. A vehicle that has reached its goal goes back
    to its layer.
    """

    def __init__(
        self,
        goal: Array,
        goal_radius: float,
        layer: Array,
        speed: float,
        descent: Array,
        gain: float,
        height_gain: float,
        limits: Limits,
        gamma: Command | None = None,
        off: float = 0.0,
        others: Sequence[Array] = (),
        park: Array | None = None,
    ) -> None:
        self._park = layer if park is None else park
        self._gamma, self._off, self._others = gamma, off, others
        layer = layer.copy()
        self._nearest, self._since = np.full(len(goal), np.inf), np.zeros(len(goal))
        self._changes = np.zeros(len(goal), dtype=int)
        self._goal, self._radius, self._layer = goal, goal_radius, layer
        self._speed, self._descent = np.full(len(goal), speed), descent
        self._gains, self._limits = (gain, height_gain), limits
        self._arrived = np.zeros(len(goal), dtype=bool)

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        s, goal, v = view.state, self._goal, self._speed
        self._arrived = self._arrived | (np.linalg.norm(s.position - goal, axis=-1) <= self._radius)
        east, north = goal[:, 0] - s.x, goal[:, 1] - s.y
        level = np.hypot(east, north)
        if self._gamma is not None:
            self._change(t, level)
        end = goal[:, 2] + np.clip(self._layer - goal[:, 2], -self._off, self._off)
        most = self._layer - end
        left = np.maximum(level - self._radius, 0.0) * self._descent / v
        sloping = (left < np.abs(most)) & ~self._arrived
        height = np.where(sloping, end + np.sign(most) * left, self._layer)
        closing = v * (np.cos(s.theta) * east + np.sin(s.theta) * north) / np.maximum(level, 1e-9)
        falls = sloping & (left > 0.0)
        rate = np.where(falls, -np.sign(most) * closing * self._descent / v, 0.0)
        gamma = self._gamma
        sense = 0.0 if gamma is None else float(np.sign(gamma.omega[0]))
        omega = pursue(s, goal[:, :2], v, self._gains[0], self._limits, sense)
        zeta = climb(s.z, height, rate, self._gains[1], self._limits)
        if gamma is not None:
            v, omega = np.where(self._arrived, gamma.v, v), np.where(self._arrived, gamma.omega, omega)
            up = climb(s.z, self._park, 0.0, self._gains[1], self._limits)
            zeta = np.where(self._arrived, np.clip(up, -self._descent, self._descent), zeta)
        return Command(v, omega, zeta)

    def _change(self, t: float, level: Array) -> None:
        """Give vehicles another layer that have come no nearer to their goals for half an evading circle."""
        assert self._gamma is not None
        nearer = level < self._nearest - NEARER_M
        self._nearest = np.where(nearer, level, self._nearest)
        self._since = np.where(nearer, t, self._since)
        patience = PATIENCE * 2 * np.pi / np.abs(self._gamma.omega)
        for k in map(int, np.flatnonzero((t - self._since > patience) & ~self._arrived)):
            self._nearest[k], self._since[k] = level[k], t
            if len(self._others) and len(self._others[k]):
                self._layer[k] = float(self._others[k][int(self._changes[k]) % len(self._others[k])])
                self._changes[k] += 1


def descent_rate(table: Table, limits: Limits) -> Array:
    """(N,) m/s, the climb rate of the descent to the goal."""
    if table.climb_mps is not None:
        return np.full(len(limits), table.climb_mps)
    return np.asarray(CLIMB_SHARE * limits.zeta_max)


def dealt(tables: Sequence[Table], limits: Limits, way: Array, goal_radius: float, d_safe: float) -> Array:
    """The layers (N,) m of the vehicles that fly in layers, in their order.

    limits (N,); way (N,) m, the level distance from the start to the goal

    Without a number said there are as many layers as every vehicle can climb to in the first half of its way,
    and descend from in the second. Vehicles that follow one another in number get layers that do not.
    """
    count, made = len(tables), np.empty(len(tables))
    for k, table in enumerate(tables):
        spacing = d_safe + SPARE_M if table.spacing_m is None else table.spacing_m
        layers = table.layers
        if layers is None:
            reach = (way / 2.0 - goal_radius) / table.speed_mps * descent_rate(table, limits)
            least = max(float(reach.min()), 0.0) + table.goal_offset_m
            layers = min(count, max(1, 1 + int(2.0 * least / spacing)))
        own = table.middle_m + spacing * (k * _stride(layers) % layers - (layers - 1) / 2.0)
        made[k] = own if table.height_m is None else table.height_m
    return made


def other_layers(layer: Array) -> list[Array]:
    """The layers that each vehicle may change to, of those of all (N,), in an order of its own.

    Each goes up by jumps of its own, cyclically: two that bar one another's way in one layer part.
    """
    heights = np.unique(np.round(layer[np.isfinite(layer)], 6))
    count, made, tries = len(heights), [], np.arange(1, _TRIES + 1)
    for k, own in enumerate(layer):
        if count < 2 or not np.isfinite(own):
            made.append(heights[:0])
            continue
        jumps = 1 + np.floor(np.mod((k + 1) * tries * _GOLDEN, 1.0) * (count - 1)).astype(int)
        made.append(heights[(int(np.argmin(np.abs(heights - own))) + np.cumsum(jumps)) % count])
    return made


def parking(layer: Array, spacing: float) -> Array:
    """(N,) m, a height for each vehicle beyond all layers (N,): above them for those of the upper half."""
    made, order = layer.copy(), np.argsort(layer, kind="stable")
    half = len(layer) // 2
    made[order[:half][::-1]] = layer.min() - spacing * np.arange(1, half + 1)
    made[order[half:]] = layer.max() + spacing * np.arange(1, len(layer) - half + 1)
    return made


def _stride(layers: int) -> int:
    """The first number from 0.38 of the layers on that has no divisor in common with them."""
    first = max(1, round(0.38 * layers))
    return next(k for k in range(first, layers + 2) if gcd(k, layers) == 1)
