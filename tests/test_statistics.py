"""Rates, quantiles, paired tests and sequential plans, against exact values and by simulation."""

from __future__ import annotations

import itertools
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import beta, binom
from scipy.stats import t as student

from testbed.statistics import (
    Decision,
    Plan,
    distinct,
    mean,
    means,
    nothing_random,
    paired_distances,
    paired_verdicts,
    quantile,
    rate,
    rate_of,
    spread,
    zero_event_bound,
)

sys.path.insert(0, str(Path(__file__).parent))
from benchmarks import coverage

TRIALS = 20_000


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def no_more_than(nominal: float, trials: int) -> float:
    """What a share of `trials` stays below if its probability is at most `nominal`: 4 standard deviations."""
    return nominal + 4 * np.sqrt(nominal * (1 - nominal) / trials)


@pytest.mark.parametrize(("count", "runs"), [(0, 60), (1, 60), (25, 60), (60, 60)])
def test_the_interval_of_a_rate_is_clopper_and_pearsons(count: int, runs: int) -> None:
    found = rate([True] * count + [False] * (runs - count))
    low = beta.ppf(0.025, count, runs - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, runs - count) if count < runs else 1.0
    assert (found.low, found.high) == pytest.approx((low, high), abs=1e-9)
    assert found.value == count / runs
    assert found == rate_of(count, runs)


@pytest.mark.parametrize("true", [0.002, 0.05, 0.5, 0.97])
@pytest.mark.parametrize("runs", [20, 150])
def test_the_interval_of_a_rate_covers_the_known_rate(true: float, runs: int) -> None:
    intervals = [rate_of(k, runs) for k in range(runs + 1)]
    misses = np.array([not i.low <= true <= i.high for i in intervals])
    assert misses[rng().binomial(runs, true, TRIALS)].mean() <= no_more_than(0.05, TRIALS)


def test_three_hundred_runs_without_an_event_bound_the_rate_below_one_per_cent() -> None:
    assert zero_event_bound(300) == pytest.approx(1 - 0.05 ** (1 / 300), rel=1e-9)
    assert zero_event_bound(300) < 0.01 < zero_event_bound(298 - 1)
    assert zero_event_bound(0) == 1.0


def test_no_runs_say_nothing() -> None:
    assert (rate([]).low, rate([]).high) == (0.0, 1.0)
    assert np.isnan(mean([], rng()).value)
    nothing = quantile([], 0.5)
    assert np.isnan(nothing.value) and (nothing.low, nothing.high) == (-np.inf, np.inf)
    assert paired_verdicts([], []).p_value == 1.0


@pytest.mark.parametrize("values", [[3.0], [4.0, 1.0], [1.0, 5.0, 2.0], [8.0, 1.0, 2.0, 4.0]])
def test_the_quantile_of_one_half_is_the_median(values: list[float]) -> None:
    assert quantile(values, 0.5).value == np.median(values)


@pytest.mark.slow
@pytest.mark.parametrize("distribution", coverage.DISTRIBUTIONS)
@pytest.mark.parametrize(("n", "at_least"), [(10, 0.93), (20, 0.94), (50, 0.94)])
def test_the_interval_of_a_mean_covers_it_on_skewed_data(distribution: str, n: int, at_least: float) -> None:
    """The percentile bootstrap covers 79 to 90 % of the lognormal means, BCa 81 to 91 %."""
    assert coverage.measured(distribution, n, 1000, seed=4)["ours"] >= at_least


def test_a_mean_says_how_its_interval_was_found() -> None:
    draw = rng()
    assert mean(draw.normal(size=20), draw).method == means.METHOD
    assert mean(draw.normal(size=9), draw).method == means.METHOD_FEW
    assert mean([0.0] * 15 + [1.0, 2.0, 3.0], draw).method == means.METHOD_FEW
    assert mean([2.0] * 9, draw).method == means.METHOD_EQUAL
    one = mean([2.0], draw)
    assert (one.value, one.low, one.high, one.method) == (2.0, -np.inf, np.inf, means.METHOD_ONE)


