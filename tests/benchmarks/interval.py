"""Repeats a measurement until it is known on which side of its target it lies, or says that it is noisy."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

LEAST, MOST = 5, 15


@dataclass(frozen=True)
class Measured:
    """The median of `count` measurements, and an interval that holds the true one nineteen times of 20."""

    value: float
    low: float
    high: float
    count: int

    def decides(self, target: float | None) -> bool:
        """Whether the interval is on one side of the target; without one, narrower than a tenth."""
        if target is None:
            return self.high - self.low <= 0.1 * abs(self.value)
        return self.low > target or self.high < target

    def to_json(self, target: float | None = None) -> dict[str, float | bool]:
        """Plain data; noisy if the interval does not decide."""
        return {
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "count": self.count,
            "noisy": not self.decides(target),
        }


def median_of(samples: Sequence[float]) -> Measured:
    """Of at least one sample; the interval from order statistics (of fewer than six the whole range)."""
    found, n = sorted(samples), len(samples)
    below = max(0, math.floor(0.5 * n - 0.98 * math.sqrt(n)))
    middle = 0.5 * (found[(n - 1) // 2] + found[n // 2])
    return Measured(middle, found[below], found[n - 1 - below], n)


def until_decided(
    sample: Callable[[], float], target: float | None = None, least: int = LEAST, most: int = MOST
) -> Measured:
    """The median of `least` to `most` samples: as few as decide on which side of `target` it lies."""
    samples = [sample() for _ in range(least)]
    while not median_of(samples).decides(target) and len(samples) < most:
        samples.append(sample())
    return median_of(samples)
