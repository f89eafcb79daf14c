"""Guidance in layers of height: climbs to the layer, holds it, descends to the goal."""

from __future__ import annotations

from collections.abc import Sequence
from math import gcd

import numpy as np

from filters.model import Array, Command, Limits, View
from testbed.components.following.course import climb
from testbed.components.following.evading import Evading, Waiting
from testbed.components.following.pursuit import pursue
from testbed.scenario.guidance import Layers as Table

# Beyond Ds, between layers; and of the climb rate limit, what the descent takes.
SPARE_M, CLIMB_SHARE = 3.0, 0.7


class Layers:
    """Flies straight to the goal; the height is the layer's but for the last of the way.

    goal    (N, 3) m; goal_radius m
    layer   (N,) m, heights
    speed   (N,) m/s; descent (N,) m/s, the climb rate of the descent
    gain    1/s, on the course; height_gain 1/s, on the height

    The height wanted at the level distance d from the goal differs from the goal's by as much as the descent
    takes from d to the goal radius, and at most by the layer's. A vehicle that has reached its goal goes back
    to its layer.

    off      m, the goal is passed as much above or below where the layer is so near
    evading  known of the evading turn: turns of more than 90 deg have its sense, it is flown at a parking
             height after the goal, and who waits changes its layer. None: not known
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
        off: float = 0.0,
        evading: Evading | None = None,
    ) -> None:
        self._off, self._evading = off, evading
        self._waiting = None if evading is None else Waiting(evading, layer)
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
        if self._waiting is not None:
            self._waiting.see(t, level, self._arrived)
            self._layer = self._waiting.layer
        end = goal[:, 2] + np.clip(self._layer - goal[:, 2], -self._off, self._off)
        most = self._layer - end
        left = np.maximum(level - self._radius, 0.0) * self._descent / v
        sloping = (left < np.abs(most)) & ~self._arrived
        height = np.where(sloping, end + np.sign(most) * left, self._layer)
        closing = v * (np.cos(s.theta) * east + np.sin(s.theta) * north) / np.maximum(level, 1e-9)
        falls = sloping & (left > 0.0)
        rate = np.where(falls, -np.sign(most) * closing * self._descent / v, 0.0)
        known = self._evading
        omega = pursue(s, goal[:, :2], v, self._gains[0], self._limits, 0.0 if known is None else known.sense)
        zeta = climb(s.z, height, rate, self._gains[1], self._limits)
        if known is None or not self._arrived.any():
            return Command(v, omega, zeta)
        away = climb(s.z, known.parking, 0.0, self._gains[1], self._limits)
        away = np.minimum(np.maximum(away, -self._descent), self._descent)
        parked = np.stack([known.gamma.v, known.gamma.omega, away], axis=-1)
        return Command.of(np.where(self._arrived[:, None], parked, np.stack([v, omega, zeta], axis=-1)))


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


def _stride(layers: int) -> int:
    """The first number from 0.38 of the layers on that has no divisor in common with them."""
    first = max(1, round(0.38 * layers))
    return next(k for k in range(first, layers + 2) if gcd(k, layers) == 1)
