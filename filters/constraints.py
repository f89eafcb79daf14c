"""Defines constraints on the inputs of vehicles: linear rows, each over one to k vehicles.

A row comes from a function h of the state that shall stay >= 0. Its rate under the vehicles' inputs is
hdot = L_f h + the sum over its vehicles of L_g h u, and the row asks for hdot + alpha(h) >= 0 with alpha of
class K (Squires et al. 2022, eq. (4)). A pair's barrier has two vehicles, a fence one; to a QP they are the
same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from numpy import vdot
from numpy.typing import NDArray

from filters.model import Array, View

Indices = NDArray[np.intp]
Alpha = Callable[[Array], Array]
"""An extended class-K function: h (R,) -> alpha(h) (R,), in h's unit per second."""
Margin = Callable[[Array], Array]
"""L_g h of one vehicle (R, 3) over (v, omega, zeta) -> what its rows are raised by (R,), finite and >= 0."""


@dataclass(frozen=True, eq=False)
class Constraints:
    """R rows over k vehicles each: the sum over s < k of lie[s] u[vehicles[s]] is at least rhs.

    vehicles  k arrays (R,), from 0; the vehicles of one row differ
    lie       k arrays (R, 3): L_g h over the (v, omega, zeta) of that vehicle
    h         (R,) what the rows keep from falling below 0
    rhs       (R,) -alpha(h) - L_f h, in h's unit per second
    drift     (R,) L_f h: how fast h changes without any input; 0 for the unicycle and an h of its state
    """

    vehicles: tuple[Indices, ...]
    lie: tuple[Array, ...]
    h: Array
    rhs: Array
    drift: Array | float = 0.0

    @classmethod
    def of(
        cls,
        vehicles: tuple[Indices, ...],
        lie: tuple[Array, ...],
        h: Array,
        alpha_h: Array,
        drift: Array | float = 0.0,
    ) -> Constraints:
        """The rows for hdot + alpha(h) >= 0, with alpha_h (R,) = alpha(h) and drift = L_f h.

        Raises  FloatingPointError naming the vehicles of the first row with a number that is not finite. A
                NaN compares false with everything, so it would remove the constraint without notice.
        """
        rhs = -alpha_h if isinstance(drift, float) and drift == 0.0 else -alpha_h - drift
        rows = cls(vehicles, lie, h, rhs, drift)
        rows.check_finite()
        return rows

    def check_finite(self) -> None:
        """Raises FloatingPointError naming the first row with a number that is not finite."""
        # A sum of squares is finite only if all its terms are; no finite h comes near overflowing it.
        total = vdot(self.h, self.h) + vdot(self.rhs, self.rhs)
        for lie in self.lie:
            across = lie.T  # as it lies in memory
            total += vdot(across, across)
        if isfinite(total):
            return
        fine = np.isfinite(self.h) & np.isfinite(self.rhs)
        for lie in self.lie:
            fine &= np.isfinite(lie).all(-1)
        r = int(np.flatnonzero(~fine)[0]) if not fine.all() else int(np.argmax(np.abs(self.rhs)))
        who = " and ".join(str(int(v[r]) + 1) for v in self.vehicles)
        sides = " and ".join(str(a[r]) for a in self.lie)
        raise FloatingPointError(
            f"the barrier of vehicle{'s' if len(self.vehicles) > 1 else ''} {who} (row {r + 1} of"
            f" {self.h.size}) is not finite: h {self.h[r]}, L_g h {sides}, -alpha(h) - L_f h {self.rhs[r]}"
        )

    def left(self, u: Array) -> Array:
        """L_g h u (R,) of inputs u (N, 3)."""
        total = self.lie[0] * taken(u, self.vehicles[0])
        for s in range(1, len(self.lie)):
            total += self.lie[s] * taken(u, self.vehicles[s])
        x, y, z = total.T
        return x + y + z  # type: ignore[no-any-return]

    def parts(self, u: Array) -> tuple[Array, ...]:
        """What each of the k vehicles adds to `left`, (R,) each."""
        sides = zip(self.lie, self.vehicles, strict=True)
        return tuple([dot(lie, taken(u, vehicle)) for lie, vehicle in sides])

    def least(self, lower: Array, upper: Array) -> Array:
        """The smallest `left` (R,) of inputs between lower and upper, both (N, 3)."""
        total: Array | None = None
        for lie, vehicle in zip(self.lie, self.vehicles, strict=True):
            part = dot(lie, np.where(lie > 0, taken(lower, vehicle), taken(upper, vehicle)))
            total = part if total is None else total + part
        assert total is not None
        return total

    def raised(self, margin: Margin | None) -> Constraints:
        """The rows with the margin of each of their vehicles added to the right-hand side.

        Raises ValueError if a margin is negative, not finite or not one number a row.
        """
        if margin is None:
            return self
        rhs = self.rhs
        for lie in self.lie:
            rhs = rhs + amount(margin, lie)
        return replace(self, rhs=rhs)

    def known(self, view: View) -> Constraints:
        """The rows without those over two vehicles that do not know of each other, or over one unknown."""
        if view.known is None:
            return self
        fine = np.ones(self.h.size, dtype=bool)
        for s, a in enumerate(self.vehicles):
            for b in self.vehicles[s + 1 :] or (a,) * (len(self.vehicles) == 1):
                fine &= view.joined(a, b)
        return self if fine.all() else self.chosen(fine)

    def chosen(self, which: NDArray[np.bool_]) -> Constraints:
        """The rows where `which` (R,)."""
        return Constraints(
            tuple(v[which] for v in self.vehicles),
            tuple(lie[which] for lie in self.lie),
            self.h[which],
            self.rhs[which],
            self.drift[which] if isinstance(self.drift, np.ndarray) else self.drift,
        )


Maker = Callable[[View], tuple[Constraints, ...]]
"""The constraints that a view asks for, one block per number of vehicles in a row."""


def amount(margin: Margin, lie: Array) -> Array:
    """The margin (R,) of one vehicle's part of rows, lie (R, 3).

    Raises  ValueError if it is negative, not finite or not one number a row.
    """
    found = np.asarray(margin(lie), dtype=float)
    if found.shape != lie.shape[:1] or not np.all(np.isfinite(found) & (found >= 0)):
        raise ValueError(f"a margin must be finite and not negative, one per row, got {found}")
    return found


def taken(values: Array, index: Indices) -> Array:
    """values[index] (R, 3) of values (N, 3), laid out column by column as `PairValues.lie` is."""
    return values.T.take(index, axis=1).T


def dot(a: Array, b: Array) -> Array:
    """Row-wise inner products (R,) of (R, 3) and (R, 3)."""
    # Column by column: numpy's reductions over a last axis of 3 cost several times as much.
    x, y, z = (a * b).T
    return x + y + z  # type: ignore[no-any-return]
