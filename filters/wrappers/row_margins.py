"""Defines margins on the rows of a filter's QPs, for inputs that are not flown exactly as commanded.

A margin raises the right-hand side of a row by an amount per vehicle side, from that side's own L_g h: the
centralised row of a pair gets both sides', each limited-communication row its own, so a margin is split
over |V^j| and the two limited rows still imply the centralised one. Both kinds can make a QP infeasible
where the paper's has a solution (gamma satisfies the plain rows only); the status says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.constraints import Margin
from filters.model import Array


@dataclass(frozen=True)
class BoundedError:
    """The margin sum_c d_c |L_g h|_c: hdot + alpha(h) >= 0 whatever each channel does within its bound.

    v, omega, zeta  m/s, rad/s, m/s: bounds d of |achieved - commanded|
    No smaller margin would do: some corner of the box of errors uses all of it.
    Raises  ValueError naming a bound that is negative or not finite.
    """

    v: float = 0.0
    omega: float = 0.0
    zeta: float = 0.0

    def __post_init__(self) -> None:
        _not_negative(self, "v", "omega", "zeta")

    def __call__(self, lie: Array) -> Array:
        return np.asarray(np.abs(lie) @ np.array([self.v, self.omega, self.zeta]))


@dataclass(frozen=True)
class InputToState:
    """The margin |W L_g h|^2 / epsilon: what an error of any size costs is bounded, not excluded.

    epsilon         m/s for h in m (m^2/s for h in m^2), positive: smaller is more cautious
    v, omega, zeta  m/s, rad/s, m/s: W's diagonal, errors of comparable weight. With W = 1 the turn rate's
                    L_g h, hundreds of metres per radian, would be all that counts.
    With errors d = W e of a side, |e| <= 1 being an error of the size W states, the side loses at most
    |W L_g h| |e| - |W L_g h|^2 / epsilon <= epsilon |e|^2 / 4, so hdot + alpha(h) >= -epsilon/4 times the sum
    of both sides' |e|^2, and h stays above alpha^-1 of that.
    Raises  ValueError naming a parameter out of range.
    Source  Kolathaya & Ames 2019, "Input-to-state safety with control barrier functions" (IEEE L-CSS 3(1)).
    """

    epsilon: float
    v: float = 1.0
    omega: float = 1.0
    zeta: float = 1.0

    def __post_init__(self) -> None:
        _not_negative(self, "v", "omega", "zeta")
        if not (np.isfinite(self.epsilon) and self.epsilon > 0):
            raise ValueError(f"epsilon must be positive and finite, got {self.epsilon}")

    def __call__(self, lie: Array) -> Array:
        weights = np.square([self.v, self.omega, self.zeta])
        return np.asarray(np.square(lie) @ weights / self.epsilon)


@dataclass(frozen=True)
class Sum:
    """Several margins added."""

    margins: tuple[Margin, ...]

    def __call__(self, lie: Array) -> Array:
        total = np.zeros(len(lie))
        for margin in self.margins:
            total = total + margin(lie)
        return total


def _not_negative(owner: object, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        if not (np.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be finite and not negative, got {value}")
