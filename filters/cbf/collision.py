"""The collision-avoidance filter: the commands nearest to the nominal ones that satisfy every barrier's row.

The rows (`constraints`) are solved either for all vehicles at once ("centralised", Squires et al. 2022,
"Composition") or by every vehicle for itself, from what it sees and without knowing the others' inputs
("limited" communication, "Control calculation with limited communication").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import Barrier, PairValues
from filters.cbf.constraints import PerPair, Rows, barrier_rows, limited_rows, observed_rows, shares
from filters.cbf.problem import Problem, manoeuvre
from filters.constraints import Alpha, Constraints, Margin
from filters.filter import Decision, Declaration
from filters.model import Array, Command, Limits, View
from filters.qp import single
from filters.qp.single import Status

# Smallest change of a command that counts as the filter's doing [m/s, rad/s, m/s]; QPs are solved to 1e-9.
OVERRIDE = 1e-6


@dataclass(frozen=True)
class Passthrough:
    """No filter: the nominal commands clipped to the limits, status NONE."""

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        problem = Problem(*input_set(view, nominal, limits))
        none = np.zeros(len(problem.target))
        return decision(problem, problem.clipped, none.astype(int), none, None, np.zeros(0))

    @property
    def declaration(self) -> Declaration:
        """Nothing: it constrains no command."""
        return Declaration()


class CollisionFilter:
    """The paper's filter over one barrier and one alpha.

    barrier  a `Barrier`; or, with `shared=False`, a sequence of them, one per pair (see `PerPair`)
    alpha    h (P,) -> (P,) m/s, extended class K
    mode     "centralised": one QP over all vehicles; "limited": one per vehicle, on its own view
    margin   what each vehicle's side of a row is raised by (see `row_margins`); None is the paper's filter
    solver   "auto" or "osqp" (see `qp.Solver`)
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
    ) -> None:
        own = tuple(barrier) if isinstance(barrier, Sequence) else getattr(barrier, "barriers", ())
        if own:
            if shared:
                raise ValueError(
                    f"{len(own)} barriers with a manoeuvre each break the shared-manoeuvre assumption "
                    "(Squires et al. 2022, Assumption 1): their rows may contradict each other inside the "
                    "safe set; give one barrier for all pairs, or say shared=False to study just that"
                )
            barrier = PerPair(own)
        elif isinstance(barrier, Sequence):
            raise ValueError("an empty list of barriers; give one for all pairs, or one per pair")
        if mode not in ("centralised", "limited"):
            raise ValueError(f"mode is 'centralised' or 'limited', not {mode!r}")
        self.barrier: Barrier = barrier
        single.check_solver(solver)
        self.alpha, self.mode, self.margin, self.solver = alpha, mode, margin, solver
        self._gamma: dict[int, Array | None] = {}

    def rows(self, view: View) -> Rows:
        """The paper's rows of all pairs, without margin, from what each vehicle knows of itself."""
        return barrier_rows(self.barrier, self.alpha, view.own().state)

    @property
    def declaration(self) -> Declaration:
        """Its barrier, its rows and alpha; it is the paper's filter."""
        return Declaration(self.barrier, self._constraints, self.alpha, solves_qp=True, paper=True)

    def _constraints(self, view: View) -> tuple[Constraints, ...]:
        return (self.rows(view).constraints(),)

    def gamma(self, n: int) -> Array | None:
        """The shared evading manoeuvre (N, 3), or None if the barrier has none; read-only."""
        if n not in self._gamma:
            self._gamma[n] = manoeuvre(self.barrier, n)
        return self._gamma[n]

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The nearest safe commands to `nominal` (N,) inside `limits` () or (N,).

        Raises  ValueError if a nominal command, FloatingPointError if a barrier, is not finite; ValueError in
                limited mode if the barrier has no manoeuvre.
        """
        target, lower, upper = input_set(view, nominal, limits)
        rows = self.rows(view)
        problem = Problem(target, lower, upper, self.barrier, self.solver)
        if self.mode == "centralised":
            raised, left = rows.raised(self.margin), rows.left(problem.clipped)
            if (left >= raised.rhs).all():
                return _as_wanted(problem, rows, left)
            u, status, residual = problem.centralised(raised)
        elif view.shared:
            gamma = self.gamma(len(target))
            rhs_i, rhs_j = shares(self.barrier, rows, len(target), gamma, self.margin)
            left_i, left_j = rows.left_of_each(problem.clipped)
            if (left_i >= rhs_i).all() and (left_j >= rhs_j).all():
                return _as_wanted(problem, rows, left_i + left_j)
            u, status, residual = problem.limited(limited_rows(rows, rhs_i, rhs_j))
        else:
            own = observed_rows(self.barrier, self.alpha, view, self.gamma(len(target)))
            u, status, residual = problem.limited(own.raised(self.margin))
        return decision(problem, u, status, residual, rows.pairs, rows.left(u))


def _as_wanted(problem: Problem, rows: Rows, hdot: Array) -> Decision:
    """What is wanted, inside the limits, satisfies every row, as it mostly does: the optimum."""
    n = len(problem.target)
    solved = np.full(n, int(Status.SOLVED))
    return decision(problem, problem.clipped, solved, np.zeros(n), rows.pairs, hdot)


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


def decision(
    problem: Problem,
    u: Array,
    status: NDArray[np.int_],
    residual: Array,
    pairs: PairValues | None,
    hdot: Array,
) -> Decision:
    """The decision to fly `u` (N, 3), with what that changed; hdot (P,) is L_g h u of `pairs`."""
    beyond = np.abs(u - problem.clipped).max(-1) if u is not problem.clipped else np.zeros(len(u))
    return Decision(Command.of(u), status, residual, beyond > OVERRIDE, beyond, pairs, hdot)
