"""The rows of the filter's QPs: what a barrier, an alpha and a state ask of the inputs.

One row per pair, L_g h_i u_i + L_g h_j u_j >= -alpha(h), because L_f h = 0 for the vehicles here
(Squires et al. 2022, "Composition of multiple safety constraints").
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filters.unicycle import Array, State


@dataclass(frozen=True, eq=False)
class Rows:
    """The barrier rows of P pairs: lie_i u_i + lie_j u_j >= rhs [m/s], and gamma's share of each side.

    i, j            (P,)    the pair's vehicles, from 0
    lie_i, lie_j    (P, 3)  L_g h over (v, omega, zeta)
    rhs             (P,)    -alpha(h)
    evade_i, _j     (P,)    lie_i gamma_i and lie_j gamma_j; nan if the barrier has no manoeuvre
    pairs           the barrier's PairValues
    """

    i: NDArray[np.int_]
    j: NDArray[np.int_]
    lie_i: Array
    lie_j: Array
    rhs: Array
    evade_i: Array
    evade_j: Array
    pairs: Any

    def left(self, u: Array) -> Array:
        """L_g h u (P,) of inputs u (N, 3)."""
        return np.einsum("pc,pc->p", self.lie_i, u[self.i]) + np.einsum("pc,pc->p", self.lie_j, u[self.j])

    def limited(self) -> tuple[NDArray[np.int_], Array, Array]:
        """The limited-communication rows, each pair's seen from i and then from j: vehicle, lie, rhs, (2P, ...).

        Each vehicle takes half of what gamma leaves over (|V^j| = 2), so the two halves add up to the pair's row.
        """
        share = 0.5 * (self.evade_i - self.evade_j)
        return (
            np.concatenate([self.i, self.j]),
            np.concatenate([self.lie_i, self.lie_j]),
            np.concatenate([0.5 * self.rhs + share, 0.5 * self.rhs - share]),
        )


def barrier_rows(
    barrier: Any, alpha: Callable[[Array], Array], state: State, i: Any = None, j: Any = None
) -> Rows:
    """The rows of all pairs i < j of `state` (N,), or of those given.

    Raises FloatingPointError naming the pair if h, its derivative or alpha(h) is not finite: a NaN compares
    false with everything and would silently remove the constraint.
    """
    pairs = barrier.values(state) if i is None else barrier.values(state, i, j)
    a, b = np.asarray(pairs.i), np.asarray(pairs.j)
    lie_i, lie_j = pairs.lie(state)
    rhs = -np.asarray(alpha(pairs.h), dtype=float)
    fine = np.isfinite(pairs.h) & np.isfinite(lie_i).all(-1) & np.isfinite(lie_j).all(-1) & np.isfinite(rhs)
    if not fine.all():
        p = int(np.flatnonzero(~fine)[0])
        raise FloatingPointError(
            f"the barrier of vehicles {a[p] + 1} and {b[p] + 1} (pair {p + 1} of {a.size}) is not finite: h "
            f"{pairs.h[p]}, L_g h {lie_i[p]} and {lie_j[p]}, alpha(h) {-rhs[p]}"
        )
    gamma_i, gamma_j = _manoeuvres(barrier, a, b, len(state))
    evade_i, evade_j = np.einsum("pc,pc->p", lie_i, gamma_i), np.einsum("pc,pc->p", lie_j, gamma_j)
    return Rows(a, b, lie_i, lie_j, rhs, evade_i, evade_j, pairs)


def shared_manoeuvre(barrier: Any, n: int) -> Array | None:
    """gamma (N, 3), or None if the barrier has none (or one per pair)."""
    give = getattr(barrier, "manoeuvre", None)
    command = None if give is None else give(n)
    return None if command is None else command.array()


def _manoeuvres(barrier: Any, i: Array, j: Array, n: int) -> tuple[Array, Array]:
    """gamma of each pair's two vehicles, (P, 3) each; nan where there is none."""
    if hasattr(barrier, "manoeuvres"):
        return barrier.manoeuvres(i, j, n)  # type: ignore[no-any-return]
    gamma = shared_manoeuvre(barrier, n)
    if gamma is None:
        return np.full((i.size, 3), np.nan), np.full((i.size, 3), np.nan)
    return gamma[i], gamma[j]


@dataclass(frozen=True)
class PerPair:
    """A barrier of its own for every pair, in the order (1,2), (1,3), ..., (2,3), ...

    Breaks the shared-manoeuvre assumption (Squires et al. 2022, Assumption 1) unless all manoeuvres agree, so
    rows may contradict each other inside the safe set: for showing just that.
    """

    barriers: tuple[Any, ...]

    @property
    def d_safe(self) -> float:
        return max(b.d_safe for b in self.barriers)

    def values(self, state: State, i: Any = None, j: Any = None) -> Any:
        n = len(state)
        if n * (n - 1) // 2 != len(self.barriers):
            raise ValueError(
                f"{n} vehicles have {n * (n - 1) // 2} pairs, but {len(self.barriers)} barriers came"
            )
        a, b = np.triu_indices(n, 1) if i is None else (np.atleast_1d(i), np.atleast_1d(j))
        parts = [
            self._of(p, q, n).values(state, np.array([p]), np.array([q])) for p, q in zip(a, b, strict=True)
        ]
        return type(parts[0])(
            a, b, np.concatenate([v.h for v in parts]), np.concatenate([v.grad for v in parts])
        )

    def manoeuvres(self, i: Array, j: Array, n: int) -> tuple[Array, Array]:
        """gamma of each pair's own barrier for its two vehicles, (P, 3) each."""
        gammas = [self._of(p, q, n).manoeuvre(n).array() for p, q in zip(i, j, strict=True)]
        return (
            np.array([g[p] for g, p in zip(gammas, i, strict=True)]).reshape(-1, 3),
            np.array([g[q] for g, q in zip(gammas, j, strict=True)]).reshape(-1, 3),
        )

    def _of(self, i: int, j: int, n: int) -> Any:
        i, j = min(i, j), max(i, j)
        return self.barriers[i * (2 * n - i - 1) // 2 + j - i - 1]
