"""Statistics of many runs: rates, means, quantiles, paired comparisons and sequential stopping."""

from testbed.statistics.distinct import distinct, nothing_random
from testbed.statistics.means import Mean, mean
from testbed.statistics.paired import PairedDistances, PairedVerdicts, paired_distances, paired_verdicts
from testbed.statistics.quantiles import Quantile, quantile
from testbed.statistics.rates import Rate, rate, rate_of, zero_event_bound
from testbed.statistics.risk_ratio import RiskRatio, risk_ratio
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
    "RiskRatio",
    "distinct",
    "mean",
    "nothing_random",
    "paired_distances",
    "paired_verdicts",
    "quantile",
    "rate",
    "rate_of",
    "risk_ratio",
    "spread",
    "zero_event_bound",
]
