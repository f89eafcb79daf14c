"""Computes the fences' barrier: each vehicle's smallest clearance if it flies its manoeuvre for ever.

The construction is the paper's, for one vehicle: h(x) is the infimum of a safety function, the signed
distance to the fence, along the evading manoeuvre from x (Squires et al. 2022, "Constructing a Barrier
Function via Evading Maneuvers"). At constant v and omega the path is a circle or a half-line, so all of it is
closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.barriers.fences.shapes import Heights, Shape
from filters.model import Array, Command, State

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Fence:
    """A shape, and the vehicles (V,) from 0, ascending, that it is for; `name` is for messages."""

    shape: Shape
    vehicles: Indices
    name: str = "fence"


@dataclass(frozen=True, eq=False)
class _Group:
    """Vehicles of one fence that all turn or all fly straight."""

    shape: Shape
    vehicles: Indices
    turning: bool
    columns: Indices  # of these vehicles, among all (fence, vehicle)
    begin: int  # of their rows, vehicle by vehicle


class FenceRows(NamedTuple):
    """Every smooth function that the fences' h is the least of, R = the sum of V M over the fences.

    h     (..., R) m
    grad  (4, ..., R): dh/d(x, y, theta, z) of the row's vehicle
    """

    h: Array
    grad: Array

    def lie(self, theta: Array) -> Array:
        """L_g h (3, ..., R) over (v, omega, zeta), theta (..., R) being the courses of the rows' vehicles."""
        out = np.empty((3, *self.h.shape))
        np.add(self.grad[0] * np.cos(theta), self.grad[1] * np.sin(theta), out=out[0])
        out[1:] = self.grad[2:]
        return out


