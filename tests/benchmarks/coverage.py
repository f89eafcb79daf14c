"""Measures how often intervals of a mean cover the true one, on symmetric and skewed data.

    cd tests && python -m benchmarks.coverage       # some minutes; prints a table

Intervals of 95 %: the percentile bootstrap, BCa (both scipy's) and `testbed.statistics.mean`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from scipy.stats import bootstrap

from testbed.statistics import mean

# name -> (draws n values, the true mean)
DISTRIBUTIONS: dict[str, tuple[Callable[[np.random.Generator, int], np.ndarray], float]] = {
    "normal": (lambda rng, n: rng.normal(size=n), 0.0),
    "exponential": (lambda rng, n: rng.exponential(size=n), 1.0),
    "lognormal": (lambda rng, n: rng.lognormal(size=n), float(np.exp(0.5))),
    "gamma(0.5)": (lambda rng, n: rng.gamma(0.5, size=n), 0.5),
    "half zeros": (lambda rng, n: rng.exponential(size=n) * (rng.random(n) < 0.5), 0.5),
}
SIZES = (10, 20, 50)
TRIALS = 4000


def measured(distribution: str, n: int, trials: int, seed: int, others: bool = False) -> dict[str, float]:
    """Share of `trials` samples of `n` whose interval covers the true mean, by method.

    others  scipy's bootstraps too, which take longer
    """
    draw, truth = DISTRIBUTIONS[distribution]
    rng = np.random.default_rng(seed)
    covered = dict.fromkeys(["ours", *(("percentile", "BCa") if others else ())], 0)
    for _ in range(trials):
        values = draw(rng, n)
        found = mean(values, rng)
        covered["ours"] += found.low <= truth <= found.high
        if others and np.ptp(values):
            for method in ("percentile", "BCa"):
                interval = bootstrap(
                    (values,), np.mean, n_resamples=2000, method=method, rng=rng
                ).confidence_interval
                covered[method] += interval.low <= truth <= interval.high
    return {method: count / trials for method, count in covered.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=TRIALS)
    asked = parser.parse_args()
    print("| distribution | runs | percentile bootstrap | BCa bootstrap | here |\n|---|---|---|---|---|")
    for distribution in DISTRIBUTIONS:
        for n in SIZES:
            share = measured(distribution, n, asked.trials, seed=1, others=True)
            shown = " | ".join(f"{100 * share[m]:.1f} %" for m in ("percentile", "BCa", "ours"))
            print(f"| {distribution} | {n} | {shown} |", flush=True)


if __name__ == "__main__":
    main()
