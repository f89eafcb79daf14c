"""Checks the theorems' premises and conclusions about the QPs at every step that a filter flies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from filters.cbf.collision import CollisionFilter
from filters.cbf.constraints import own_rows
from filters.cbf.problem import Problem
from filters.constraints import Constraints
from filters.filter import Check, Decision, Declaration, MonitorRecord
from filters.model import Array, Command, Limits, View
from filters.qp.single import Status

# Slack of a row divided by its norm below which it counts as active, and shortfall [m/s] that counts as one.
ACTIVE = 1e-6
SHORTFALL = 1e-6


def theorem_checks() -> dict[str, Check]:
    return {
        "limited_is_safe": Check(
            "limited-communication inputs satisfy the centralised rows [m/s]", -SHORTFALL
        ),
        "gamma_is_safe": Check("gamma satisfies the row of every pair with h >= 0 [m/s]", -SHORTFALL),
        "gamma_is_safe_limited": Check("gamma satisfies both limited rows of such a pair [m/s]", -SHORTFALL),
        "solvable": Check("inside the safe set the centralised QP is solved (1 or 0)", 1.0),
        "solvable_limited": Check("inside the safe set every limited QP is solved (1 or 0)", 1.0),
        "aligned": Check("active rows of the centralised QP have positive inner products [cosine]", 1e-12),
        "aligned_limited": Check(
            "active rows of each limited QP have positive inner products [cosine]", 1e-12
        ),
        "gradient": Check("L_g h is not zero at the boundary [norm over m/s, rad/s, m/s]", 1e-12),
        "cheaper": Check("the centralised QP costs no more than the limited ones", -1e-6),
    }


class Monitor:
    """A CollisionFilter that also keeps a record of the theorems' premises and conclusions.

    filter    the filter to fly; its decisions pass unchanged
    boundary  |h| below which a row is at the boundary of the safe set, in h's unit
    Both QPs are solved at every step on what each vehicle knows of itself, so it costs about three
    filters.
    Claims: Squires et al. 2022, Theorem 3 (gamma satisfies every row; positive inner products), Theorem 4
    (limited communication implies the centralised rows), Proposition 1 (L_g h != 0) and the remark on total
    cost. A barrier without a shared gamma is checked only where none is needed.
    """

    def __init__(self, filter: CollisionFilter, boundary: float = 0.05) -> None:
        self.filter, self.boundary = filter, boundary
        self.record = MonitorRecord(checks=theorem_checks())

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The filter's decision; the checks of the step go into the record."""
        decision = self.filter(view, nominal, limits)
        self._watch(self.filter.constraints(view), self.filter.problem(view, nominal, limits))
        self.record.steps += 1
        return decision

    @property
    def declaration(self) -> Declaration:
        """That of the filter it watches, with the record."""
        return replace(self.filter.declaration, record=self.record)

    def _watch(self, blocks: tuple[Constraints, ...], problem: Problem) -> None:
        step, see = self.record.steps, self.record.checks
        sizes = [np.sqrt(sum(np.sum(lie**2, axis=-1) for lie in rows.lie)) for rows in blocks]
        for rows, size in zip(blocks, sizes, strict=True):
            edge = np.abs(rows.h) <= self.boundary
            see["gradient"].see(step, size[edge], *(v[edge] for v in rows.vehicles))
        inside = all(bool(np.all(rows.h >= 0)) for rows in blocks)
        u, status, _ = problem.centralised(blocks)
        solved = bool(np.all(status == Status.SOLVED))
        if inside:
            see["solvable"].see(step, np.array([float(solved)]))
        if solved:
            active = [
                np.flatnonzero(np.abs(rows.left(u) - rows.rhs) <= ACTIVE * size)
                for rows, size in zip(blocks, sizes, strict=True)
            ]
            _see_cosines(see["aligned"], step, blocks, active, len(u))
        try:
            own = own_rows(blocks, self.filter.shares(blocks, len(u)))
        except ValueError:  # no manoeuvre: neither limited communication nor gamma exists
            return
        self._watch_limited(blocks, own, problem, inside, u if solved else None)

    def _watch_limited(
        self,
        blocks: tuple[Constraints, ...],
        own: Constraints,
        problem: Problem,
        inside: bool,
        u: Array | None,
    ) -> None:
        step, see, n = self.record.steps, self.record.checks, len(problem.target)
        v, status, _ = problem.limited(own)
        solved = status == Status.SOLVED
        if inside:
            see["solvable_limited"].see(step, solved.astype(float), np.arange(n))
        gamma, (vehicle,), (lie,) = self.filter.gamma(n), own.vehicles, own.lie
        for rows in blocks:
            all_solved = np.logical_and.reduce([solved[who] for who in rows.vehicles])
            _see_slack(see["limited_is_safe"], step, rows, v, all_solved)
            if gamma is not None:
                _see_slack(see["gamma_is_safe"], step, rows, gamma, rows.h >= 0)
        if gamma is not None:
            _see_slack(see["gamma_is_safe_limited"], step, own, gamma, own.h >= 0)
        slack = np.abs(own.left(v) - own.rhs)
        active = (slack <= ACTIVE * np.linalg.norm(lie, axis=-1)) & solved[vehicle]
        for who in np.unique(vehicle[active]):
            found = cosines(lie[active & (vehicle == who)])
            see["aligned_limited"].see(step, found, np.full(found.size, who))
        if u is not None and solved.all():
            cost, cost_limited = problem.cost_of(u), problem.cost_of(v)
            self.record.compared += 1
            self.record.cost += cost
            self.record.cost_limited += cost_limited
            see["cheaper"].see(step, np.array([(cost_limited - cost) / max(1.0, cost)]))


def _see_slack(check: Check, step: int, rows: Constraints, u: Array, which: NDArray[np.bool_]) -> None:
    """Check by how much inputs u (N, 3) satisfy `which` (R,) of the rows."""
    check.see(step, (rows.left(u) - rows.rhs)[which], *(v[which] for v in rows.vehicles))


def _see_cosines(
    check: Check, step: int, blocks: tuple[Constraints, ...], active: Sequence[NDArray[np.intp]], n: int
) -> None:
    """Check the inner products of all pairs of active rows, naming one row's vehicles, then the other's."""
    count, widest = sum(rows.size for rows in active), max(len(rows.vehicles) for rows in blocks)
    matrix, names = np.zeros((count, n, 3)), np.full((count, widest), -1)
    start = 0
    for rows, index in zip(blocks, active, strict=True):
        r = np.arange(start, start + index.size)
        for side, (vehicle, lie) in enumerate(zip(rows.vehicles, rows.lie, strict=True)):
            matrix[r, vehicle[index]], names[r, side] = lie[index], vehicle[index]
        start += index.size
    a, b = np.triu_indices(count, 1)
    check.see(step, cosines(matrix.reshape(count, 3 * n)), *names[a].T, *names[b].T)


def cosines(vectors: Array) -> Array:
    """Cosines between all pairs a < b of `vectors` (R, n)."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit = vectors / np.where(length > 0, length, 1.0)
    return np.asarray((unit @ unit.T)[np.triu_indices(len(unit), 1)])
