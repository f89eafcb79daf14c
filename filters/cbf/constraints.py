"""The rows of the filter's QPs: what a barrier, an alpha and a state ask of the inputs.

One row per pair, L_g h_i u_i + L_g h_j u_j >= -alpha(h), because L_f h = 0 for the vehicles here
(Squires et al. 2022, "Composition of multiple safety constraints").
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from numpy import vdot
from numpy.typing import NDArray

from filters.barriers.pairs import Barrier, Index, PairValues, chosen_pairs, vehicle_of
from filters.constraints import Alpha, Constraints, Margin, dot, taken
from filters.model import Array, Command, State, View


@dataclass(frozen=True, eq=False)
class Rows:
    """The barrier rows of P pairs: lie_i u_i + lie_j u_j >= rhs, in m/s (m^2/s for a squared h).

    i, j          (P,)    the pair's vehicles, from 0
    lie_i, lie_j  (P, 3)  L_g h over (v, omega, zeta)
    rhs           (P,)    -alpha(h)
    pairs         the barrier's values they come from
    """

    i: NDArray[np.intp]
    j: NDArray[np.intp]
    lie_i: Array
    lie_j: Array
    rhs: Array
    pairs: PairValues

    def constraints(self) -> Constraints:
        """The same rows as `Constraints` over two vehicles."""
        return Constraints((self.i, self.j), (self.lie_i, self.lie_j), self.pairs.h, self.rhs)

    def left(self, u: Array) -> Array:
        """L_g h u (P,) of inputs u (N, 3)."""
        x, y, z = (self.lie_i * taken(u, self.i) + self.lie_j * taken(u, self.j)).T
        return x + y + z  # type: ignore[no-any-return]

    def left_of_each(self, u: Array) -> tuple[Array, Array]:
        """The two parts of `left`, vehicle i's and vehicle j's, (P,) each."""
        return dot(self.lie_i, taken(u, self.i)), dot(self.lie_j, taken(u, self.j))

    def raised(self, margin: Margin | None) -> Rows:
        """The rows with each side's margin added to their right-hand side; see `row_margins`."""
        if margin is None:
            return self
        return replace(self, rhs=self.rhs + _amount(margin, self.lie_i) + _amount(margin, self.lie_j))


@dataclass(frozen=True, eq=False)
class OwnRows:
    """Rows that each bind one vehicle: lie u_vehicle >= rhs, (R,), (R, 3) and (R,)."""

    vehicle: NDArray[np.intp]
    lie: Array
    rhs: Array

    def left(self, u: Array) -> Array:
        """lie u_vehicle (R,) of inputs u (N, 3)."""
        return dot(self.lie, taken(u, self.vehicle))

    def raised(self, margin: Margin | None) -> OwnRows:
        """The rows with the vehicle's own margin added to their right-hand side; see `row_margins`."""
        return self if margin is None else replace(self, rhs=self.rhs + _amount(margin, self.lie))


def _amount(margin: Margin, lie: Array) -> Array:
    """The margin (R,) of one side's rows; raises ValueError if it is negative or not finite."""
    amount = np.asarray(margin(lie), dtype=float)
    if amount.shape != lie.shape[:1] or not np.all(np.isfinite(amount) & (amount >= 0)):
        raise ValueError(f"a margin must be finite and not negative, one per row, got {amount}")
    return amount


def least(lie: Array, lower: Array, upper: Array) -> Array:
    """The smallest value (R,) of lie u over the box, all (R, 3)."""
    return dot(lie, np.where(lie > 0, lower, upper))


def barrier_rows(
    barrier: Barrier, alpha: Alpha, state: State, i: Index | None = None, j: Index | None = None
) -> Rows:
    """The rows of all pairs i < j of `state` (N,), or of those given (see `Barrier.values`).

    Raises FloatingPointError naming the pair if h, its derivative or alpha(h) is not finite: a NaN compares
    false with everything and would silently remove the constraint.
    """
    pairs = barrier.values(state, i, j)
    lie_i, lie_j = pairs.lie(state)
    rhs = -np.asarray(alpha(pairs.h), dtype=float)
    rows = Rows(vehicle_of(pairs.i), vehicle_of(pairs.j), lie_i, lie_j, rhs, pairs)
    # A sum of squares is finite only if all its terms are; no finite barrier comes near overflowing it.
    across_i, across_j = lie_i.T, lie_j.T  # as they lie in memory
    total = vdot(pairs.h, pairs.h) + vdot(rhs, rhs) + vdot(across_i, across_i) + vdot(across_j, across_j)
    if not isfinite(total):
        _name_infinite(rows)
    return rows


def _name_infinite(rows: Rows) -> None:
    fine = np.isfinite(rows.pairs.h) & np.isfinite(rows.rhs)
    fine &= np.isfinite(rows.lie_i).all(-1) & np.isfinite(rows.lie_j).all(-1)
    p = int(np.flatnonzero(~fine)[0]) if not fine.all() else int(np.argmax(np.abs(rows.rhs)))
    raise FloatingPointError(
        f"the barrier of vehicles {rows.i[p] + 1} and {rows.j[p] + 1} (pair {p + 1} of {rows.i.size}) is not "
        f"finite: h {rows.pairs.h[p]}, L_g h {rows.lie_i[p]} and {rows.lie_j[p]}, alpha(h) {-rows.rhs[p]}"
    )


