"""The collision-avoidance filter: the commands nearest to the nominal ones that satisfy every barrier's row.

The rows (`filters.rows`) are solved either for all vehicles at once ("centralised", Squires et al. 2022,
"Composition") or by every vehicle for itself, from what it sees and without knowing the others' inputs
("limited" communication, "Control calculation with limited communication").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from filters import qp
from filters.pairs import Barrier, PairValues
from filters.qp import Status
from filters.qp_each import solve_each
from filters.robust import Margin
from filters.rows import (
    Alpha,
    OwnRows,
    PerPair,
    Rows,
    barrier_rows,
    least,
    limited_rows,
    observed_rows,
    taken,
)
from filters.unicycle import Array, Command, Limits, View

Indices = NDArray[np.intp]

# Smallest change of a command that counts as the filter's doing [m/s, rad/s, m/s]; QPs are solved to 1e-9.
OVERRIDE = 1e-6


@dataclass(frozen=True, eq=False)
class Decision:
    """What a filter chose and why.

    command         (N,) inside the limits exactly
    status          (N,) `qp.Status` of the QP behind each vehicle's command
    residual        (N,) largest violation [m/s] over all rows of its QP the vehicle is in, dropped or not
    override        (N,) whether the filter changed the command beyond what the limits force
    deviation       (N,) |u - clip(u_hat)|_inf: what the filter changed beyond what the limits force
    pairs           the filter's own h over all pairs, None if it has none
    hdot_predicted  (P,) L_g h u [m/s] of those pairs under the chosen commands
    """

    command: Command
    status: NDArray[np.int_]
    residual: Array
    override: NDArray[np.bool_]
    deviation: Array
    pairs: PairValues | None
    hdot_predicted: Array


class Filter(Protocol):
    """What to fly instead of `nominal`, given what each vehicle sees."""

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision: ...


@dataclass(frozen=True)
class Passthrough:
    """No filter: the nominal commands clipped to the limits, status NONE."""

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        problem = Problem(*input_set(view, nominal, limits))
        none = np.zeros(len(problem.target))
        return decision(problem, problem.clipped, none.astype(int), none, None, np.zeros(0))


class CollisionFilter:
    """The paper's filter over one barrier and one alpha.

    barrier  a `Barrier`; or, with `shared=False`, a sequence of them, one per pair (see `PerPair`)
    alpha    h (P,) -> (P,) m/s, extended class K
    mode     "centralised": one QP over all vehicles; "limited": one per vehicle, on its own view
    margin   what each vehicle's side of a row is raised by (see `filters.robust`); None is the paper's filter
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
        solver: qp.Solver = "auto",
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
        qp.check_solver(solver)
        self.alpha, self.mode, self.margin, self.solver = alpha, mode, margin, solver
        self._gamma: dict[int, Array | None] = {}

    def rows(self, view: View) -> Rows:
        """The paper's rows of all pairs, without margin, from what each vehicle knows of itself."""
        return barrier_rows(self.barrier, self.alpha, view.own().state)

    def gamma(self, n: int) -> Array | None:
        """The shared evading manoeuvre (N, 3), or None if the barrier has none; read-only."""
        if n not in self._gamma:
            self._gamma[n] = _manoeuvre(self.barrier, n)
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
            u, status, residual = problem.centralised(rows.raised(self.margin))
        else:
            gamma = self.gamma(len(target))
            own = (
                limited_rows(self.barrier, rows, len(target), gamma)
                if view.shared
                else observed_rows(self.barrier, self.alpha, view, gamma)
            )
            u, status, residual = problem.limited(own.raised(self.margin))
        return decision(problem, u, status, residual, rows.pairs, rows.left(u))


@dataclass(frozen=True, eq=False)
class Problem:
    """Targets u_hat and limits, all (N, 3), and the barrier whose gamma to fly if a QP has no solution."""

    target: Array
    lower: Array
    upper: Array
    barrier: Barrier | None = None
    solver: qp.Solver = "auto"

    @cached_property
    def clipped(self) -> Array:
        """The targets inside the limits (N, 3)."""
        # numpy's own clip spends more time on checking its arguments than on so few numbers.
        return np.minimum(np.maximum(self.target, self.lower), self.upper)

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

    def _joint(self, rows: Rows, vehicles: Indices, use: Indices) -> qp.Solution:
        place = np.zeros(len(self.target), dtype=int)
        place[vehicles] = np.arange(vehicles.size)
        matrix = np.zeros((use.size, vehicles.size, 3))
        index = np.arange(use.size)
        matrix[index, place[rows.i[use]]] = rows.lie_i[use]
        matrix[index, place[rows.j[use]]] = rows.lie_j[use]
        return qp.solve(
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
        u, status = solve_each(
            self.target, vehicle[use], rows.lie[use], rows.rhs[use], self.lower, self.upper, self.solver
        )
        self._evade(u, np.flatnonzero(status != int(Status.SOLVED)))
        return u, status, _worst_of(len(u), (vehicle, rows.rhs - rows.left(u)))

    def _evade(self, u: Array, vehicles: Indices) -> None:
        """Have `vehicles` of u (N, 3) fly gamma, if there is one: their QP has no solution."""
        if vehicles.size == 0:
            return
        gamma = None if self.barrier is None else _manoeuvre(self.barrier, len(self.target))
        if gamma is not None:
            u[vehicles] = np.clip(gamma[vehicles], self.lower[vehicles], self.upper[vehicles])


def _manoeuvre(barrier: Barrier, n: int) -> Array | None:
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


def input_set(view: View, nominal: Command, limits: Limits) -> tuple[Array, Array, Array]:
    """u_hat, lower and upper, all (N, 3).

    Raises ValueError naming the vehicle whose nominal command is not finite, or if counts disagree.
    """
    n = len(view.state)
    target = nominal.array()
    if target.shape != (n, 3):
        raise ValueError(f"{n} vehicles need nominal commands of shape ({n},), got {nominal.shape}")
    if not np.isfinite(target).all():
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
    beyond = np.abs(u - problem.clipped).max(-1)
    return Decision(Command.of(u), status, residual, beyond > OVERRIDE, beyond, pairs, hdot)
