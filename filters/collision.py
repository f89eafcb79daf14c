"""The collision-avoidance filter: the commands nearest to the nominal ones that keep every barrier's promise.

One row per pair, L_g h_i u_i + L_g h_j u_j >= -alpha(h) (L_f h = 0 here), solved either for all vehicles at once
("centralised") or by every vehicle for itself from what it sees, without knowing the others' inputs ("limited"
communication, Squires et al. 2022, "Control calculation with limited communication").
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from filters import qp
from filters.qp import Status
from filters.rows import PerPair, Rows, barrier_rows, shared_manoeuvre
from filters.unicycle import Array, Command, Limits, View

# Smallest change of a command that counts as the filter's doing [m/s, rad/s, m/s]; QPs are solved to 1e-9.
OVERRIDE = 1e-6


@dataclass(frozen=True, eq=False)
class Decision:
    """What a filter chose and why.

    command         (N,) inside the limits exactly
    status          (N,) `qp.Status` of the QP behind each vehicle's command
    residual        (N,) largest violation [m/s] of the QP's rows each vehicle appears in, dropped rows included
    override        (N,) whether the command differs from the nominal one
    deviation       (N,) |u - clip(u_hat)|_inf: what the filter changed beyond what the limits force
    pairs           the filter's own h over all pairs, None if it has none
    hdot_predicted  (P,) L_g h u [m/s] of those pairs under the chosen commands
    """

    command: Command
    status: NDArray[np.int_]
    residual: Array
    override: NDArray[np.bool_]
    deviation: Array
    pairs: Any | None
    hdot_predicted: Array


class Filter(Protocol):
    """What to fly instead of `nominal`, given what each vehicle sees."""

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision: ...


@dataclass(frozen=True)
class Passthrough:
    """No filter: the nominal commands clipped to the limits, status NONE."""

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        target, lower, upper = _arrays(view, nominal, limits)
        none = np.zeros(len(target))
        return _decision(
            target, lower, upper, np.clip(target, lower, upper), none.astype(int), none, None, np.zeros(0)
        )


class CollisionFilter:
    """The paper's filter over one barrier and one alpha.

    barrier  has `values(state, i=None, j=None)` and `manoeuvre(n)`; or, with `shared=False`, a sequence of
             barriers, one per pair
    alpha    h (P,) -> (P,) m/s, extended class K
    mode     "centralised": one QP over all vehicles; "limited": one per vehicle on its own view
    Raises   ValueError if several barriers come without `shared=False`, or "limited" without a manoeuvre.

    A vehicle whose QP has no solution flies gamma clipped to the limits; without a shared gamma it flies the input
    with the largest common row margin. Its status says so.
    """

    def __init__(
        self,
        barrier: Any | Sequence[Any],
        alpha: Callable[[Array], Array],
        mode: Literal["centralised", "limited"] = "centralised",
        shared: bool = True,
    ) -> None:
        if isinstance(barrier, Sequence):
            if shared:
                raise ValueError(
                    f"{len(barrier)} barriers with manoeuvres of their own break the shared-manoeuvre assumption "
                    "(Squires et al. 2022, Assumption 1), without which rows may contradict each other inside "
                    "the safe set; give one barrier for all pairs, or say shared=False to study just that"
                )
            barrier = PerPair(tuple(barrier))
        if mode not in ("centralised", "limited"):
            raise ValueError(f"mode is 'centralised' or 'limited', not {mode!r}")
        if mode == "limited" and not (hasattr(barrier, "manoeuvre") or hasattr(barrier, "manoeuvres")):
            raise ValueError(
                "limited communication splits each row at the evading manoeuvre, and this barrier has none; "
                "use mode='centralised'"
            )
        self.barrier, self.alpha, self.mode = barrier, alpha, mode

    def rows(self, view: View) -> Rows:
        """The rows of all pairs, each vehicle's pose as it knows its own."""
        return barrier_rows(self.barrier, self.alpha, view.own().state)

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The nearest safe commands to `nominal` (N,) inside `limits` () or (N,).

        Raises ValueError on a nominal command, FloatingPointError on a barrier, that is not finite.
        """
        target, lower, upper = _arrays(view, nominal, limits)
        rows = self.rows(view)
        fallback = shared_manoeuvre(self.barrier, len(target))
        problem = Problem(target, lower, upper, fallback)
        if self.mode == "centralised":
            u, status, residual = problem.centralised(rows)
        else:
            u, status, residual = problem.limited(*self._seen(view, rows))
        return _decision(target, lower, upper, u, status, residual, rows.pairs, rows.left(u))

    def _seen(self, view: View, own: Rows) -> tuple[NDArray[np.int_], Array, Array]:
        """Every vehicle's limited-communication rows from its own view: vehicle, lie, rhs, (2P, ...)."""
        if view.shared:
            return own.limited()
        parts = []
        everyone = np.arange(len(view.state))
        for n in everyone:
            others = np.delete(everyone, n)
            i, j = np.minimum(n, others), np.maximum(n, others)
            vehicle, lie, rhs = barrier_rows(self.barrier, self.alpha, view.of(n).state, i, j).limited()
            mine = vehicle == n
            parts.append((vehicle[mine], lie[mine], rhs[mine]))
        vehicles, lies, bounds = zip(*parts, strict=True)
        return np.concatenate(vehicles), np.concatenate(lies), np.concatenate(bounds)