def test_the_interval_of_a_mean_is_no_narrower_than_students_t() -> None:
    values = rng().exponential(size=15)
    found = mean(values, rng())
    t = student.interval(0.98, 14, values.mean(), values.std(ddof=1) / np.sqrt(15))
    assert found.low <= t[0] and found.high >= t[1]
    # a long tail above: the interval reaches farther up than down
    assert found.high - found.value > found.value - found.low


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_the_interval_of_a_mean_has_the_unit_of_the_values(scale: float) -> None:
    values = rng().exponential(size=15)
    plain, scaled = mean(values, rng()), mean(scale * values, rng())
    assert (scaled.low, scaled.high) == pytest.approx((scale * plain.low, scale * plain.high), rel=1e-9)


def test_equal_runs_are_one() -> None:
    assert distinct([]) == 0
    assert distinct([{"a": 1.0, "b": None}, {"b": None, "a": 1.0}, {"a": 1.0, "b": 2.0}]) == 2
    assert distinct([[float("nan")], [float("nan")], [0.1]]) == 2
    assert nothing_random(40) == "40 seeds, nothing random: add [random], or seeds = 1"


def test_differences_that_are_all_equal_have_an_interval_of_no_width() -> None:
    found = mean([-0.5] * 20, rng())
    assert (found.value, found.low, found.high) == (-0.5, -0.5, -0.5)


# Quantiles


@pytest.mark.parametrize(("runs", "share"), [(20, 0.5), (60, 0.1), (200, 0.05), (59, 0.05)])
def test_the_order_statistics_of_a_quantile_are_those_of_the_binomial(runs: int, share: float) -> None:
    """The k-th smallest lies above the quantile with probability P(B < k), the m-th below with P(B >= m)."""
    found = quantile(np.arange(1, runs + 1), share)
    below = [k for k in range(1, runs + 1) if binom.cdf(k - 1, runs, share) <= 0.025]
    above = [k for k in range(1, runs + 1) if binom.sf(k - 1, runs, share) <= 0.025]
    assert found.low == (max(below) if below else -np.inf)
    assert found.high == (min(above) if above else np.inf)
    # between two order statistics half-way, else the next one: 59 times 0.05 is 2.95
    assert found.value == (runs * share + 0.5 if runs != 59 else 3.0)


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_the_interval_of_a_quantile_covers_it_whatever_the_distribution(share: float) -> None:
    runs, trials = 80, 500
    # cubed and rounded: skew, and with ties
    truth = np.round(np.quantile(np.arange(1e6) / 1e6, share) ** 3, 2)
    missed = 0
    for values in np.round(rng().random((trials, runs)) ** 3, 2):
        found = quantile(values, share)
        missed += not found.low <= truth <= found.high
    assert missed / trials <= no_more_than(0.05, trials)


def test_a_quantile_of_something_missing_is_refused() -> None:
    with pytest.raises(ValueError, match="1 of 3 values are nan"):
        quantile([1.0, np.nan, 2.0], 0.5)
    with pytest.raises(ValueError, match="between 0 and 1"):
        quantile([1.0, 2.0], 5.0)
    assert quantile([1.0, 2.0, np.inf], 0.5).value == 2.0  # one vehicle alone keeps an infinite distance


# Pairs


def test_mcnemars_exact_test_is_the_binomial_one_on_discordant_seeds() -> None:
    first = np.repeat([True, False, True, False], [1, 9, 30, 60])
    second = np.repeat([False, True, True, False], [1, 9, 30, 60])
    found = paired_verdicts(first, second)
    assert (found.only_first, found.only_second, found.both) == (1, 9, 30)
    assert found.p_value == pytest.approx(2 * binom.cdf(1, 10, 0.5))
    assert found.difference == pytest.approx(0.08)
    assert paired_verdicts(first, second, "greater").p_value == pytest.approx(binom.sf(8, 10, 0.5))
    assert paired_verdicts(first, second, "less").p_value == pytest.approx(binom.cdf(9, 10, 0.5))


