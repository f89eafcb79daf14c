"""Checks the paper's claims about the QPs while a filter flies: are the premises met, do they hold?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from filters.cbf.collision import CollisionFilter, Problem, input_set
from filters.cbf.constraints import OwnRows, Rows, limited_rows, shares
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
    boundary  |h| below which a pair is at the boundary of the safe set, in h's unit
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
        decision = self.filter(view, nominal, limits)
        problem = Problem(*input_set(view, nominal, limits), self.filter.barrier, self.filter.solver)
        self._watch(self.filter.rows(view), problem)
        self.record.steps += 1
        return decision

    @property
    def declaration(self) -> Declaration:
        """That of the filter it watches, with the record."""
        return replace(self.filter.declaration, record=self.record)

    def _watch(self, rows: Rows, problem: Problem) -> None:
        step, see = self.record.steps, self.record.checks
        h, i, j = rows.pairs.h, rows.i, rows.j
        size = np.sqrt(np.sum(rows.lie_i**2, axis=-1) + np.sum(rows.lie_j**2, axis=-1))
        edge = np.abs(h) <= self.boundary
        see["gradient"].see(step, size[edge], i[edge], j[edge])
        inside = bool(np.all(h >= 0))
        u, status, _ = problem.centralised(rows)
        solved = bool(np.all(status == Status.SOLVED))
        if inside:
            see["solvable"].see(step, np.array([float(solved)]))
        if solved:
            active = np.flatnonzero(np.abs(rows.left(u) - rows.rhs) <= ACTIVE * size)
            _see_cosines(see["aligned"], step, rows, active)
        try:
            own = limited_rows(rows, *shares(self.filter.barrier, rows, len(u), self.filter.gamma(len(u))))
        except ValueError:  # no manoeuvre: neither limited communication nor gamma exists
            return
        self._watch_limited(rows, own, problem, inside, u if solved else None)

    def _watch_limited(
        self, rows: Rows, own: OwnRows, problem: Problem, inside: bool, u: Array | None
    ) -> None:
        step, see = self.record.steps, self.record.checks
        i, j, n = rows.i, rows.j, len(problem.target)
        v, status, _ = problem.limited(own)
        solved = status == Status.SOLVED
        if inside:
            see["solvable_limited"].see(step, solved.astype(float), np.arange(n))
        both = solved[i] & solved[j]
        see["limited_is_safe"].see(step, (rows.left(v) - rows.rhs)[both], i[both], j[both])
        gamma = self.filter.gamma(n)
        if gamma is not None:
            safe = rows.pairs.h >= 0
            see["gamma_is_safe"].see(step, (rows.left(gamma) - rows.rhs)[safe], i[safe], j[safe])
            twice = np.concatenate([safe, safe])
            slack = own.left(gamma) - own.rhs
            see["gamma_is_safe_limited"].see(step, slack[twice], own.vehicle[twice])
        slack = np.abs(own.left(v) - own.rhs)
        active = (slack <= ACTIVE * np.linalg.norm(own.lie, axis=-1)) & solved[own.vehicle]
        for vehicle in np.unique(own.vehicle[active]):
            lie = own.lie[active & (own.vehicle == vehicle)]
            cosines = _cosines(lie)
            see["aligned_limited"].see(step, cosines, np.full(cosines.size, vehicle))
        if u is not None and solved.all():
            cost, cost_limited = (float(np.sum((w - problem.target) ** 2)) for w in (u, v))
            self.record.compared += 1
            self.record.cost += cost
            self.record.cost_limited += cost_limited
            see["cheaper"].see(step, np.array([(cost_limited - cost) / max(1.0, cost)]))


def _see_cosines(check: Check, step: int, rows: Rows, active: NDArray[np.intp]) -> None:
    """Look at the inner products of all pairs of active rows; the vehicles named are i1, j1, i2, j2."""
    n = int(rows.j.max(initial=0)) + 1
    matrix = np.zeros((active.size, n, 3))
    r = np.arange(active.size)
    matrix[r, rows.i[active]], matrix[r, rows.j[active]] = rows.lie_i[active], rows.lie_j[active]
    a, b = np.triu_indices(active.size, 1)
    one, two = active[a], active[b]
    check.see(
        step, _cosines(matrix.reshape(active.size, 3 * n)), rows.i[one], rows.j[one], rows.i[two], rows.j[two]
    )


def _cosines(vectors: Array) -> Array:
    """Cosines between all pairs a < b of `vectors` (R, n)."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit = vectors / np.where(length > 0, length, 1.0)
    return np.asarray((unit @ unit.T)[np.triu_indices(len(unit), 1)])
