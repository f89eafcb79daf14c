"""Filters commands for collision avoidance: the nearest to the nominal ones that satisfy every constraint.

The rows (`constraints`) are solved either for all vehicles at once ("centralised", Squires et al. 2022,
"Composition") or by every vehicle for itself, from what it sees and without knowing the others' inputs
("limited" communication, "Control calculation with limited communication").
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Literal

import numpy as np

from filters.barriers.pairs import Barrier, PairValues, all_pairs
from filters.barriers.per_pair import PerPair
from filters.barriers.reach import Neighbours
from filters.cbf.constraints import manoeuvres, observed_rows, observed_shares, own_rows, pair_rows, shares
from filters.cbf.intruders import Intruders, released
from filters.cbf.problem import Cost, Problem, input_set
from filters.constraints import Alpha, Constraints, Maker, Margin
from filters.filter import Decision, Declaration
from filters.model import Array, Command, Limits, State, View
from filters.qp import single
from filters.qp.single import Status


@dataclass(frozen=True)
class Passthrough:
    """No filter: the nominal commands clipped to the limits, status NONE."""

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The commands (N,) inside `limits`."""
        problem = Problem(*input_set(view, nominal, limits))
        none = np.zeros(len(problem.target))
        return problem.decision(problem.clipped, none.astype(int), none, None, np.zeros(0))

    @property
    def declaration(self) -> Declaration:
        """Nothing: it constrains no command."""
        return Declaration()