def test_the_paired_test_of_verdicts_rejects_identical_systems_no_more_often_than_it_says() -> None:
    """Two systems alike in law, their verdicts correlated over the seeds: every p-value by the counts."""
    draw = rng()
    hard = draw.random((TRIALS, 100)) < 0.3  # seeds on which either may fail
    first, second = (hard & (draw.random((TRIALS, 100)) < 0.5) for _ in range(2))
    counts = np.stack([(first & ~second).sum(axis=1), (second & ~first).sum(axis=1)], axis=1)
    kinds, where = np.unique(counts, axis=0, return_inverse=True)

    def p_value(a: int, b: int) -> float:
        return paired_verdicts([True] * a + [False] * b, [False] * a + [True] * b).p_value

    p = np.array([p_value(a, b) for a, b in kinds])[where.ravel()]
    for level in (0.01, 0.05, 0.2):
        assert (p <= level).mean() <= no_more_than(level, TRIALS)
    assert (p <= 0.05).mean() > 0.01  # and it does reject


def test_systems_that_never_differ_are_never_told_apart() -> None:
    same = rng().random(40) < 0.5
    assert paired_verdicts(same, same).p_value == 1.0
    values = rng().random(40)
    found = paired_distances(values, values, rng())
    assert (found.p_value, found.changed, found.median) == (1.0, 0, 0.0)
    assert (found.mean.low, found.mean.high) == (0.0, 0.0)
    rounded = paired_distances(values, values + 1e-12, rng(), resolution=1e-9)
    assert (rounded.p_value, rounded.changed, rounded.mean.value) == (1.0, 0, 0.0)


@pytest.mark.parametrize(
    ("runs", "decimals"),
    [
        pytest.param(10, 9, id="few"),
        pytest.param(10, 0, id="few, with ties and zeros"),
        pytest.param(40, 9, id="exact"),
        pytest.param(40, 1, id="ties"),
        pytest.param(80, 9, id="normal"),
    ],
)
def test_the_paired_test_of_distances_has_its_size_on_identical_systems(runs: int, decimals: int) -> None:
    from testbed.statistics import paired

    draw = rng()
    trials = 60 if (runs, decimals) == (10, 0) else 600  # signs permuted 1024 times each: slow
    seeds = draw.normal(6.0, 1.0, (trials, runs))
    first, second = (np.round(seeds + draw.normal(0.0, 0.7, seeds.shape), decimals) for _ in range(2))
    # The bootstrap is tested above, and is what takes long here.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paired, "mean", lambda *a: None)
        p = np.array([paired_distances(a, b, draw).p_value for a, b in zip(first, second, strict=True)])
    for level in (0.05, 0.2):
        assert (p <= level).mean() <= no_more_than(level, trials)
    assert (p <= 0.2).mean() > 0.02


def test_a_shift_shows_in_every_number_of_the_paired_distances() -> None:
    first = rng().normal(6.0, 1.0, 30)
    second = first - 0.3 + np.random.default_rng(1).normal(0.0, 0.1, 30)
    found = paired_distances(first, second, rng(), "less")
    # 30 differences all below zero: every sign pattern is as likely, one of 2^30 is this extreme
    assert found.p_value == pytest.approx(2.0**-30)
    assert found.mean.low < -0.3 < found.mean.high < 0.0
    assert found.median == pytest.approx(-0.3, abs=0.05)
    assert paired_distances(first, second, rng(), "greater").p_value > 0.99


def test_all_differences_equal_are_a_change_all_the_same() -> None:
    found = paired_distances(np.zeros(12), np.full(12, -0.5), rng())
    assert found.p_value == pytest.approx(2 * 2.0**-12)
    assert (found.mean.low, found.mean.high, found.changed) == (-0.5, -0.5, 12)


