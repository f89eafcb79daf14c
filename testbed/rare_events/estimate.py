"""Defines what is estimated: the probability that a limit state is below 0, and an estimate of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from filters.model import Array

# Takes (n, d) standard normal numbers, a run a row; returns (n,) values. Those below 0 are the event.
# A nan is a run without a value; it counts as no event, and is said.
LimitState = Callable[[Array], Array]


@dataclass(frozen=True)
class Estimate:
    """A probability with its interval.

    runs      how many runs it took in all, adaptation included
    error     standard error of the probability, relative to it; nan where unknown
    method    what was done, and how the interval was found
    doubts    why the interval may be wrong, a sentence each; empty if nothing speaks against it
    detail    further numbers, by name
    """

    probability: float
    low: float
    high: float
    runs: int
    error: float
    confidence: float
    method: str
    doubts: tuple[str, ...] = ()
    detail: dict[str, Any] = field(default_factory=dict)

    @property
    def plain_runs(self) -> float:
        """How many runs plain sampling needs for the same relative standard error."""
        p = self.probability
        if not (0.0 < p < 1.0 and self.error > 0.0):
            return np.nan
        return (1.0 - p) / (p * self.error**2)
