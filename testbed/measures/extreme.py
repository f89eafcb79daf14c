"""The smallest value of each of several quantities, and when it occurred."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.model import Array


@dataclass
class Extreme:
    """The smallest value seen of each of several quantities, and when it was seen first.

    NaN is worse than any number: it stays, with the time when it was seen first.
    """

    value: Array
    t: Array

    @classmethod
    def of(cls, size: int) -> Extreme:
        return cls(np.full(size, np.inf), np.full(size, np.nan))

    def update(self, t: Array | float, value: Array, at: NDArray[np.intp] | None = None) -> None:
        """Take in `value` (..., size) at times `t` (...).

        at  (K,) the quantities that `value` (..., K) is of; None is all
        """
        if at is not None:
            some = Extreme(self.value[at], self.t[at])
            some.update(t, value)
            self.value[at], self.t[at] = some.value, some.t
            return
        low = value if value.ndim == 1 else value.min(axis=0)
        better = ~(low >= self.value)
        if not better.any():
            return
        better &= ~np.isnan(self.value)
        when = t if value.ndim == 1 else np.asarray(t)[np.argmin(value, axis=0)]
        self.value = np.where(better, low, self.value)
        self.t = np.where(better, when, self.t)

    def among(self, which: NDArray[np.bool_] | None) -> Extreme:
        """Of `which` (size,) of the quantities alone; of the others nothing was seen. None is all."""
        if which is None:
            return self
        return Extreme(np.where(which, self.value, np.inf), np.where(which, self.t, np.nan))

    def worst(self) -> tuple[int, float, float]:
        """Index, value and time of the smallest of all, NaN first; (-1, nan, nan) if nothing was seen."""
        if not np.any(~(self.value == np.inf)):
            return -1, float("nan"), float("nan")
        k = int(np.argmin(self.value))  # numpy takes NaN for the smallest
        return k, float(self.value[k]), float(self.t[k])