@dataclass(frozen=True, eq=False)
class Problem:
    """Targets u_hat and limits, all (N, 3), and what to fly if a QP has no solution (N, 3) or None."""

    target: Array
    lower: Array
    upper: Array
    fallback: Array | None

    def centralised(self, rows: Rows) -> tuple[Array, NDArray[np.int_], Array]:
        """Inputs (N, 3), status (N,) and residual (N,) of the QP over all vehicles.

        Cost and box couple no vehicles, so each group of vehicles joined by rows is a QP of its own: exact.
        """
        i, j = rows.i, rows.j
        # The least a row can be over the box. Rows no input can violate go: that is exact, and they are the
        # worst scaled ones (a cubic alpha far from the boundary).
        least = np.minimum(rows.lie_i * self.lower[i], rows.lie_i * self.upper[i]).sum(-1)
        least += np.minimum(rows.lie_j * self.lower[j], rows.lie_j * self.upper[j]).sum(-1)
        kept = np.flatnonzero(~(least >= rows.rhs))

        u = np.clip(self.target, self.lower, self.upper)
        status = np.full(len(u), int(Status.SOLVED))
        broken = kept[rows.left(u)[kept] < rows.rhs[kept]]
        if broken.size:
            group = _groups(len(u), i[kept], j[kept])
            for g in np.unique(group[i[broken]]):
                inside = np.flatnonzero(group == g)
                use = kept[group[i[kept]] == g]
                u[inside], status[inside] = self._joint(rows, inside, use)
        short = np.maximum(rows.rhs - rows.left(u), 0.0)
        residual = np.zeros(len(u))
        np.maximum.at(residual, i, short)
        np.maximum.at(residual, j, short)
        return u, status, residual

    def _joint(self, rows: Rows, vehicles: Array, use: Array) -> tuple[Array, int]:
        place = np.zeros(len(self.target), dtype=int)
        place[vehicles] = np.arange(vehicles.size)
        matrix = np.zeros((use.size, vehicles.size, 3))
        index = np.arange(use.size)
        matrix[index, place[rows.i[use]]] = rows.lie_i[use]
        matrix[index, place[rows.j[use]]] = rows.lie_j[use]
        return self._solve(vehicles, matrix.reshape(use.size, -1), rows.rhs[use])

    def limited(self, vehicle: Array, lie: Array, rhs: Array) -> tuple[Array, NDArray[np.int_], Array]:
        """The same for one QP per vehicle, rows `lie u_vehicle >= rhs` (R, 3) and (R,)."""
        least = np.minimum(lie * self.lower[vehicle], lie * self.upper[vehicle]).sum(-1)
        kept = ~(least >= rhs)
        u = np.clip(self.target, self.lower, self.upper)
        status = np.full(len(u), int(Status.SOLVED))
        broken = kept & (np.einsum("rc,rc->r", lie, u[vehicle]) < rhs)
        for n in np.unique(vehicle[broken]):
            use = kept & (vehicle == n)
            u[n], status[n] = self._solve(np.array([n]), lie[use], rhs[use])
        residual = np.zeros(len(u))
        np.maximum.at(residual, vehicle, np.maximum(rhs - np.einsum("rc,rc->r", lie, u[vehicle]), 0.0))
        return u, status, residual

    def _solve(self, vehicles: Array, matrix: Array, rhs: Array) -> tuple[Array, int]:
        lower, upper = self.lower[vehicles], self.upper[vehicles]
        solution = qp.solve(self.target[vehicles].ravel(), matrix, rhs, lower.ravel(), upper.ravel())
        if solution.status != Status.SOLVED and self.fallback is not None:
            return np.clip(self.fallback[vehicles], lower, upper), int(solution.status)
        return solution.u.reshape(-1, 3), int(solution.status)


def _groups(n: int, i: Array, j: Array) -> NDArray[np.int_]:
    """A label (N,) per vehicle, equal where rows between i and j (R,) join vehicles."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, label = connected_components(coo_array((np.ones(i.size), (i, j)), shape=(n, n)), directed=False)
    return np.asarray(label)


def _arrays(view: View, nominal: Command, limits: Limits) -> tuple[Array, Array, Array]:
    """u_hat, lower and upper, all (N, 3)."""
    n = len(view.state)
    target = nominal.array()
    if target.shape != (n, 3):
        raise ValueError(f"{n} vehicles need nominal commands of shape ({n},), got {nominal.shape}")
    if not np.isfinite(target).all():
        bad = int(np.flatnonzero(~np.isfinite(target).all(-1))[0])
        raise ValueError(f"the nominal command of vehicle {bad + 1} is not finite: {target[bad]}")
    return (
        target,
        np.broadcast_to(limits.lower.array(), (n, 3)),
        np.broadcast_to(limits.upper.array(), (n, 3)),
    )


def _decision(
    target: Array,
    lower: Array,
    upper: Array,
    u: Array,
    status: NDArray[np.int_],
    residual: Array,
    pairs: Any,
    hdot: Array,
) -> Decision:
    beyond = np.abs(u - np.clip(target, lower, upper)).max(-1)
    return Decision(
        Command.of(u), status, residual, np.abs(u - target).max(-1) > OVERRIDE, beyond, pairs, hdot
    )
