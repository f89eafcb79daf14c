"""Rates of many runs, each with its exact interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Rate:
    """`count` of `runs`, and a two-sided Clopper-Pearson interval at `confidence`."""

    count: int
    runs: int
    low: float
    high: float
    confidence: float
    method: ClassVar[str] = "Clopper-Pearson, exact"

    @property
    def value(self) -> float:
        return self.count / self.runs if self.runs else float("nan")

    def __str__(self) -> str:
        return f"{self.count}/{self.runs} ({100 * self.low:.0f}-{100 * self.high:.0f} %)"


def rate(outcomes: Sequence[bool] | ArrayLike, confidence: float = 0.95) -> Rate:
    """How often `outcomes` (n,) are True. No runs leave the interval at [0, 1]."""
    seen = np.asarray(outcomes, dtype=bool)
    return rate_of(int(seen.sum()), seen.size, confidence)


def rate_of(count: int, runs: int, confidence: float = 0.95) -> Rate:
    """The rate of `count` events in `runs`; ValueError if there are more events than runs."""
    from scipy.stats import binomtest

    if not runs and not count:
        return Rate(0, 0, 0.0, 1.0, confidence)
    interval = binomtest(count, runs).proportion_ci(confidence, method="exact")
    return Rate(count, runs, float(interval.low), float(interval.high), confidence)


def zero_event_bound(runs: int, confidence: float = 0.95) -> float:
    """Upper bound of a rate of which `runs` runs saw no event: 1 - (1 - confidence)^(1/runs), one-sided."""
    from scipy.stats import binomtest

    if runs < 1:
        return 1.0
    return float(binomtest(0, runs, alternative="less").proportion_ci(confidence, method="exact").high)
