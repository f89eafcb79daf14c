"""Compares the vehicles' flows: distances under gamma, and each vehicle's rows to keep them.

With P_i(u) a vehicle's position at one sample of its flow, e the unit vector from j to i under gamma and
s = |P_i - P_j| - (Ds + m), vehicle i keeps e (P_i(u_i) - P_i(gamma)) >= -kappa/2 max(s, 0), and j the same
with -e. Then |P_i(u_i) - P_j(u_j)| >= e (P_i(u_i) - P_j(u_j)) >= Ds + m + s - kappa max(s, 0): neither needs
to know what the other chooses, and u = gamma satisfies every row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.constraints import Indices
from filters.flow.rollout import Complex, Paths
from filters.model import Array

# Phases of the circles beside that at which a pair is nearest, and all around [rad].
_BESIDE = np.array([0.01, 0.03, 0.06, 0.1, 0.2, 0.4, 0.8])
NEAR = np.concatenate([-_BESIDE[::-1], [0.0], _BESIDE])
AROUND = np.arange(8) * (2 * np.pi / 8)
# Inputs move a vehicle less than the sum of what its channels do alone, but for terms of second order.
_REACH = 1.1


@dataclass(frozen=True, eq=False)
class Samples:
    """Pairs (P,) under gamma: distances [m] at S samples, with unit vectors from j to i.

    i, j      (P,)
    phase     (P, F) rad, of the circle's samples, which follow the M instants of the transient
    away, up  (P, S) the unit vectors, horizontal as complex numbers, and vertical
    distance  (P, S) m
    least     (P,) m, over the instants and the whole circle
    """

    i: Indices
    j: Indices
    phase: Array
    away: Complex
    up: Array
    distance: Array
    least: Array


def samples(gamma: Paths, i: Indices, j: Indices) -> Samples:
    """The samples of pairs when all fly gamma; `gamma` without leading axes."""
    between = gamma.centre[i] - gamma.centre[j]
    swing = gamma.arm[i] - gamma.arm[j]
    nearest = np.angle(-between * np.conj(swing))
    around = np.broadcast_to(AROUND, (i.size, AROUND.size))
    phase = np.concatenate([nearest[:, None] + NEAR, around], axis=1)
    circle = between[:, None] + swing[:, None] * np.exp(1j * phase)
    level = np.concatenate([gamma.at[i] - gamma.at[j], circle], axis=1)
    transient = gamma.z[i] - gamma.z[j]
    last = transient[:, -1:]
    height = np.concatenate([transient, np.broadcast_to(last, phase.shape)], axis=1)
    distance = np.sqrt(level.real**2 + level.imag**2 + height**2)
    whole = np.hypot(np.abs(between) - np.abs(swing), last[:, 0])
    scale = 1.0 / np.maximum(distance, 1e-9)
    least = np.minimum(distance[:, : gamma.at.shape[-1]].min(axis=1), whole)
    return Samples(i, j, phase, level * scale, height * scale, distance, least)


@dataclass(frozen=True, eq=False)
class Rows:
    """R rows of single vehicles: the displacement of `vehicle` along its unit vector is at least `least`.

    vehicle    (R,)
    along, up  (R,) unit vector: horizontal as a complex number, and vertical
    least      (R,) m, at most 0
    instant    (T,) of the first T rows, which are about the transient: index of the instant
    turn       (R - T,) complex, exp(j phase) of the others, which are about the circle
    """

    vehicle: Indices
    along: Complex
    up: Array
    least: Array
    instant: Indices
    turn: Complex

    def displacement(self, moved: Paths, gamma: Paths) -> Array:
        """Displacements (..., R) m along the unit vectors, of paths (..., N, M) against gamma's (N, M)."""
        split, lead = self.instant.size, moved.at.shape[:-2]
        first, late = self.vehicle[:split], self.vehicle[split:]
        flat = first * moved.at.shape[-1] + self.instant
        level = np.empty((*lead, self.vehicle.size), dtype=complex)
        up = np.empty(level.shape)
        level[..., :split] = (moved.at - gamma.at).reshape(*lead, -1).take(flat, axis=-1)
        swung = (moved.arm - gamma.arm).take(late, axis=-1) * self.turn
        level[..., split:] = (moved.centre - gamma.centre).take(late, axis=-1) + swung
        height = moved.z - gamma.z
        up[..., :split] = height.reshape(*lead, -1).take(flat, axis=-1)
        up[..., split:] = height[..., -1].take(late, axis=-1)  # the circle is as high as the last instant
        return np.asarray(level.real * self.along.real + level.imag * self.along.imag + up * self.up)


def rows(found: Samples, level: float, kappa: float, reach: Array) -> Rows:
    """The rows that some input may break, of both vehicles of each pair.

    level  m, Ds + m
    kappa  share of the slack that one period may use up
    reach  (N, M + 1) m, how far any input can move each vehicle at the instants, and on its circle
    """
    instants = reach.shape[1] - 1
    allowed = 0.5 * kappa * np.maximum(found.distance - level, 0.0)
    parts: tuple[list[NDArray[np.generic]], ...] = ([], [], [], [], [])
    turns = []
    transient, circle = allowed[:, :instants], allowed[:, instants:]
    for late in (False, True):
        for vehicle, sign in ((found.i, 1.0), (found.j, -1.0)):
            mine = reach[vehicle]
            far = mine[:, instants:] if late else mine[:, :instants]
            p, k = np.nonzero((circle if late else transient) < far)
            if late:
                turns.append(np.exp(1j * found.phase[p, k]))
            else:
                parts[4].append(k)
            column = k + instants if late else k
            row = (vehicle[p], sign * found.away[p, column], sign * found.up[p, column], -allowed[p, column])
            for part, value in zip(parts, row, strict=False):
                part.append(value)
    vehicle, along, up, least, instant = (np.concatenate(part) for part in parts)
    return Rows(vehicle, along, up, least, instant, np.concatenate(turns))


def reach(ends: Paths, gamma: Paths, share: Array) -> Array:
    """How far (N, M + 1) m any input can move each vehicle at the instants, and on its circle.

    ends   (3, N, M) paths with one channel at the end of its range
    share  (N, 3) the furthest that the channel can be from gamma, over how far it is there
    """
    moved = np.hypot(np.abs(ends.at - gamma.at), ends.z - gamma.z)
    circle = np.abs(ends.centre - gamma.centre) + np.abs(ends.arm - gamma.arm)
    late = np.hypot(circle, (ends.z - gamma.z)[..., -1])
    each = np.concatenate([moved, late[..., None]], axis=-1)
    return np.asarray(_REACH * np.einsum("cnm,nc->nm", each, share))
