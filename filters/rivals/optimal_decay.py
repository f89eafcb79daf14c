"""Filters commands with rows whose decay rate is a decision variable: the optimal-decay CBF-QP.

Zeng, Zhang, Li & Sreenath, "Safety-critical control using optimal-decay control barrier function with
guaranteed point-wise feasibility" (American Control Conference 2021, arXiv:2103.12375).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import Barrier, all_pairs
from filters.cbf.collision import over_all
from filters.cbf.constraints import pair_rows
from filters.cbf.intruders import Intruders
from filters.cbf.problem import Cost, Problem, groups, input_set
from filters.constraints import Alpha, Constraints
from filters.filter import Decision, Declaration
from filters.model import Array, Command, Limits, View
from filters.qp import single
from filters.qp.single import Status

# What a decay factor may be at most; the authors leave it open.
MOST = 1e6


@dataclass(frozen=True, eq=False)
class OptimalDecayFilter:
    """One QP over all vehicles: rows hdot + w alpha(h) >= 0, with a factor w >= 0 of each row to choose.

    The cost is that of the inputs and the sum of p (w - 1)^2 over the rows: with w = 1 it is the paper's QP.

    barrier    h, that of the scenario
    alpha      h (P,) -> (P,), extended class K
    weight     p, in the unit of the inputs' cost
    cost       of the inputs, see `filters.cbf.problem.Problem`
    intruders  vehicles that are not under the filter and what is assumed of them; None: there are none
    Raises   ValueError for a weight that is not positive and finite, or an unknown cost.

    Premises  those of h. Inside the safe set (h > 0) every row is satisfied by some w, so the QP has a
              solution whatever the input limits; on its border it has one if h is a barrier. Feasible at each
              state does not mean for ever: with w above 1 h may fall faster than alpha allows.
    Where there is no solution (h < 0 and rows that contradict each other) vehicles fly the evading manoeuvre.
    """

    barrier: Barrier
    alpha: Alpha
    weight: float = 1.0
    cost: Cost = "raw"
    intruders: Intruders | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.weight) and self.weight > 0):
            raise ValueError(f"the weight of the decay must be positive and finite, got {self.weight}")
        if self.cost not in ("raw", "range"):
            raise ValueError(f"cost is 'raw' or 'range', not {self.cost!r}")

    @property
    def declaration(self) -> Declaration:
        """Its barrier; its rows bend to the inputs, so it declares none."""
        return Declaration(self.barrier, solves_qp=True)

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The optimum for `nominal` (N,) inside `limits`.

        Raises  ValueError if a nominal command, FloatingPointError if a row, is not finite.
        """
        target, lower, upper = input_set(view, nominal, limits)
        n, own, beside = len(target), view.own(), self.intruders
        shared = self.barrier.manoeuvre(n)
        gamma = None if shared is None else shared.array()
        problem = Problem(target, lower, upper, gamma, cost=self.cost)
        i, j = all_pairs(n)
        if own.known is not None:
            met = own.joined(i, j) if beside is None else beside.met(own, i, j)
            i, j = i[met], j[met]
        pairs = self.barrier.values(own.state, i, j)
        rows = pair_rows(pairs, own.state, self.alpha)
        rates = own.rates.array()
        blocks = (rows,) if beside is None else beside.rows(rows, rates)
        u, status, _, residual = self.solve(problem, blocks)
        hdot = rows.left(u) if beside is None else beside.hdot(rows, u, rates)
        return problem.decision(u, status, residual, *over_all(pairs, hdot, n))

    def solve(
        self, problem: Problem, blocks: Sequence[Constraints]
    ) -> tuple[Array, NDArray[np.int_], tuple[Array, ...], Array]:
        """Inputs (N, 3), status (N,), factors w (R,) of every block and residual (N,) of the QP of all rows.

        The residual is by how much rows are short with their own w.
        """
        u = problem.clipped
        n, residual = len(u), np.zeros(len(u))
        decay = tuple(np.ones(rows.h.size) for rows in blocks)
        status = np.full(n, int(Status.SOLVED))
        broken = [rows.left(u) < rows.rhs for rows in blocks]
        if not any(b.any() for b in broken):
            return u, status, decay, residual
        # A row that no input violates at w = 1 keeps w = 1: leaving it out changes nothing.
        kept = [~(rows.least(problem.lower, problem.upper) >= rows.rhs) for rows in blocks]
        label = groups(n, blocks, kept)
        of = [label[rows.vehicles[0]] for rows in blocks]
        u = u.copy()
        for g in np.unique(np.concatenate([own[b] for own, b in zip(of, broken, strict=True)])):
            inside = np.flatnonzero(label == g)
            use = [k & (own == g) for k, own in zip(kept, of, strict=True)]
            some = [rows.chosen(which) for rows, which in zip(blocks, use, strict=True)]
            u[inside], factors, found = self._group(problem, some, inside)
            status[inside] = int(found)
            if found != Status.SOLVED and problem.evading is not None:
                u[inside] = problem.evading[inside]
            for which, into in zip(use, decay, strict=True):
                count = int(which.sum())
                into[which], factors = factors[:count], factors[count:]
        for rows, w in zip(blocks, decay, strict=True):
            short = np.maximum(-w * _alpha(rows) - rows.drift - rows.left(u), 0.0)
            for vehicle in rows.vehicles:
                np.maximum.at(residual, vehicle, short)
        return u, status, decay, residual

    def _group(
        self, problem: Problem, blocks: Sequence[Constraints], vehicles: NDArray[np.intp]
    ) -> tuple[Array, Array, Status]:
        """Inputs (M, 3) and factors (R,) of the QP of the vehicles (M,) that these rows join."""
        m, count = vehicles.size, sum(rows.h.size for rows in blocks)
        place = np.zeros(len(problem.target), dtype=int)
        place[vehicles] = np.arange(m)
        scale = np.ones((m, 3)) if problem.scale is None else problem.scale[vehicles]
        root, start = np.sqrt(self.weight), 0
        matrix = np.zeros((count, 3 * m + count))
        inputs = np.zeros((count, m, 3))
        for rows in blocks:
            index = np.arange(start, start + rows.h.size)
            for vehicle, lie in zip(rows.vehicles, rows.lie, strict=True):
                inputs[index, place[vehicle]] = lie * scale[place[vehicle]]
            # The last entries are s = sqrt(p) (w - 1): then the cost is the plain distance to the target.
            matrix[index, 3 * m + index] = _alpha(rows) / root
            start += rows.h.size
        matrix[:, : 3 * m] = inputs.reshape(count, 3 * m)
        box = [(x[vehicles] / scale).ravel() for x in (problem.target, problem.lower, problem.upper)]
        ends = (np.zeros(count), np.full(count, -root), np.full(count, root * (MOST - 1.0)))
        target, lower, upper = (np.concatenate(parts) for parts in zip(box, ends, strict=True))
        rhs = np.concatenate([rows.rhs for rows in blocks])
        found = single.solve(target, matrix, rhs, lower, upper)
        u = found.u[: 3 * m].reshape(m, 3) * scale
        u = np.minimum(np.maximum(u, problem.lower[vehicles]), problem.upper[vehicles])
        return u, 1.0 + found.u[3 * m :] / root, found.status


def _alpha(rows: Constraints) -> Array:
    """alpha(h) (R,) of rows whose right-hand side is -alpha(h) - L_f h."""
    return -rows.rhs - rows.drift
