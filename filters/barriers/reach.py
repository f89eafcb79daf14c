"""How near vehicles have to be for the turn barrier to matter: bounds of h by the distance of the circles.

A vehicle that turns for ever flies a circle. Two that turn at one rate come no nearer than their circles do,
so h is large where the centres are far apart. And h changes at a bounded rate, so that a row of a pair whose
alpha(h) is above that rate holds whatever its vehicles do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import FEW, check_count
from filters.model import Array, Command, Limits, State

Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]

# The rates are bounded so many times over: rounding, and what delta and smoothing add to a gradient, are far
# below one time.
_TIMES = 2.0
_FURTHEST_M = 1e7


@dataclass(frozen=True, eq=False)
class Reach:
    """Bounds of a `TurnBarrier` in root form.

    radius   (N,) m, signed, of the circles that the vehicles fly
    d_safe   m
    loss     m^2, by how much delta and smoothing lower the squared clearance at most
    """

    radius: Array
    d_safe: float
    loss: float = 0.0

    def centres(self, state: State) -> Array:
        """(N, 2) m: of the circles, at a state (N,)."""
        check_count(len(state), self.radius, "radius")
        return np.stack(
            [state.x - self.radius * np.sin(state.theta), state.y + self.radius * np.cos(state.theta)],
            axis=-1,
        )

    @property
    def largest(self) -> float:
        """m, the largest radius."""
        return float(np.abs(self.radius).max())

    def least_h(self, apart: float) -> float:
        """No pair whose centres are `apart` [m] or more has a smaller h [m]; -inf if nothing is known."""
        gap = apart - 2.0 * self.largest
        if not gap * abs(gap) > 4.0 * self.loss:  # what is lost is then a small share, too
            return -np.inf
        return float(np.sqrt(gap * gap - self.loss) - self.d_safe)

    def apart(self, h: float) -> float:
        """m between centres from which on h is at least `h` [m]."""
        gap = max(0.0, h) + self.d_safe
        return 2.0 * self.largest + float(np.sqrt(max(gap * gap, 4.0 * self.loss) + self.loss)) + 1e-6

    def rate(self, v: Array, omega: Array, zeta: Array) -> float:
        """No vehicle that flies one of these rates (...) changes h of a pair faster [m/s].

        Every point of its circle moves by no more than the vehicle and twice the radius times the turn.
        """
        moved = np.abs(v) + np.abs(zeta) + 2.0 * self.largest * np.abs(omega)
        return _TIMES * float(np.max(moved, initial=0.0))

    def binding(self, alpha: Callable[[Array], Array], limits: Limits, gamma: Command) -> float:
        """The h [m] from which on no row can bind: of both vehicles, or each vehicle's share of it.

        Inputs within `limits` change h by at most a rate B for each vehicle, gamma as well. The row of both
        holds where alpha(h) >= 2 B, a vehicle's share, alpha(h) / 2 less what gamma does, where it is 4 B.
        """
        low, high = limits.corners
        most = np.maximum(np.abs(low), np.abs(high))
        rate = max(self.rate(*most.T), self.rate(gamma.v, gamma.omega, gamma.zeta))
        return inverse(alpha, 4.0 * rate)


def inverse(alpha: Callable[[Array], Array], value: float) -> float:
    """An h [m] from which on alpha(h) is at least `value` > 0, nearly the smallest; inf if none is known."""
    low, high = 0.0, 1.0
    while not float(alpha(np.asarray(high))) >= value:
        low, high = high, 2.0 * high
        if high > _FURTHEST_M:
            return float("inf")
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if float(alpha(np.asarray(middle))) >= value else (middle, high)
    return high


def within(places: Array, apart: float) -> Pairs:
    """All pairs i < j of places (N, 2) that are at most `apart` [m] from each other, in row order.

    By a k-d tree, a little further than asked for.
    """
    from scipy.spatial import cKDTree

    found = cKDTree(places).query_pairs(apart * (1.0 + 1e-9) + 1e-6, output_type="ndarray")
    order = np.lexsort((found[:, 1], found[:, 0]))
    i, j = found[order].T.astype(np.intp)
    return i, j


@dataclass(frozen=True)
class Neighbours:
    """The pairs that a filter need look at.

    h  m, from which on no row of a pair can bind
    """

    reach: Reach
    h: float

    @property
    def apart(self) -> float:
        """m between centres from which on no row can bind."""
        return self.reach.apart(self.h)

    def pairs(self, state: State) -> Pairs:
        """The pairs at a state (N,) whose rows can bind, and some more.

        More than a few: fewer would be computed in plain numbers, which round otherwise.
        """
        places, apart = self.reach.centres(state), self.apart
        i, j = within(places, apart)
        while i.size <= FEW and apart < _FURTHEST_M:
            apart *= 2.0
            i, j = within(places, apart)
        return i, j