class CollisionFilter:
    """The paper's filter over one barrier and one alpha.

    barrier  a `Barrier`; or, with `shared=False`, a sequence of them, one per pair (see `PerPair`)
    alpha    h (P,) -> (P,) m/s, extended class K
    mode     "centralised": one QP over all vehicles; "limited": one per vehicle, on its own view
    margin   what each vehicle's part of a row is raised by (see `row_margins`); None is the paper's filter
    solver   "auto" or "osqp" (see `qp.Solver`)
    cost     "raw": the paper's; "range": each input counts as a share of its range (see `Problem`)
    also     makers of constraints beside those of the pairs; centralised they see what each vehicle knows of
             itself, limited what one vehicle sees
    intruders  vehicles that are not under the filter and what is assumed of them; None: there are none
    near     which pairs can bind, where that is known; None looks at all. The commands are the same, since
             rows that no input can violate are in no QP; the decision has the values of those pairs alone
    A pair has a row if one of the two knows of the other (`View.known`); limited, the vehicle that does.
    Raises   ValueError for several barriers without `shared=False`, or an unknown mode or solver.

    A vehicle whose QP has no solution flies gamma clipped to the limits; without a shared gamma it flies the
    input with the largest common row margin. Its status says so.
    """

    def __init__(
        self,
        barrier: Barrier | Sequence[Barrier],
        alpha: Alpha,
        mode: Literal["centralised", "limited"] = "centralised",
        shared: bool = True,
        margin: Margin | None = None,
        solver: single.Solver = "auto",
        also: Sequence[Maker] = (),
        intruders: Intruders | None = None,
        cost: Cost = "raw",
        near: Neighbours | None = None,
    ) -> None:
        if isinstance(barrier, Sequence):
            if not barrier:
                raise ValueError("an empty list of barriers; give one for all pairs, or one per pair")
            barrier = PerPair(tuple(barrier))
        if isinstance(barrier, PerPair) and shared:
            raise ValueError(
                f"{len(barrier.barriers)} barriers with a manoeuvre each break the shared-manoeuvre"
                " assumption (Squires et al. 2022, Assumption 1): their rows may contradict each other inside"
                " the safe set; give one barrier for all pairs, or say shared=False to study just that"
            )
        if mode not in ("centralised", "limited"):
            raise ValueError(f"mode is 'centralised' or 'limited', not {mode!r}")
        if cost not in ("raw", "range"):
            raise ValueError(f"cost is 'raw' or 'range', not {cost!r}")
        single.check_solver(solver)
        self.cost: Cost = cost
        self.barrier: Barrier = barrier
        self.alpha, self.mode, self.margin, self.solver = alpha, mode, margin, solver
        self.also, self.intruders, self.near = tuple(also), intruders, near
        self._gamma: dict[int, Array | None] = {}

    def looking_at(self, near: Neighbours) -> CollisionFilter:
        """The same filter, which looks at near pairs only."""
        made = copy(self)
        made.near = near
        return made

    @property
    def declaration(self) -> Declaration:
        """Its barrier, its rows and alpha; it is the paper's filter."""
        return Declaration(self.barrier, self.constraints, self.alpha, solves_qp=True, paper=True)

    def constraints(self, view: View) -> tuple[Constraints, ...]:
        """The rows of all pairs and of `also`, without margin, from what each vehicle knows of itself."""
        return self._made(view)[1]

    def gamma(self, n: int) -> Array | None:
        """The shared evading manoeuvre (N, 3), or None if the barrier has none; read-only."""
        if n not in self._gamma:
            shared = self.barrier.manoeuvre(n)
            gamma = None if shared is None else shared.array()
            if gamma is not None:
                gamma.flags.writeable = False
            self._gamma[n] = gamma
        return self._gamma[n]

    def problem(self, view: View, nominal: Command, limits: Limits) -> Problem:
        """The step's targets and limits, and gamma for vehicles whose QP has no solution."""
        target, lower, upper = input_set(view, nominal, limits)
        return Problem(target, lower, upper, self.gamma(len(target)), self.solver, self.cost)

    def shares(
        self, blocks: Sequence[Constraints], n: int, margin: Margin | None = None
    ) -> list[tuple[Array, ...]]:
        """Each vehicle's share of the rows of every block; see `constraints.shares`.

        Raises  ValueError if rows over several vehicles have no manoeuvre.
        """
        gamma = self.gamma(n)
        return [shares(rows, manoeuvres(self.barrier, rows, n, gamma), margin) for rows in blocks]

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The nearest safe commands to `nominal` (N,) inside `limits` () or (N,).

        Raises  ValueError if a nominal command, FloatingPointError if a constraint, is not finite; ValueError
                in limited mode if the barrier has no manoeuvre.
        """
        if self.intruders is not None:
            return self._beside(self.intruders, view, nominal, limits)
        problem = self.problem(view, nominal, limits)
        pairs, blocks = self._made(view)
        n = len(problem.target)
        if self.mode == "centralised":
            raised = blocks if self.margin is None else [rows.raised(self.margin) for rows in blocks]
            left = [rows.left(problem.clipped) for rows in blocks]
            if all([(have >= rows.rhs).all() for have, rows in zip(left, raised, strict=True)]):
                return _as_wanted(problem, *self._over_all(pairs, left[0], n))
            u, status, residual = problem.centralised(raised)
        elif view.shared and view.known is None:
            each = self.shares(blocks, n, self.margin)
            parts = [part for rows in blocks for part in rows.parts(problem.clipped)]
            due = [rhs for own in each for rhs in own]
            if all([(part >= rhs).all() for part, rhs in zip(parts, due, strict=True)]):
                return _as_wanted(problem, pairs, parts[0] + parts[1])
            u, status, residual = problem.limited(own_rows(blocks, each))
        else:
            gamma, view = self.gamma(n), _one_by_one(view)
            own = self._observed(view, gamma)
            u, status, residual = problem.limited(own.raised(self.margin))
        return problem.decision(u, status, residual, *self._over_all(pairs, blocks[0].left(u), n))

    def _beside(self, intruders: Intruders, view: View, nominal: Command, limits: Limits) -> Decision:
        """`__call__` where there are intruders, which fly what they want."""
        problem = self.problem(view, nominal, limits)
        pairs, blocks = self._made(view)
        own_view, n = view.own(), len(problem.target)
        if self.mode == "centralised":
            u, status, residual = problem.centralised([rows.raised(self.margin) for rows in blocks])
        else:
            if view.shared and view.known is None:
                own = own_rows(blocks, self.shares(blocks, n, self.margin))
            else:
                own = self._observed(_one_by_one(view), self.gamma(n)).raised(self.margin)
            u, status, residual = problem.limited(own)
        all_rows = pair_rows(pairs, own_view.state, self.alpha)
        hdot = intruders.hdot(all_rows, u, own_view.rates.array())
        decision = problem.decision(u, status, residual, *over_all(pairs, hdot, n))
        return released(decision, nominal, limits, intruders.vehicles)

    def _over_all(self, pairs: PairValues, hdot: Array, n: int) -> tuple[PairValues, Array]:
        """As the decision has them: of the pairs looked at where only near ones are, else of all."""
        return (pairs, hdot) if self.near is not None else over_all(pairs, hdot, n)

    def _observed(self, view: View, gamma: Array | None) -> Constraints:
        """Every vehicle's own rows from what it sees, without margin."""
        own = observed_rows(self.barrier, self.alpha, view, gamma, self.intruders)
        if not self.also:
            return own
        others = [r for maker in self.also for r in observed_shares(maker, self.barrier, view, gamma)]
        return own_rows([own, *others], [(rows.rhs,) for rows in (own, *others)])

    def _made(self, view: View) -> tuple[PairValues, tuple[Constraints, ...]]:
        """The values of all pairs, and the rows: theirs first, then those of `also`."""
        own = view.own()
        if self.near is not None and own.known is None:
            pairs = self.barrier.values(own.state, *self.near.pairs(own.state))
        elif own.known is None:
            pairs = self.barrier.values(own.state)
        else:
            i, j = all_pairs(len(own.state))
            met = own.joined(i, j) if self.intruders is None else self.intruders.met(own, i, j)
            pairs = self.barrier.values(own.state, i[met], j[met])
        rows = pair_rows(pairs, own.state, self.alpha)
        others = [block.known(own) for maker in self.also for block in maker(own)] if self.also else ()
        if self.intruders is not None:
            return pairs, (*self.intruders.rows(rows, own.rates.array()), *others)
        return pairs, (rows, *others)


def over_all(pairs: PairValues, hdot: Array, n: int) -> tuple[PairValues, Array]:
    """Values and hdot over all pairs of n vehicles, nan where two do not know of each other."""
    if len(hdot) == n * (n - 1) // 2:
        return pairs, hdot
    i, j = all_pairs(n)
    met = (pairs.i * (2 * n - pairs.i - 1)) // 2 + pairs.j - pairs.i - 1
    full = np.full((10, i.size), np.nan)
    full[0, met], full[1:9, met], full[9, met] = pairs.h, pairs.grad.T, hdot
    return PairValues(i, j, full[0], full[1:9].T), full[9]


def _one_by_one(view: View) -> View:
    """The view with arrays [observer, vehicle]."""
    if not view.shared:
        return view
    square = (len(view.state), len(view.state))
    return view.altered(
        State(*(np.broadcast_to(x, square) for x in view.state.array().T)),
        Command(*(np.broadcast_to(x, square) for x in view.rates.array().T)),
    )


def _as_wanted(problem: Problem, pairs: PairValues, hdot: Array) -> Decision:
    """The decision where the nominal commands inside the limits satisfy every row: they are the optimum."""
    solved = np.empty(len(problem.target), dtype=int)
    solved[:] = Status.SOLVED
    return problem.decision(problem.clipped, solved, np.zeros(len(solved)), pairs, hdot)
