"""Compares how often an event occurs with and without a filter, encounter by encounter: the risk ratio.

The risk ratio is the rate of events with the filter over that without it, at equal seeds. It is the sum of
two shares of the events without the filter: the unresolved ones, which occur with it too, and the induced
ones, which occur with it alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from testbed.statistics.rates import Rate, rate_of

RESAMPLES = 10_000


@dataclass(frozen=True)
class Interval:
    """A two-sided interval, and how it was found; `low` and `high` are nan where there is none."""

    low: float
    high: float
    method: str


@dataclass(frozen=True)
class RiskRatio:
    """Events of `encounters` encounters that were flown with and without a filter.

    both, only_with, only_without  encounters with the event in both flights, or in one of them alone
    value       risk ratio; nan without events in either flight, inf where the filter alone has some
    unresolved  of the events without the filter, those that occur with it too
    induced     (low, value, high) events that occur with the filter alone, per event without it
    exact       interval of the ratio: those of the two parts, each at half of the error, added up. It covers
                at least `confidence`, whatever the counts, if encounters are independent
    bootstrap   percentile interval over encounters drawn again, or over groups of them
    note        what the counts do not tell; "" if nothing
    """

    encounters: int
    both: int
    only_with: int
    only_without: int
    confidence: float
    unresolved: Rate
    induced: tuple[float, float, float]
    exact: Interval
    bootstrap: Interval
    note: str
    method: ClassVar[str] = (
        "exact: Clopper-Pearson of the unresolved share, and of the induced events among induced and those"
        " without the filter, each at half of the error, added"
    )

    @property
    def with_filter(self) -> int:
        return self.both + self.only_with

    @property
    def without(self) -> int:
        return self.both + self.only_without

    @property
    def value(self) -> float:
        if self.without:
            return self.with_filter / self.without
        return np.inf if self.with_filter else np.nan

    def __str__(self) -> str:
        return f"{self.value:.3g} [{self.exact.low:.3g}, {self.exact.high:.3g}]"


def risk_ratio(
    with_filter: ArrayLike,
    without: ArrayLike,
    rng: np.random.Generator,
    groups: ArrayLike | None = None,
    confidence: float = 0.95,
) -> RiskRatio:
    """The risk ratio of events `with_filter` and `without` (n,) bool, of the same encounters.

    groups  (n,) encounters that belong together, as seeds of one geometry: the bootstrap draws whole groups,
            and the exact interval, which takes all n for independent, is left out if a group has several
    Raises ValueError if they differ in length
    """
    a, b = np.asarray(with_filter, dtype=bool), np.asarray(without, dtype=bool)
    if a.shape != b.shape or a.ndim != 1:
        raise ValueError(f"paired events need one each per encounter, got {a.shape} and {b.shape}")
    both, only_with, only_without = int((a & b).sum()), int((a & ~b).sum()), int((b & ~a).sum())
    counts = both, only_with, only_without
    sharper = 1.0 - 0.5 * (1.0 - confidence)
    unresolved, induced = parts(*counts, sharper)
    exact = Interval(unresolved.low + induced[0], unresolved.high + induced[2], RiskRatio.method)
    each = np.stack([a & b, a & ~b, b & ~a], axis=-1).astype(float)
    if groups is not None:
        _, of = np.unique(np.asarray(groups), return_inverse=True)
        grouped = np.zeros((int(of.max(initial=-1)) + 1, 3))
        np.add.at(grouped, of, each)
        if len(grouped) < len(each):
            exact = Interval(np.nan, np.nan, "none: encounters of one group are not independent")
        each = grouped
    told, told_induced = parts(*counts, confidence)
    return RiskRatio(
        a.size,
        *counts,
        confidence,
        told,
        told_induced,
        exact,
        _bootstrap(each, rng, confidence),
        _note(*counts),
    )


def parts(
    both: int, only_with: int, only_without: int, confidence: float
) -> tuple[Rate, tuple[float, float, float]]:
    """The unresolved share, and (low, value, high) of the induced ratio, each with an exact interval.

    Given how many events are induced or without the filter, the number of induced ones is binomial with the
    share r / (1 + r) of a ratio r.
    """
    without = both + only_without
    share = rate_of(only_with, only_with + without, confidence)
    value = only_with / without if without else (np.inf if only_with else np.nan)
    low, high = (s / (1.0 - s) if s < 1.0 else np.inf for s in (share.low, share.high))
    return rate_of(both, without, confidence), (low, value, high)


def _bootstrap(each: NDArray[np.float64], rng: np.random.Generator, confidence: float) -> Interval:
    """Percentiles of the ratio over resamples of rows (groups, 3): both, only with, only without."""
    both, only_with, only_without = each.sum(axis=0)
    if not both + only_without:
        return Interval(np.nan, np.nan, "none: no event without the filter, so resamples have no ratio")
    if not both + only_with:
        return Interval(np.nan, np.nan, "none: no event with the filter, so every resample says 0")
    kinds, number = np.unique(each, axis=0, return_counts=True)
    drawn = rng.multinomial(len(each), number / len(each), RESAMPLES) @ kinds
    below = drawn[:, 0] + drawn[:, 2]
    some = below > 0
    ratios = (drawn[some, 0] + drawn[some, 1]) / below[some]
    low, high = np.quantile(ratios, [0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence])
    none = int((~some).sum())
    missing = f"; {none} of {RESAMPLES} resamples had no event without it" if none else ""
    return Interval(float(low), float(high), f"percentiles of {RESAMPLES} resamples of encounters{missing}")


def _note(both: int, only_with: int, only_without: int) -> str:
    if not both + only_with + only_without:
        return "no event with or without the filter: the ratio is unknown"
    if not both + only_without:
        return "no event without the filter: the ratio has no upper bound; those with it are all induced"
    if not both + only_with:
        return "no event with the filter: 0 is an estimate, the upper end of the exact interval the bound"
    return ""
