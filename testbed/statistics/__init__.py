"""Honest numbers about many runs: rates, quantiles, pairs, sequential stopping. The formulas are scipy's."""

from testbed.statistics.paired import PairedDistances, PairedVerdicts, paired_distances, paired_verdicts
from testbed.statistics.quantiles import Quantile, quantile
from testbed.statistics.rates import Mean, Rate, mean, rate, rate_of, zero_event_bound
from testbed.statistics.sequential import Decision, Look, Plan, spread

__all__ = [
    "Decision",
    "Look",
    "Mean",
    "PairedDistances",
    "PairedVerdicts",
    "Plan",
    "Quantile",
    "Rate",
    "mean",
    "paired_distances",
    "paired_verdicts",
    "quantile",
    "rate",
    "rate_of",
    "spread",
    "zero_event_bound",
]