def shares(
    barrier: Barrier, rows: Rows, n: int, gamma: Array | None = None, margin: Margin | None = None
) -> tuple[Array, Array]:
    """The right-hand sides (P,) of the limited-communication rows of i and of j; they add up to the pair's.

    Each vehicle assumes that the other flies gamma and takes half of what both flying gamma leaves over
    (|V^j| = 2, L_f h = 0): rhs_i = -alpha(h)/2 - (L_g h_j gamma_j - L_g h_i gamma_i)/2.
    gamma   the barrier's manoeuvre (N, 3), if the caller has it at hand
    margin  added to each side, beyond what adds up; see `row_margins`
    Raises  ValueError if the barrier has no manoeuvre.
    Source  Squires et al. 2022, the QP of "Control calculation with limited communication".
    """
    if isinstance(barrier, PerPair):
        gamma_i, gamma_j = barrier.manoeuvres(rows.i, rows.j, n)
    else:
        gamma = barrier.manoeuvre(n).array() if gamma is None else gamma
        gamma_i, gamma_j = taken(gamma, rows.i), taken(gamma, rows.j)
    difference = 0.5 * (dot(rows.lie_i, gamma_i) - dot(rows.lie_j, gamma_j))
    rhs_i, rhs_j = 0.5 * rows.rhs + difference, 0.5 * rows.rhs - difference
    if margin is None:
        return rhs_i, rhs_j
    return rhs_i + _amount(margin, rows.lie_i), rhs_j + _amount(margin, rows.lie_j)


def limited_rows(rows: Rows, rhs_i: Array, rhs_j: Array) -> OwnRows:
    """Each pair's two limited-communication rows (2P,), i's and then j's, from its `shares`."""
    return OwnRows(
        np.concatenate([rows.i, rows.j]),
        np.concatenate([rows.lie_i, rows.lie_j]),
        np.concatenate([rhs_i, rhs_j]),
    )


def observed_rows(barrier: Barrier, alpha: Alpha, view: View, gamma: Array | None = None) -> OwnRows:
    """Every vehicle's own limited-communication rows (N (N-1),), each computed from that vehicle's view."""
    n = len(view.state)
    observer, other = np.nonzero(~np.eye(n, dtype=bool))
    i, j = np.minimum(observer, other), np.maximum(observer, other)
    rows = barrier_rows(barrier, alpha, view.state, (observer, i), (observer, j))
    rhs_i, rhs_j = shares(barrier, rows, n, gamma)
    first = observer < other
    return OwnRows(observer, np.where(first[:, None], rows.lie_i, rows.lie_j), np.where(first, rhs_i, rhs_j))


@dataclass(frozen=True)
class PerPair:
    """A barrier of its own for every pair, in the order (1,2), (1,3), ..., (2,3), ...

    Breaks the shared-manoeuvre assumption (Squires et al. 2022, Assumption 1) unless all manoeuvres agree, so
    rows may contradict each other inside the safe set: for showing just that.
    """

    barriers: tuple[Barrier, ...]

    @property
    def d_safe(self) -> float:
        return max(b.d_safe for b in self.barriers)

    def manoeuvre(self, n: int) -> Command:
        raise ValueError("barriers per pair have no common evading manoeuvre")

    def values(self, state: State, i: Index | None = None, j: Index | None = None) -> PairValues:
        """As `Barrier.values`, each pair by its own barrier."""
        i, j = chosen_pairs(state, i, j)
        h, grad = np.empty(vehicle_of(i).size), np.empty((vehicle_of(i).size, 8))
        for p, barrier in enumerate(self._of(i, j, len(state))):
            one = barrier.values(state, _only(i, p), _only(j, p))
            h[p], grad[p] = one.h[0], one.grad[0]
        return PairValues(i, j, h, grad)

    def manoeuvres(self, i: Index, j: Index, n: int) -> tuple[Array, Array]:
        """gamma of each pair's own barrier for its two vehicles, (P, 3) each."""
        gamma = np.array([b.manoeuvre(n).array() for b in self._of(i, j, n)]).reshape(-1, n, 3)
        p = np.arange(len(gamma))
        return gamma[p, vehicle_of(i)], gamma[p, vehicle_of(j)]

    def _of(self, i: Index, j: Index, n: int) -> list[Barrier]:
        if n * (n - 1) // 2 != len(self.barriers):
            raise ValueError(
                f"{n} vehicles have {n * (n - 1) // 2} pairs, but {len(self.barriers)} barriers came"
            )
        a, b = np.minimum(vehicle_of(i), vehicle_of(j)), np.maximum(vehicle_of(i), vehicle_of(j))
        return [self.barriers[p] for p in a * (2 * n - a - 1) // 2 + b - a - 1]


def _only(index: Index, p: int) -> Index:
    return tuple(_only(a, p) for a in index) if isinstance(index, tuple) else index[p : p + 1]
