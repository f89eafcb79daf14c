"""Defines what pairwise barriers share: pairs, values with gradients, forms of h, differenced gradients."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from filters.model import Array, Command, State

Index = Any
"""Indexes a state's arrays: ints (P,), or for a state of more axes a tuple of them, the vehicle last."""

FORMS = ("root", "squared")

# Pairs computed at a time. The temporaries of one block stay in cache and in memory the allocator keeps;
# those of 4950 pairs are returned to the system and mapped again, 300 page faults a call (none below 1250).
BLOCK = 1000
# Pairs up to which plain numbers are faster than arrays: plain numbers take 5 us a pair, arrays 70 us for
# any number.
FEW = 6


@dataclass(frozen=True, eq=False)
class PairValues:
    """A barrier's values at P pairs.

    i, j  (P,) 0-based vehicles, i < j unless the caller chose them; as given when the caller gave indices
    h     (P,) m in root form, m^2 in squared form; h >= 0 is safe
    grad  (P, 8) dh/d[x_i, x_j], columns x, y, theta, z of vehicle i, then of j
    known  the state the values were made at and L_g h there, where both were made together; else None
    """

    i: Index
    j: Index
    h: Array
    grad: Array
    known: tuple[State, tuple[Array, Array]] | None = None

    def lie(self, state: State) -> tuple[Array, Array]:
        """L_g h of vehicles i and of j at `state`, each (P, 3) over (v, omega, zeta); L_f h = 0.

        state  the state the values were computed at; it gives the courses
        Source  Squires et al. 2022, eq. (2): g has the columns (cos theta, sin theta, 0, 0), e_3 and e_4.
        """
        if self.known is not None and self.known[0] is state:
            return self.known[1]
        ahead = np.empty((2, *state.shape))
        np.cos(state.theta, out=ahead[0])
        np.sin(state.theta, out=ahead[1])
        grad = self.grad.T.reshape(2, 4, -1)  # [i or j, x y theta z, pair]
        rows = np.empty((2, 3, len(self.h)))
        for row, vehicle, g in zip(rows, (self.i, self.j), grad, strict=True):
            along = g[:2] * at(ahead, vehicle)
            np.add(along[0], along[1], out=row[0])
        rows[:, 1:] = grad[:, 2:]
        return rows[0].T, rows[1].T


class Barrier(Protocol):
    """A pairwise barrier h(x_i, x_j) >= 0, made from an evading manoeuvre."""

    @property
    def d_safe(self) -> float:
        """Ds [m], the separation to keep."""
        ...

    def manoeuvre(self, n: int) -> Command | None:
        """gamma, (n,): what each of n vehicles flies to evade; None if there is no one manoeuvre."""
        ...

    def values(self, state: State, i: Index | None = None, j: Index | None = None) -> PairValues:
        """h and its gradient over all pairs i < j of a state (N,), or over the pairs (i, j) given.

        With a state of more axes (a View: observers by vehicles) i and j are tuples of index arrays whose
        last entry is the vehicle, such as `(observer, vehicle)`.
        """
        ...


