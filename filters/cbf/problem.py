"""Solves one filter step's quadratic programs: one over all vehicles, or one per vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import PairValues
from filters.constraints import Constraints, Indices
from filters.filter import Decision
from filters.model import Array, Command, Limits, View
from filters.qp import single
from filters.qp.batch import solve_each
from filters.qp.single import Status

# Smallest change of a command that counts as the filter's doing [m/s, rad/s, m/s]; QPs are solved to 1e-9.
OVERRIDE = 1e-6


Cost = Literal["raw", "range"]


@dataclass(frozen=True, eq=False)
class Problem:
    """The targets and limits of one step, and what to fly where a QP has no solution.

    target, lower, upper  (N, 3) u_hat and the limits
    gamma                 (N, 3) flown, inside the limits, by a vehicle whose QP has no solution; None is the
                          input with the largest common row margin
    solver                see `qp.Solver`
    cost                  "raw": the sum of |u - u_hat|^2 in m/s and rad/s, the paper's; "range": each channel
                          divided by half its range first, so that all channels cost alike
    """

    target: Array
    lower: Array
    upper: Array
    gamma: Array | None = None
    solver: single.Solver = "auto"
    cost: Cost = "raw"

    @cached_property
    def scale(self) -> Array | None:
        """What each input is divided by in the cost, (N, 3); None for the raw cost."""
        if self.cost == "raw":
            return None
        half = 0.5 * (self.upper - self.lower)
        return np.where(half > 0.0, half, 1.0)

    def cost_of(self, u: Array) -> float:
        """The cost of inputs u (N, 3)."""
        change = u - self.target
        return float(np.sum((change if self.scale is None else change / self.scale) ** 2))

    @cached_property
    def clipped(self) -> Array:
        """The targets inside the limits (N, 3)."""
        # numpy's own clip spends more time on checking its arguments than on so few numbers.
        return np.minimum(np.maximum(self.target, self.lower), self.upper)

    @cached_property
    def evading(self) -> Array | None:
        """gamma inside the limits (N, 3), if there is one."""
        return None if self.gamma is None else np.minimum(np.maximum(self.gamma, self.lower), self.upper)

    def centralised(self, blocks: Sequence[Constraints]) -> tuple[Array, NDArray[np.int_], Array]:
        """Inputs (N, 3), status (N,) and residual (N,) of the QP over all vehicles and all rows.

        Cost and box couple no vehicles, so each group of vehicles joined by rows is a QP of its own: exact.
        """
        u = self.clipped
        status = np.full(len(u), int(Status.SOLVED))
        short = [block.rhs - block.left(u) for block in blocks]
        broken = [s > 0 for s in short]
        if not any(b.any() for b in broken):
            return u, status, np.zeros(len(u))
        # Rows that no input in the box can violate are dropped. This is exact, and it removes the
        # worst-scaled rows (of a cubic alpha far from the boundary).
        kept = [~(block.least(self.lower, self.upper) >= block.rhs) for block in blocks]
        broken = [b & k for b, k in zip(broken, kept, strict=True)]
        if any(b.any() for b in broken):
            u = u.copy()
            label = groups(len(u), blocks, kept)
            # A row's vehicles are all of one group: its first tells which.
            group = [label[block.vehicles[0]] for block in blocks]
            for g in np.unique(np.concatenate([own[b] for own, b in zip(group, broken, strict=True)])):
                inside = np.flatnonzero(label == g)
                use = [np.flatnonzero(k & (own == g)) for own, k in zip(group, kept, strict=True)]
                solution = self._joint(blocks, inside, use)
                u[inside], status[inside] = solution.u.reshape(-1, 3), int(solution.status)
                if solution.status != Status.SOLVED:
                    self._evade(u, inside)
            short = [block.rhs - block.left(u) for block in blocks]
        return u, status, _worst_of(len(u), blocks, short)

    def _joint(
        self, blocks: Sequence[Constraints], vehicles: Indices, use: Sequence[Indices]
    ) -> single.Solution:
        place = np.zeros(len(self.target), dtype=int)
        place[vehicles] = np.arange(vehicles.size)
        matrix = np.zeros((sum(rows.size for rows in use), vehicles.size, 3))
        start = 0
        for block, rows in zip(blocks, use, strict=True):
            index = np.arange(start, start + rows.size)
            for vehicle, lie in zip(block.vehicles, block.lie, strict=True):
                matrix[index, place[vehicle[rows]]] = lie[rows]
            start += rows.size
        rhs = np.concatenate([block.rhs[rows] for block, rows in zip(blocks, use, strict=True)])
        target, lower, upper = self.target[vehicles], self.lower[vehicles], self.upper[vehicles]
        if self.scale is None:
            rows_of_all = matrix.reshape(start, -1)
            return single.solve(target.ravel(), rows_of_all, rhs, lower.ravel(), upper.ravel(), self.solver)
        # The same QP in inputs divided by their scale, where its cost is the plain distance.
        w = self.scale[vehicles]
        near, low, high = ((x / w).ravel() for x in (target, lower, upper))
        found = single.solve(near, (matrix * w).reshape(start, -1), rhs, low, high, self.solver)
        u = np.minimum(np.maximum(found.u.reshape(w.shape) * w, lower), upper)
        return replace(found, u=u.ravel())

    def limited(self, rows: Constraints) -> tuple[Array, NDArray[np.int_], Array]:
        """Inputs (N, 3), status (N,) and residual (N,) of one QP per vehicle over its own rows.

        rows  over one vehicle each, see `constraints.own_rows`
        """
        (vehicle,), (lie,), u = rows.vehicles, rows.lie, self.clipped
        broken = rows.rhs - rows.left(u) > 0
        if not broken.any():
            return u, np.full(len(u), int(Status.SOLVED)), np.zeros(len(u))
        kept = ~(rows.least(self.lower, self.upper) >= rows.rhs)
        solving = np.zeros(len(u), dtype=bool)
        solving[vehicle[kept & broken]] = True
        use = np.flatnonzero(kept & solving[vehicle])
        u, status = self._each(vehicle[use], lie[use], rows.rhs[use])
        self._evade(u, np.flatnonzero(status != int(Status.SOLVED)))
        return u, status, _worst_of(len(u), [rows], [rows.rhs - rows.left(u)])

    def _each(self, vehicle: Indices, lie: Array, rhs: Array) -> tuple[Array, NDArray[np.int_]]:
        """Inputs (N, 3) and status (N,) of one QP per vehicle over rows lie (R, 3) u >= rhs (R,)."""
        box = self.lower, self.upper
        if self.scale is None:
            return solve_each(self.target, vehicle, lie, rhs, *box, self.solver, self.evading)
        w = self.scale
        target, lower, upper = (x / w for x in (self.target, *box))
        evading = None if self.evading is None else self.evading / w
        u, status = solve_each(target, vehicle, lie * w[vehicle], rhs, lower, upper, self.solver, evading)
        asked = np.bincount(vehicle, minlength=len(w))[:, None] > 0
        # Without rows the clipped target is the answer, to the last bit.
        return np.where(asked, np.minimum(np.maximum(u * w, self.lower), self.upper), self.clipped), status

    def _evade(self, u: Array, vehicles: Indices) -> None:
        """Have `vehicles` of u (N, 3) fly gamma, if there is one: their QP has no solution."""
        if vehicles.size and self.evading is not None:
            u[vehicles] = self.evading[vehicles]

    def decision(
        self,
        u: Array,
        status: NDArray[np.int_],
        residual: Array,
        pairs: PairValues | None,
        hdot: Array,
    ) -> Decision:
        """The decision to fly `u` (N, 3), with what that changed; hdot (P,) is L_g h u of `pairs`."""
        beyond = np.abs(u - self.clipped).max(-1) if u is not self.clipped else np.zeros(len(u))
        return Decision(Command.of(u), status, residual, beyond > OVERRIDE, beyond, pairs, hdot)


def input_set(view: View, nominal: Command, limits: Limits) -> tuple[Array, Array, Array]:
    """u_hat, lower and upper, all (N, 3).

    Raises ValueError naming the vehicle whose nominal command is not finite, or if counts disagree.
    """
    n = len(view.state)
    target = nominal.array()
    if target.shape != (n, 3):
        raise ValueError(f"{n} vehicles need nominal commands of shape ({n},), got {nominal.shape}")
    if not isfinite(np.vdot(target, target)) and not np.isfinite(target).all():
        bad = int(np.flatnonzero(~np.isfinite(target).all(-1))[0])
        raise ValueError(f"the nominal command of vehicle {bad + 1} is not finite: {target[bad]}")
    lower, upper = limits.corners
    if lower.shape != target.shape:
        lower, upper = np.broadcast_to(lower, target.shape), np.broadcast_to(upper, target.shape)
    return target, lower, upper


def _worst_of(n: int, blocks: Sequence[Constraints], shortfalls: Sequence[Array]) -> Array:
    """The largest positive shortfall (N,) of the rows each vehicle appears in."""
    worst = np.zeros(n)
    for block, short in zip(blocks, shortfalls, strict=True):
        positive = short > 0
        if positive.any():
            for vehicle in block.vehicles:
                np.maximum.at(worst, vehicle[positive], short[positive])
    return worst


def groups(n: int, blocks: Sequence[Constraints], kept: Sequence[NDArray[np.bool_]]) -> NDArray[np.int_]:
    """A label (N,) per vehicle, equal where kept rows join vehicles."""
    # Two parents and a loop: scipy's connected components take as long as 500 rows do here.
    parent = list(range(n))

    def root(v: int) -> int:
        while parent[v] != v:
            parent[v] = v = parent[parent[v]]
        return v

    for block, keep in zip(blocks, kept, strict=True):
        first = block.vehicles[0][keep].tolist()
        for other in block.vehicles[1:]:
            for a, b in zip(first, other[keep].tolist(), strict=True):
                a, b = root(a), root(b)
                parent[max(a, b)] = min(a, b)
    return np.array([root(v) for v in range(n)])