class Fences:
    """The barrier of fences for vehicles that each have one manoeuvre.

    fences  in the order in which they are counted
    gamma   (N,) v > 0, omega and zeta, constant
    Raises  ValueError naming fence and vehicle where the manoeuvre leaves the fence from every state:
            straight flight in an area to stay in, climb in a height band.

    With signed radius r = v/omega and centre c = p + 1j r e^(1j theta), h is a function of c, and its rate is
    that of the centre's motion: an input (v', omega') moves c at (v' - r omega') e^(1j theta), so
    L_g h = (a, -r a, 0) with a = dh/dc along the course, L_f h = 0, and gamma keeps c and h as they are. On a
    half-line the remaining path only gets shorter: gamma never lets h fall.

    h is the least of smooth functions, one an edge, corner, disc or end of a height band. A filter is given a
    row for each of them: where two are least at once h has a kink, but the set h >= 0 is theirs in common,
    and it stays invariant if every one of them satisfies its own condition.
    """

    def __init__(self, fences: Sequence[Fence], gamma: Command) -> None:
        self.fences, self.gamma = tuple(fences), gamma
        none: list[Indices] = [np.zeros(0, dtype=np.intp)]
        self.fence = np.concatenate(none + [np.full(len(f.vehicles), k) for k, f in enumerate(fences)])
        self.vehicle = np.concatenate(none + [f.vehicles for f in fences])
        self._radius = np.where(gamma.omega == 0, np.inf, gamma.v) / np.where(
            gamma.omega == 0, 1.0, gamma.omega
        )
        self._groups: list[_Group] = []
        rows, column = list(none), 0
        for k, fence in enumerate(fences):
            columns = column + np.arange(len(fence.vehicles))
            column += len(fence.vehicles)
            turns = gamma.omega[fence.vehicles] != 0
            for turning in (True, False):
                of = turns == turning
                if not of.any():
                    continue
                vehicles = fence.vehicles[of]
                self._check(k, fence, vehicles, turning)
                begin = sum(len(r) for r in rows)
                self._groups.append(_Group(fence.shape, vehicles, turning, columns[of], begin))
                rows.append(np.repeat(columns[of], fence.shape.count))
        self._columns = np.concatenate(rows)
        self.row_vehicle = self.vehicle[self._columns]

    @property
    def row_fence(self) -> Indices:
        """(R,) the fence of each row, from 0."""
        return np.asarray(self.fence[self._columns])

    def rows(self, state: State) -> FenceRows:
        """Every smooth function and its gradient at states (..., N)."""
        place = state.x + 1j * state.y
        ahead = np.exp(1j * state.theta)
        count = len(self._columns)
        h, grad = np.empty((*state.shape[:-1], count)), np.empty((4, *state.shape[:-1], count))
        for group in self._groups:
            who, shape = group.vehicles, group.shape
            into = slice(group.begin, group.begin + len(who) * shape.count)
            e, z = ahead.take(who, axis=-1), state.z.take(who, axis=-1)
            if group.turning:
                r = self._radius[who]
                pieces = shape.of_circle(place.take(who, axis=-1) + 1j * r * e, np.abs(r), z)
                along = (pieces.planar * e.conj()[..., None]).real
                turn = -r[:, None] * along
            else:
                pieces, flown = shape.of_ray(place.take(who, axis=-1), e, z)
                turn = flown * (pieces.planar * e.conj()[..., None]).imag
            rows = (*state.shape[:-1], -1)
            h[..., into] = pieces.h.reshape(rows)
            grad[0, ..., into] = pieces.planar.real.reshape(rows)
            grad[1, ..., into] = pieces.planar.imag.reshape(rows)
            grad[2, ..., into] = turn.reshape(rows)
            vertical = pieces.vertical
            grad[3, ..., into] = vertical if isinstance(vertical, float) else np.tile(vertical, len(who))
        return FenceRows(h, grad)

    def values(self, state: State) -> Array:
        """h (..., K) m of every fence and vehicle (see `fence`, `vehicle`) at states (..., N)."""
        h = self.rows(state).h
        out = np.empty((*state.shape[:-1], len(self.fence)))
        for group in self._groups:
            count = group.shape.count
            own = h[..., group.begin : group.begin + len(group.vehicles) * count]
            out[..., group.columns] = own.reshape(*own.shape[:-1], -1, count).min(axis=-1)
        return out

    def clearance(self, position: Array) -> Array:
        """Signed distances (..., K) m of positions (..., N, 3) to the vehicles' fences, less the margins."""
        place, height = position[..., 0] + 1j * position[..., 1], position[..., 2]
        out = np.empty((*position.shape[:-2], len(self.fence)))
        for group in self._groups:
            who = group.vehicles
            out[..., group.columns] = group.shape.clearance(place[..., who], height[..., who])
        return out

    def between(self, first: Array, last: Array, ends: Array) -> Array:
        """Smallest clearances (..., K) m on straight lines between positions (..., N, 3).

        ends  (2, ..., K) m, the clearances of both; where both are negative the smaller one counts
        """
        a, b = (p[..., 0] + 1j * p[..., 1] for p in (first, last))
        out = np.empty(ends.shape[1:])
        for group in self._groups:
            who, columns = group.vehicles, group.columns
            out[..., columns] = group.shape.between(a[..., who], b[..., who], ends[..., columns])
        return out

    def _check(self, k: int, fence: Fence, vehicles: Indices, turning: bool) -> None:
        climbs = vehicles[self.gamma.zeta[vehicles] != 0]
        if isinstance(fence.shape, Heights) and climbs.size:
            raise ValueError(
                f"fence {k + 1} ({fence.name}): the manoeuvre of vehicle {climbs[0] + 1} climbs at"
                f" {self.gamma.zeta[climbs[0]]:g} m/s and leaves every height band; give it no climb"
            )
        if not turning:
            try:
                somewhere = np.ones(1, dtype=complex)
                fence.shape.of_ray(somewhere, somewhere, np.zeros(1))
            except ValueError as error:
                raise ValueError(
                    f"fence {k + 1} ({fence.name}), vehicle {vehicles[0] + 1}: {error}, or give it a"
                    " manoeuvre that turns"
                ) from None
