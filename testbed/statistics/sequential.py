"""Plans when a campaign may stop early: looks fixed beforehand, the error divided over them.

At each look the interval of the rate is Clopper-Pearson's at that look's share of the error. The chance that
any of these intervals misses the true rate is at most the sum of the shares (Bonferroni), whatever is decided
on the way; so a decision, and the interval that goes with it, are as good as `alpha` says.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, partial
from typing import Literal

import numpy as np

from testbed.statistics.rates import Rate, rate_of


class Decision(StrEnum):
    BELOW = "below"  # the rate is proven below the target
    ABOVE = "above"  # proven above
    GO_ON = "go on"
    UNDECIDED = "undecided"  # the last look has been, and proved neither


@dataclass(frozen=True)
class Look:
    """What one look said: `rate` with its interval at that look's share of the error.

    number  of the look, from 1; 0 before the first
    """

    number: int
    rate: Rate
    decision: Decision

    @property
    def final(self) -> bool:
        return self.decision is not Decision.GO_ON


@dataclass(frozen=True)
class Plan:
    """Looks at cumulative numbers of runs, to decide whether a rate lies below or above `target`.

    looks     increasing numbers of runs, the last being the most that are flown
    alpha     chance of any wrong decision, and of a final interval that misses the rate
    spending  "equal": the same share at each look, stops earliest; "obrien-fleming": shares that grow as
              2 - 2 Phi(z / sqrt(t)) with t the share of runs flown (Lan & DeMets 1983), which saves nearly
              all of alpha for the last look
    Raises    ValueError for a plan that cannot be followed
    """

    looks: tuple[int, ...]
    target: float
    alpha: float = 0.05
    spending: Literal["equal", "obrien-fleming"] = "equal"

    def __post_init__(self) -> None:
        if not self.looks or self.looks[0] < 1 or any(np.diff(self.looks) < 1):
            raise ValueError(f"looks {list(self.looks)}: give increasing numbers of runs, as [50, 100, 200]")
        if not 0.0 < self.target < 1.0:
            raise ValueError(f"target {self.target:g}: give a rate between 0 and 1, such as 0.01")
        if not 0.0 < self.alpha < 1.0:
            raise ValueError(f"alpha {self.alpha:g}: give an error between 0 and 1, such as 0.05")

    @cached_property
    def shares(self) -> tuple[float, ...]:
        """The error spent at each look; they add up to alpha."""
        from scipy.stats import norm

        if self.spending == "equal":
            return (self.alpha / len(self.looks),) * len(self.looks)
        flown = np.array(self.looks) / self.looks[-1]
        spent = 2.0 * norm.sf(norm.isf(self.alpha / 2) / np.sqrt(flown))
        return tuple(np.diff(spent, prepend=0.0).tolist())

    def look(self, number: int, events: int) -> Look:
        """Look `number` (from 1), `events` having been seen in the first looks[number - 1] runs."""
        seen = self._rate(number, events)
        if seen.high < self.target:
            return Look(number, seen, Decision.BELOW)
        if seen.low > self.target:
            return Look(number, seen, Decision.ABOVE)
        return Look(number, seen, Decision.UNDECIDED if number == len(self.looks) else Decision.GO_ON)

    def bounds(self) -> list[tuple[int, int]]:
        """Per look the most events that prove BELOW (-1: none does) and the fewest that prove ABOVE
        (runs + 1: none does)."""
        found = []
        for number, runs in enumerate(self.looks, 1):
            counts, rates = range(runs + 1), partial(self._rate, number)
            unproven = bisect_left(counts, self.target, key=lambda k, r=rates: r(k).high)  # type: ignore[misc]
            above = bisect_right(counts, self.target, key=lambda k, r=rates: r(k).low)  # type: ignore[misc]
            found.append((unproven - 1, above))
        return found

    def _rate(self, number: int, events: int) -> Rate:
        return rate_of(events, self.looks[number - 1], 1.0 - self.shares[number - 1])


def spread(first: int, last: int, looks: int) -> tuple[int, ...]:
    """`looks` numbers of runs from `first` to `last`, each the same factor above the one before."""
    return tuple(np.unique(np.round(np.geomspace(first, last, looks)).astype(int)).tolist())
