"""Rates and paired differences against exact values."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import beta

from testbed.statistics import mean, rate, zero_event_bound


@pytest.mark.parametrize(("count", "runs"), [(0, 60), (1, 60), (25, 60), (60, 60)])
def test_the_interval_of_a_rate_is_clopper_and_pearsons(count: int, runs: int) -> None:
    found = rate([True] * count + [False] * (runs - count))
    low = beta.ppf(0.025, count, runs - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, runs - count) if count < runs else 1.0
    assert (found.low, found.high) == pytest.approx((low, high), abs=1e-9)
    assert found.value == count / runs


def test_three_hundred_runs_without_an_event_bound_the_rate_below_one_per_cent() -> None:
    assert zero_event_bound(300) == pytest.approx(1 - 0.05 ** (1 / 300), rel=1e-9)
    assert zero_event_bound(300) < 0.01 < zero_event_bound(298 - 1)
    assert zero_event_bound(0) == 1.0


def test_no_runs_say_nothing() -> None:
    assert (rate([]).low, rate([]).high) == (0.0, 1.0)
    assert np.isnan(mean([], np.random.default_rng(0)).value)


def test_the_bootstrap_interval_covers_the_mean_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    trials = [mean(rng.normal(1.0, 2.0, 50), rng) for _ in range(200)]
    covered = np.mean([m.low <= 1.0 <= m.high for m in trials])
    # 95 % nominal; percentile intervals of 50 draws cover about 94 %, binomial spread of 200 trials 1.7 %
    assert 0.88 <= covered <= 0.99


def test_differences_that_are_all_equal_have_an_interval_of_no_width() -> None:
    found = mean([-0.5] * 20, np.random.default_rng(0))
    assert (found.value, found.low, found.high) == (-0.5, -0.5, -0.5)
