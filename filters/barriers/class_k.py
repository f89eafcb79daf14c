"""Defines class-K functions alpha(h), which say how fast h may fall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from filters.model import Array


@dataclass(frozen=True)
class OddPolynomial:
    """alpha(h) = c_0 h + c_1 h^3 + c_2 h^5 + ...: odd and strictly increasing: extended class K.

    coefficients  c_k >= 0, not all zero; c_k in m^(-2k)/s when h is in metres
    Raises  ValueError if a coefficient is negative or not finite, or if all are zero.
    Source  Squires et al. 2022, the zeroing barrier condition; the published runs use 0.1 h^3.
    """

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        c = np.atleast_1d(np.asarray(self.coefficients, dtype=float))
        if c.ndim != 1 or c.size == 0:
            raise ValueError(
                f"alpha needs a list of coefficients of h, h^3, h^5, ..., got {self.coefficients!r}"
            )
        if not np.all(np.isfinite(c)):
            raise ValueError(f"alpha's coefficients must be finite, got {c.tolist()}")
        if np.any(c < 0):
            raise ValueError(
                f"alpha's coefficients must not be negative, or alpha could decrease with h; got {c.tolist()}"
            )
        if not np.any(c > 0):
            raise ValueError("alpha's coefficients are all zero; at least one must be positive")
        object.__setattr__(self, "coefficients", tuple(c.tolist()))

    def __call__(self, h: ArrayLike) -> Array:
        """alpha(h), of h's shape."""
        h = np.asarray(h, dtype=float)
        square = h * h
        total: Array | float = self.coefficients[-1]
        for c in self.coefficients[-2::-1]:
            total = total * square + c
        return np.asarray(total * h)

    def derivative(self, h: ArrayLike) -> Array:
        """d alpha/dh, of h's shape; never negative."""
        square = np.square(np.asarray(h, dtype=float))
        weighted = [(2 * k + 1) * c for k, c in enumerate(self.coefficients)]
        total = np.full_like(square, weighted[-1])
        for c in weighted[-2::-1]:
            total = total * square + c
        return np.asarray(total)


def linear(c: float) -> OddPolynomial:
    """alpha(h) = c h, c in 1/s."""
    return OddPolynomial((c,))


def cubic(c: float) -> OddPolynomial:
    """alpha(h) = c h^3, c in 1/(m^2 s) for h in metres."""
    return OddPolynomial((0.0, c))