@lru_cache(maxsize=64)
def all_pairs(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(i, j), each (n (n-1)/2,): the pairs i < j of n vehicles, 0-based, in row order; read-only."""
    i, j = np.triu_indices(n, 1)
    i.flags.writeable = j.flags.writeable = False
    return i, j


def chosen_pairs(state: State, i: Index | None, j: Index | None) -> tuple[Index, Index]:
    """The pairs asked for, or all of them.

    Raises  ValueError if only one of i and j is given, or none for a state of more than one axis.
    """
    if i is not None and j is not None:
        return _arrays(i), _arrays(j)
    if i is not None or j is not None:
        raise ValueError("give both pair indices i and j, or neither")
    if len(state.shape) != 1:
        raise ValueError(f"give pair indices (observer, vehicle) for a state of shape {state.shape}")
    return all_pairs(len(state))


def _arrays(index: Index) -> Index:
    return tuple(np.asarray(k) for k in index) if isinstance(index, tuple) else np.asarray(index)


def by_blocks(i: Index, j: Index, kernel: Callable[[Index, Index, Array], Array]) -> PairValues:
    """The values at pairs (i, j), by blocks: `kernel(i, j, grad)` fills grad (8, p) and returns h (p,)."""
    count = len(vehicle_of(i))
    if count <= BLOCK:
        grad = np.empty((8, count))
        return PairValues(i, j, kernel(i, j, grad), grad.T)
    h, grad = np.empty(count), np.empty((8, count))
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        cut_i, cut_j = (tuple(k[part] for k in x) if isinstance(x, tuple) else x[part] for x in (i, j))
        h[part] = kernel(cut_i, cut_j, grad[:, part])
    return PairValues(i, j, h, grad.T)


def at(values: Array, index: Index) -> Any:
    """values (..., P) of values (..., N) or (..., observers, N), of any type, at pair indices."""
    return values[(..., *index)] if isinstance(index, tuple) else values.take(index, axis=-1)


def vehicle_of(index: Index) -> NDArray[np.intp]:
    """The vehicle numbers (P,) of pair indices."""
    return np.asarray(index[-1] if isinstance(index, tuple) else index)


class Kind(NamedTuple):
    """The operations that differ between plain numbers and arrays."""

    sqrt: Callable[[Any], Any]
    larger: Callable[[Any, Any], Any]
    smaller: Callable[[Any, Any], Any]


ARRAYS = Kind(np.sqrt, np.maximum, np.minimum)
NUMBERS = Kind(math.sqrt, max, min)

Form = Callable[[Any, float, Kind], tuple[Any, Any]]
"""(m, d_safe, kind) -> (h, dh/dm), m (P,) m^2 being the squared clearance."""


def form_function(form: str) -> Form:
    """The form of h of that name.

    Raises  ValueError for an unknown name.
    """
    try:
        return {"root": root_form, "squared": squared_form}[form]
    except KeyError:
        raise ValueError(f"unknown form {form!r} of h; choose one of {', '.join(FORMS)}") from None


def root_form(m: Any, d_safe: float, kind: Kind) -> tuple[Any, Any]:
    """h = sqrt(m) - Ds [m], continued linearly (C1) below m0 = (0.1 Ds)^2.

    The paper's root is imaginary or infinitely steep far outside the safe set (delta, smoothing and
    coincident vehicles lead there), and a NaN or an infinite row would silently disable a constraint.
    """
    m0 = (0.1 * d_safe) ** 2
    # m first: of plain numbers the larger is then NaN if m is.
    root = kind.sqrt(kind.larger(m, m0))
    slope = 0.5 / root
    return root + kind.smaller(m - m0, 0.0) * slope - d_safe, slope


def squared_form(m: Any, d_safe: float, kind: Kind) -> tuple[Any, Any]:
    """h = m - Ds^2 [m^2]."""
    return m - d_safe**2, 1.0


def check_separation(d_safe: float) -> None:
    """Raises ValueError unless Ds is a positive finite number of metres."""
    if not (np.isfinite(d_safe) and d_safe > 0):
        raise ValueError(f"d_safe must be positive and finite, got {d_safe} m")


def check_count(n: int, per_vehicle: Array, name: str) -> None:
    """Raises ValueError if a per-vehicle parameter `name` does not have one entry for each of n vehicles."""
    if per_vehicle.ndim and len(per_vehicle) != n:
        raise ValueError(f"{name} has {len(per_vehicle)} entries for {n} vehicles; give one each")


@dataclass(frozen=True)
class ForwardDifference:
    """Any barrier with its gradient replaced by forward differences, as the published figures were made.

    step  m for x, y, z and rad for theta
    Raises  ValueError unless step is positive and finite.
    """

    barrier: Barrier
    step: float = 1e-4

    def __post_init__(self) -> None:
        if not (np.isfinite(self.step) and self.step > 0):
            raise ValueError(f"a forward-difference step must be positive and finite, got {self.step}")

    @property
    def d_safe(self) -> float:
        return self.barrier.d_safe

    def manoeuvre(self, n: int) -> Command | None:
        """That of the barrier whose gradient is differenced."""
        return self.barrier.manoeuvre(n)

    def values(self, state: State, i: Index | None = None, j: Index | None = None) -> PairValues:
        """As `Barrier.values`; the gradient is (h(x + step e_k) - h(x)) / step over the eight entries."""
        i, j = chosen_pairs(state, i, j)
        # A new first axis holds the state as it is and shifted in each field of every vehicle; a pair then
        # takes its two vehicles from different rows, so the inner barrier needs no knowledge of the shift.
        fields = state.array()
        shifted = np.repeat(fields[np.newaxis], 5, axis=0)
        for k in range(4):
            shifted[k + 1, ..., k] += self.step
        rows = State.of(shifted)
        tuple_i = i if isinstance(i, tuple) else (i,)
        tuple_j = j if isinstance(j, tuple) else (j,)
        same = np.zeros_like(vehicle_of(i))
        # From the same arrays as the shifted ones: equal roundings drop out of the differences.
        h = self.barrier.values(rows, (same, *tuple_i), (same, *tuple_j)).h
        grad = np.empty((8, len(h)))
        for k in range(4):
            row = same + (k + 1)
            grad[k] = self.barrier.values(rows, (row, *tuple_i), (same, *tuple_j)).h
            grad[k + 4] = self.barrier.values(rows, (same, *tuple_i), (row, *tuple_j)).h
        grad -= h
        grad /= self.step
        return PairValues(i, j, h, grad.T)
