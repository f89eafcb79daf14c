"""When a change is a degradation: when it is significant among all that is compared, and large enough.

Significance is an exact test of "the runs now and the recorded ones are exchangeable", with Holm's correction
over every quantity of every rung; no distribution is assumed. On the recorded seeds the runs are pairs and
the test is Wilcoxon's; on fresh seeds they are two samples and it is Mann and Whitney's. Verdicts take the
exact tests of McNemar and of Fisher. Large enough is more than a block's mean varies from block to block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from testbed.regression.quantities import Quantity
from testbed.statistics import paired_distances, paired_verdicts

Array = NDArray[np.float64]

# Chance of any false alarm in one check of an unchanged project. On fresh seeds it is met again at every
# check, so it is small; on recorded seeds equal code repeats the recorded numbers, and it bounds what a
# machine could do whose rounding makes every run another draw.
ALPHA_FRESH = 0.001
ALPHA_RECORDED = 0.01


def tolerance(q: Quantity, values: ArrayLike, seeds: int) -> float:
    """Standard deviation of the mean of a block of `seeds` runs, from the spread of all `values` (N,).

    Seeds are independent, so all N runs tell it better than the few blocks' means. Never below the quantity's
    resolution; nan where fewer than two runs have a value.
    """
    if q.verdict:
        return 0.0
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    if known.size < 2:
        return float("nan")
    return max(q.resolution, float(known.std(ddof=1)) / seeds**0.5)


@dataclass(frozen=True)
class Change:
    """A quantity now against recorded, both means over runs that have a value.

    worse           by how much the mean is worse, in the quantity's unit; inf where runs lack it that had it
    seeds_worse     of how many paired runs the value is worse; None on fresh seeds
    p_worse         chance of as much evidence of a degradation if nothing changed; before any correction
    p_better        the same of an improvement
    """

    recorded: float
    now: float
    worse: float
    seeds_worse: int | None
    p_worse: float
    p_better: float


def compare(q: Quantity, recorded: ArrayLike, now: ArrayLike, paired: bool) -> Change:
    """`now` (n,) against `recorded`, (n,) of the same seeds if `paired`, else (N,). nan is a missing value.

    A value that is missing is worse than any: a run that ended early is never a pass.
    """
    was, is_ = (np.asarray(v, dtype=float) for v in (recorded, now))
    # From here on larger is worse; two missing values are equal.
    a, b = (np.where(np.isnan(v), np.inf, q.worse * v) for v in (was, is_))
    if paired:
        both = np.isinf(a) & np.isinf(b)
        a, b = np.where(both, 0.0, a), np.where(both, 0.0, b)
    test = _paired if paired else _apart
    lacking = np.isnan(is_).mean() > np.isnan(was).mean()
    means = [float(np.nanmean(v)) if np.isfinite(v).any() else float("nan") for v in (was, is_)]
    # A mean over pairs that both have a value; over all where runs are no pairs.
    common = ~(np.isnan(was) | np.isnan(is_)) if paired else None
    if common is not None and common.any():
        worse = float(np.mean(q.worse * (is_ - was)[common]))
    else:
        worse = q.worse * (means[1] - means[0]) if np.isfinite(means).all() else 0.0
    return Change(
        recorded=means[0],
        now=means[1],
        worse=float("inf") if lacking else worse,
        seeds_worse=int(np.sum(b - a > q.resolution / 10)) if paired else None,
        p_worse=test(q, a, b),
        p_better=test(q, b, a),
    )


def _paired(q: Quantity, a: Array, b: Array) -> float:
    if q.verdict:
        return paired_verdicts(a > 0, b > 0, "greater").p_value
    rng = np.random.default_rng(0)  # of an interval that is not used
    return paired_distances(a, b, rng, "greater", resolution=q.resolution / 10).p_value


def _apart(q: Quantity, a: Array, b: Array) -> float:
    from scipy.stats import fisher_exact, mannwhitneyu

    if q.verdict:
        lost = [[int((v > 0).sum()), int((v <= 0).sum())] for v in (b, a)]
        return float(fisher_exact(lost, alternative="greater").pvalue)
    # Ties are broken against the finding: exact at every number of them, where the normal formula is not.
    values, new = np.concatenate([a, b]), np.repeat([0, 1], [a.size, b.size])
    rank = np.empty(values.size)
    rank[np.lexsort((1 - new, values))] = np.arange(values.size)
    found = mannwhitneyu(rank[new == 1], rank[new == 0], alternative="greater", method="exact")
    return float(found.pvalue)


def holm(p: ArrayLike) -> Array:
    """Holm's (1979) adjusted p-values of p (K,): those <= alpha contain a false one at rate alpha at most."""
    given = np.asarray(p, dtype=float)
    order = np.argsort(given, kind="stable")
    stepped = np.maximum.accumulate(given[order] * np.arange(given.size, 0, -1))
    adjusted = np.empty_like(given)
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def seeds_needed(comparisons: int, alpha: float = ALPHA_RECORDED) -> int:
    """Seeds in a block below which not even a quantity that is worse on every seed is significant."""
    return int(np.ceil(np.log2(comparisons / alpha)))
