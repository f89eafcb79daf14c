"""One filter step's quadratic programs: over all vehicles at once, or one per vehicle on rows of its own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import Barrier
from filters.cbf.constraints import OwnRows, Rows, least, taken
from filters.model import Array
from filters.qp import single
from filters.qp.batch import solve_each
from filters.qp.single import Status

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Problem:
    """Targets u_hat and limits, all (N, 3), and the barrier whose gamma to fly if a QP has no solution."""

    target: Array
    lower: Array
    upper: Array
    barrier: Barrier | None = None
    solver: single.Solver = "auto"

    @cached_property
    def clipped(self) -> Array:
        """The targets inside the limits (N, 3)."""
        # numpy's own clip spends more time on checking its arguments than on so few numbers.
        return np.minimum(np.maximum(self.target, self.lower), self.upper)

    @cached_property
    def evading(self) -> Array | None:
        """gamma inside the limits (N, 3), if the barrier has one."""
        gamma = None if self.barrier is None else manoeuvre(self.barrier, len(self.target))
        return None if gamma is None else np.minimum(np.maximum(gamma, self.lower), self.upper)

    def centralised(self, rows: Rows) -> tuple[Array, NDArray[np.int_], Array]:
        """Inputs (N, 3), status (N,) and residual (N,) of the QP over all vehicles.

        Cost and box couple no vehicles, so each group of vehicles joined by rows is a QP of its own: exact.
        """
        i, j = rows.i, rows.j
        u = self.clipped
        status = np.full(len(u), int(Status.SOLVED))
        short = rows.rhs - rows.left(u)
        broken = short > 0
        if not broken.any():
            return u, status, np.zeros(len(u))
        # Rows that no input in the box can violate go. That is exact, and they are the worst scaled ones (a
        # cubic alpha far from the boundary).
        worst = least(rows.lie_i, taken(self.lower, i), taken(self.upper, i))
        worst += least(rows.lie_j, taken(self.lower, j), taken(self.upper, j))
        kept = ~(worst >= rows.rhs)
        broken &= kept
        if broken.any():
            u = u.copy()
            group = _groups(len(u), i[kept], j[kept])
            for g in np.unique(group[i[broken]]):
                inside = np.flatnonzero(group == g)
                use = np.flatnonzero(kept & (group[i] == g))
                solution = self._joint(rows, inside, use)
                u[inside], status[inside] = solution.u.reshape(-1, 3), int(solution.status)
                if solution.status != Status.SOLVED:
                    self._evade(u, inside)
            short = rows.rhs - rows.left(u)
        return u, status, _worst_of(len(u), (i, short), (j, short))

    def _joint(self, rows: Rows, vehicles: Indices, use: Indices) -> single.Solution:
        place = np.zeros(len(self.target), dtype=int)
        place[vehicles] = np.arange(vehicles.size)
        matrix = np.zeros((use.size, vehicles.size, 3))
        index = np.arange(use.size)
        matrix[index, place[rows.i[use]]] = rows.lie_i[use]
        matrix[index, place[rows.j[use]]] = rows.lie_j[use]
        return single.solve(
            self.target[vehicles].ravel(),
            matrix.reshape(use.size, -1),
            rows.rhs[use],
            self.lower[vehicles].ravel(),
            self.upper[vehicles].ravel(),
            self.solver,
        )

    def limited(self, rows: OwnRows) -> tuple[Array, NDArray[np.int_], Array]:
        """Inputs (N, 3), status (N,) and residual (N,) of one QP per vehicle over its own rows."""
        vehicle, u = rows.vehicle, self.clipped
        broken = rows.rhs - rows.left(u) > 0
        if not broken.any():
            return u, np.full(len(u), int(Status.SOLVED)), np.zeros(len(u))
        kept = ~(least(rows.lie, taken(self.lower, vehicle), taken(self.upper, vehicle)) >= rows.rhs)
        solving = np.zeros(len(u), dtype=bool)
        solving[vehicle[kept & broken]] = True
        use = np.flatnonzero(kept & solving[vehicle])
        box = self.lower, self.upper
        u, status = solve_each(
            self.target, vehicle[use], rows.lie[use], rows.rhs[use], *box, self.solver, self.evading
        )
        self._evade(u, np.flatnonzero(status != int(Status.SOLVED)))
        return u, status, _worst_of(len(u), (vehicle, rows.rhs - rows.left(u)))

    def _evade(self, u: Array, vehicles: Indices) -> None:
        """Have `vehicles` of u (N, 3) fly gamma, if there is one: their QP has no solution."""
        if vehicles.size and self.evading is not None:
            u[vehicles] = self.evading[vehicles]


def manoeuvre(barrier: Barrier, n: int) -> Array | None:
    """gamma (N, 3), read-only, or None for a barrier without one."""
    try:
        gamma = barrier.manoeuvre(n).array()
    except ValueError:
        return None
    gamma.flags.writeable = False
    return gamma


def _worst_of(n: int, *shortfalls: tuple[NDArray[np.intp], Array]) -> Array:
    """The largest positive shortfall (N,) of the rows each vehicle appears in."""
    worst = np.zeros(n)
    for vehicle, short in shortfalls:
        positive = short > 0
        if positive.any():
            np.maximum.at(worst, vehicle[positive], short[positive])
    return worst


def _groups(n: int, i: Indices, j: Indices) -> NDArray[np.int_]:
    """A label (N,) per vehicle, equal where rows between i and j (R,) join vehicles."""
    # Two parents and a loop: scipy's connected components take as long as 500 rows do here.
    parent = list(range(n))

    def root(v: int) -> int:
        while parent[v] != v:
            parent[v] = v = parent[parent[v]]
        return v

    for a, b in zip(i.tolist(), j.tolist(), strict=True):
        a, b = root(a), root(b)
        parent[max(a, b)] = min(a, b)
    return np.array([root(v) for v in range(n)])
