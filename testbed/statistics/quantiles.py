"""Quantiles with intervals that assume nothing of the distribution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Quantile:
    """The `share` quantile of `runs` values, and two order statistics that enclose the true one.

    Half-way between two order statistics their mean is taken, so that the quantile of 1/2 is the median.

    `low` is -inf and `high` inf where the values are too few to bound that side.
    """

    share: float
    runs: int
    value: float
    low: float
    high: float
    confidence: float
    method: ClassVar[str] = "order statistics, exact for any distribution"

    def __str__(self) -> str:
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def quantile(values: ArrayLike, share: float, confidence: float = 0.95) -> Quantile:
    """The `share` quantile (0 < share < 1) of `values` (n,), and an exact interval of order statistics.

    Order statistics come in steps, so the interval covers at least `confidence`, for any distribution.
    Raises ValueError for a share outside (0, 1) or a value that is nan: a run without the number is the
    caller's to count, not ours to drop.
    """
    from scipy.stats import quantile_test

    data = np.asarray(values, dtype=float)
    if missing := int(np.isnan(data).sum()):
        raise ValueError(f"{missing} of {data.size} values are nan: a quantile has no place for them")
    if not 0.0 < share < 1.0:
        raise ValueError(f"share {share:g}: give one between 0 and 1, such as 0.05")
    if not data.size:
        return Quantile(share, 0, float("nan"), -np.inf, np.inf, confidence)
    interval = quantile_test(data, p=share).confidence_interval(confidence)
    # scipy says nan for an order statistic beyond the sample
    low = -np.inf if np.isnan(interval.low) else float(interval.low)
    high = np.inf if np.isnan(interval.high) else float(interval.high)
    value = float(np.quantile(data, share, method="averaged_inverted_cdf"))
    return Quantile(share, data.size, value, low, high, confidence)