def test_pairs_that_do_not_pair_are_refused() -> None:
    with pytest.raises(ValueError, match="one each per seed"):
        paired_verdicts([True], [True, False])
    with pytest.raises(ValueError, match="1 of 2 differences are nan"):
        paired_distances([1.0, 2.0], [1.0, np.nan], rng())


# Sequential plans

PLANS = [
    Plan(looks, target, alpha, spending)
    for (looks, target, alpha), spending in itertools.product(
        [((50, 100, 200, 400), 0.05, 0.05), (spread(20, 500, 8), 0.1, 0.1), ((300,), 0.5, 0.01)],
        ("equal", "obrien-fleming"),
    )
]


@cache
def bounds(plan: Plan) -> np.ndarray:
    return np.array(plan.bounds())


def ends(plan: Plan, true: float, trials: int) -> tuple[np.ndarray, np.ndarray]:
    """`trials` campaigns of known rate: the number of the look that ended each, and its events."""
    sizes = np.diff(plan.looks, prepend=0)
    events = np.cumsum([rng().spawn(k + 1)[k].binomial(n, true, trials) for k, n in enumerate(sizes)], axis=0)
    final = (events <= bounds(plan)[:, :1]) | (events >= bounds(plan)[:, 1:])
    final[-1] = True
    number = np.argmax(final, axis=0)
    return number + 1, events[number, np.arange(trials)]


@pytest.mark.parametrize("plan", PLANS, ids=str)
def test_the_shares_of_the_error_add_up_to_it(plan: Plan) -> None:
    assert sum(plan.shares) == pytest.approx(plan.alpha)
    assert min(plan.shares) >= 0.0
    if plan.spending == "obrien-fleming":
        assert list(plan.shares) == sorted(plan.shares)


@pytest.mark.parametrize("plan", PLANS, ids=str)
@pytest.mark.parametrize("factor", [0.5, 1.0, 1.5])
def test_a_whole_campaign_with_looks_errs_no_more_than_it_says(plan: Plan, factor: float) -> None:
    """At rates below, at and above the target: wrong decisions, and intervals that miss the rate."""
    true = factor * plan.target
    number, events = ends(plan, true, TRIALS)
    runs, each = np.array(plan.looks)[number - 1], np.array(plan.shares)[number - 1]
    # Clopper and Pearson's interval leaves the rate out where the tail beyond the events is rarer than half
    outside = np.minimum(binom.cdf(events, runs, true), binom.sf(events - 1, runs, true)) < each / 2
    below, above = bounds(plan)[number - 1].T
    wrong = ((events <= below) & (true >= plan.target)) | ((events >= above) & (true <= plan.target))
    assert (outside | wrong).mean() <= no_more_than(plan.alpha, TRIALS)


def test_looking_without_splitting_the_error_would_err_more_often() -> None:
    """What the plan is for: 5 % at each of fifteen looks misses the target several times as often."""
    looks = spread(20, 1000, 15)
    honest = Plan(looks, 0.3, 0.05)
    greedy = Plan(looks, 0.3, 0.05 * len(looks) * 0.999)  # each look then has nearly 5 % of its own
    decided = {}
    for name, plan in (("honest", honest), ("greedy", greedy)):
        number, events = ends(plan, 0.3, TRIALS)
        below, above = bounds(plan)[number - 1].T
        decided[name] = ((events <= below) | (events >= above)).mean()
    assert decided["honest"] <= no_more_than(0.05, TRIALS)
    assert decided["greedy"] > 0.15


def test_a_look_decides_once_the_interval_leaves_the_target() -> None:
    plan = Plan((50, 100, 200), 0.1)
    # 0 of 50: high = 1 - (0.05 / 3 / 2)^(1/50) = 9.1 %
    assert plan.look(1, 0).decision is Decision.BELOW
    assert plan.look(1, 20).decision is Decision.ABOVE
    assert [plan.look(k, 5 * 2 ** (k - 1)).decision for k in (1, 2, 3)] == [
        Decision.GO_ON,
        Decision.GO_ON,
        Decision.UNDECIDED,
    ]


