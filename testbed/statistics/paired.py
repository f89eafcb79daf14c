"""Compares two systems seed by seed: whether their verdicts or distances differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from testbed.statistics.means import Mean, mean
from testbed.statistics.rates import Rate, rate_of

Alternative = Literal["two-sided", "less", "greater"]


@dataclass(frozen=True)
class PairedVerdicts:
    """Events (say, violations) of two systems on the same seeds.

    only_first, only_second  seeds on which one of them alone had the event
    share                    of these discordant seeds, the second's; 1/2 if the systems are alike
    p_value                  exact binomial test of that 1/2 (McNemar's, exact); 1 without discordant seeds
    """

    runs: int
    both: int
    only_first: int
    only_second: int
    share: Rate
    p_value: float

    @property
    def difference(self) -> float:
        """The second's rate minus the first's."""
        return (self.only_second - self.only_first) / self.runs if self.runs else float("nan")

    def __str__(self) -> str:
        return f"{self.only_second} against {self.only_first} of {self.runs} seeds, p {self.p_value:.2g}"


def paired_verdicts(
    first: ArrayLike, second: ArrayLike, alternative: Alternative = "two-sided", confidence: float = 0.95
) -> PairedVerdicts:
    """Compare events `first` and `second` (n,) bool, seed by seed.

    alternative  "greater": the second has the event more often
    Raises ValueError if they differ in length.
    """
    from scipy.stats import binomtest

    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    _same_length(a, b)
    only_first, only_second = int((a & ~b).sum()), int((b & ~a).sum())
    discordant = only_first + only_second
    p = float(binomtest(only_second, discordant, 0.5, alternative).pvalue) if discordant else 1.0
    share = rate_of(only_second, discordant, confidence)
    return PairedVerdicts(a.size, int((a & b).sum()), only_first, only_second, share, p)


@dataclass(frozen=True)
class PairedDistances:
    """Differences, second minus first, of a number measured on the same seeds.

    changed  seeds on which they differ at all (by more than the resolution)
    mean     of all differences, with its interval
    p_value  Wilcoxon signed-rank test that they are symmetric about 0; 1 if nothing changed
    """

    runs: int
    changed: int
    mean: Mean
    median: float
    p_value: float

    def __str__(self) -> str:
        return f"{self.mean}, median {self.median:+.2f}, p {self.p_value:.2g}"


def paired_distances(
    first: ArrayLike,
    second: ArrayLike,
    rng: np.random.Generator,
    alternative: Alternative = "two-sided",
    resolution: float = 0.0,
) -> PairedDistances:
    """Compare numbers `first` and `second` (n,), seed by seed.

    alternative  "less": the second's are smaller
    resolution   differences no larger than this count as none: rounding is no evidence
    Differences of 0 say nothing of a direction and are left out of the test (Wilcoxon's own rule). It is
    exact up to 50 differences without ties; with ties it permutes signs up to 13 and is normal above.
    Raises ValueError if they differ in length, or a difference is nan.
    """
    from scipy.stats import wilcoxon

    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    _same_length(a, b)
    difference = b - a
    if np.isnan(difference).any():
        raise ValueError(f"{int(np.isnan(difference).sum())} of {a.size} differences are nan")
    difference = np.where(np.abs(difference) <= resolution, 0.0, difference)
    changed = difference[difference != 0.0]
    p = float(wilcoxon(changed, alternative=alternative).pvalue) if changed.size else 1.0
    middle = float(np.median(difference)) if difference.size else float("nan")
    return PairedDistances(a.size, changed.size, mean(difference, rng), middle, p)


def _same_length(a: np.ndarray, b: np.ndarray) -> None:
    if a.shape != b.shape or a.ndim != 1:
        raise ValueError(f"paired values need one each per seed, got {a.shape} and {b.shape}")