def test_the_bounds_are_where_the_decision_turns() -> None:
    plan = Plan((30, 90), 0.2, spending="obrien-fleming")
    for number, (below, above) in enumerate(plan.bounds(), 1):
        for events in range(plan.looks[number - 1] + 1):
            decided = plan.look(number, events).decision
            assert (decided is Decision.BELOW) == (events <= below)
            assert (decided is Decision.ABOVE) == (events >= above)


@pytest.mark.parametrize(
    ("looks", "target", "alpha"),
    [((), 0.1, 0.05), ((100, 50), 0.1, 0.05), ((0, 10), 0.1, 0.05), ((10,), 0.0, 0.05), ((10,), 0.1, 1.0)],
)
def test_a_plan_that_cannot_be_followed_is_refused(
    looks: tuple[int, ...], target: float, alpha: float
) -> None:
    with pytest.raises(ValueError, match="give"):
        Plan(looks, target, alpha)


@pytest.mark.parametrize(
    "values", [[0.0, 1.0, 5.0, 5.5, 9.0], [1e-3, 2e-3, 9e-3], list(np.arange(20.0) ** 3)]
)
def test_an_interval_of_a_mean_is_the_wider_of_bootstrap_and_student(
    values: list[float],
) -> None:
    """Recomputed resample by resample: 2,000, of which 1 % is left out at either end."""
    found, draws = mean([*values, np.nan, np.inf], rng()), rng()
    data, n = np.array(values), len(values)
    error = data.std(ddof=1) / n**0.5
    t = float(student.isf(0.01, n - 1))
    ratios = []
    for drawn in data[draws.integers(0, n, (2000, n))]:
        if np.ptp(drawn) > 0.0:
            ratios.append((drawn.mean() - data.mean()) / (drawn.std(ddof=1) / n**0.5))
    low, high = np.quantile(ratios, [0.01, 0.99])
    assert found.low == pytest.approx(data.mean() - max(t, high) * error, rel=1e-9)
    assert found.high == pytest.approx(data.mean() - min(-t, low) * error, rel=1e-9)
    assert (found.value, found.runs) == (pytest.approx(data.mean()), n)


def test_no_value_one_value_and_equal_values_have_no_interval_of_finite_width() -> None:
    none, one, same = mean([np.nan], rng()), mean([2.0], rng()), mean([3, 3, 3], rng())
    assert np.isnan([none.value, none.low, none.high]).all() and (none.runs, none.method) == (
        0,
        means.METHOD_ONE,
    )
    assert (one.low, one.value, one.high, one.runs) == (-np.inf, 2.0, np.inf, 1)
    assert (same.low, same.value, same.high, same.runs, same.method) == (3.0, 3.0, 3.0, 3, means.METHOD_EQUAL)
    assert str(mean([1.0, 1.0], rng())) == "+1.00 [+1.00, +1.00]"
    assert mean(["1", "2"], rng()).value == 1.5


def test_ten_different_values_are_enough_for_the_coverage_that_is_claimed() -> None:
    """Nine beside the most frequent one."""
    assert mean([0.0, 0.0, *range(1, 10)], rng()).method == means.METHOD
    assert mean([0.0, 0.0, *range(1, 9)], rng()).method == means.METHOD_FEW
    assert (means.METHOD, means.METHOD_FEW, means.METHOD_EQUAL, means.METHOD_ONE) == (
        "union of studentised bootstrap and Student's t at 98 %; measured to cover 94 % or more",
        "union of studentised bootstrap and Student's t at 98 %; fewer than 10 different values: covers less",
        "none: all values are equal",
        "none: fewer than 2 values",
    )
