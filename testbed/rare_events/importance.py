"""Importance sampling: starts drawn where the event is, each weighted by its likelihood ratio.

The proposal is a mixture of normal distributions, stated by the user or adapted by cross-entropy, and of the
starts' own distribution, with a share of `OWN`: so no weight is above 1 / OWN.
Source  Rubinstein & Kroese 2004, The Cross-Entropy Method, ch. 2; mixtures: Kurtz & Song 2013, Structural
        Safety 42; starts found by Markov chains: Au & Beck 1999, Structural Safety 21(2); defensive mixtures:
        Hesterberg 1995, Technometrics 37(2).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi

import numpy as np

from filters.model import Array
from testbed.rare_events import subset
from testbed.rare_events.estimate import Estimate, LimitState

# The share of runs drawn from the starts' own distribution.
OWN = 0.1
# Subset simulations of an adaptation.
SEARCHES = 4
# The share of an adapted proposal that is drawn from its widened parts.
WIDE = 0.4
# Effective events below which an interval is not to be trusted.
_FEW = 30


@dataclass(frozen=True)
class Proposal:
    """A mixture of K normal distributions of d numbers, beside the starts' own.

    shares  (K,);  means  (K, d);  covariances  (K, d, d)
    """

    shares: Array
    means: Array
    covariances: Array

    @classmethod
    def stated(cls, mean: Array, spread: float | Array = 1.0) -> Proposal:
        """One normal distribution about `mean` (d,) with deviations `spread`."""
        mean = np.asarray(mean, dtype=float)
        deviation = np.broadcast_to(np.asarray(spread, dtype=float), mean.shape)
        return cls(np.ones(1), mean[None], np.diag(deviation**2)[None])

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """(n, d)"""
        kind = rng.choice(len(self.shares) + 1, n, p=[OWN, *((1.0 - OWN) * self.shares)])
        z = rng.standard_normal((n, self.means.shape[1]))
        for k, root in enumerate(np.linalg.cholesky(self.covariances), 1):
            of = kind == k
            z[of] = self.means[k - 1] + z[of] @ root.T
        return np.asarray(z)

    def weights(self, z: Array) -> Array:
        """(n,) likelihood ratios of the starts' own distribution and this one."""
        own = log_normal(z, np.zeros(z.shape[1]), np.eye(z.shape[1]))
        each = [own + log(OWN)]
        for share, mean, cov in zip(self.shares, self.means, self.covariances, strict=True):
            each.append(log_normal(z, mean, cov) + log((1.0 - OWN) * max(share, 1e-300)))
        return np.asarray(np.exp(own - np.logaddexp.reduce(each, axis=0)))


def log_normal(z: Array, mean: Array, covariance: Array) -> Array:
    """(n,) log density of a normal distribution at z (n, d)."""
    root = np.linalg.cholesky(covariance)
    scaled = np.linalg.solve(root, (z - mean).T)
    constant = 0.5 * len(mean) * log(2.0 * pi) + float(np.log(np.diag(root)).sum())
    return np.asarray(-0.5 * (scaled**2).sum(axis=0) - constant)


def estimate(
    state: LimitState,
    size: int,
    rng: np.random.Generator,
    runs: int = 2000,
    adapting: int = 150,
    proposal: Proposal | None = None,
    modes: int = 2,
    confidence: float = 0.95,
) -> Estimate:
    """P(state(z) < 0) of `size` standard normal numbers.

    runs      drawn from the final proposal, 100 or more
    adapting  runs of each level of each search of the adaptation, 100 or more
    proposal  the user's own; None: adapted by cross-entropy
    modes     normal distributions of the adapted proposal
    """
    if runs < 100 or adapting < 100:
        raise ValueError(f"{runs} runs, {adapting} on a level of the adaptation: give 100, or more")
    spent, how = 0, "stated"
    levels: list[float] = []
    known = None
    if proposal is None:
        proposal, path = adapted(state, size, rng, adapting, modes)
        spent, how = sum(r.runs for r in path), "fitted by cross-entropy to the events of subset simulations"
        levels = [level.value for level in path[0].levels]
        known = proposal.weights(path[-1].below)
    z = proposal.draw(runs, rng)
    found = weighed(np.asarray(state(z)), proposal.weights(z), confidence, known)
    method = f"importance sampling, proposal {how}; interval of Student's t on the logarithm"
    doubts = list(found.doubts)
    if levels and levels[-1] > 0.0:
        doubts.append("the adaptation did not reach the event")
    detail = found.detail | {
        "levels": levels,
        "shares": proposal.shares.tolist(),
        "means": proposal.means.tolist(),
        "deviations": [np.sqrt(np.diag(c)).tolist() for c in proposal.covariances],
    }
    return Estimate(
        found.probability,
        found.low,
        found.high,
        spent + runs,
        found.error,
        confidence,
        method,
        tuple(doubts),
        detail,
    )


def weighed(values: Array, weights: Array, confidence: float = 0.95, known: Array | None = None) -> Estimate:
    """The estimate from runs of a proposal: limit states (n,) and likelihood ratios (n,).

    known  likelihood ratios of events that were not drawn from the proposal but are distributed as events
           are. Their mean times the probability is the second moment of a run; where it is larger than what
           the runs show, the proposal has missed something, and the interval is made as wide as it says
    """
    from scipy.stats import t as student

    n = len(values)
    events = np.where(values < 0.0, weights, 0.0)  # nan is no event
    hits, probability = int((values < 0.0).sum()), float(events.mean())
    doubts = []
    if missing := int(np.isnan(values).sum()):
        doubts.append(f"{missing} runs have no value and count as no event")
    if not hits:
        # No weight is above 1 / OWN, so that so much may have been missed: (1 - x OWN)^n = alpha.
        high = (1.0 - (1.0 - confidence) ** (1.0 / n)) / OWN
        doubts.append("no run had the event")
        return Estimate(0.0, 0.0, min(1.0, high), n, np.nan, confidence, "", tuple(doubts), {"events": 0})
    effective = float(events.sum() ** 2 / (events**2).sum())
    relative = float(events.std(ddof=1) / np.sqrt(n) / probability)
    largest = float(events.max() / events.sum())
    expected = relative
    if known is not None and len(known):
        expected = float(np.sqrt(max(0.0, known.mean() / probability - 1.0) / n))
        if expected > 2.0 * relative:
            doubts.append(
                f"by events found before, the standard error is {100 * expected:.0f} %, not the"
                f" {100 * relative:.0f} % that the runs show: the proposal misses some; use subsets"
            )
        relative = max(relative, expected)
    if effective < _FEW:
        doubts.append(f"the {hits} events weigh as much as {effective:.0f} equal ones; give more runs")
    missed = float(events[weights > 1.0].sum() / events.sum())
    if missed > 0.1:
        doubts.append(
            f"{100 * missed:.0f} % of the probability is of events that the proposal draws less often than"
            " plain sampling would: it may miss a part of them; give more modes or runs, or use subsets"
        )
    wide = float(student.isf(0.5 * (1.0 - confidence), max(1.0, effective - 1.0))) * relative
    detail = {
        "events": hits,
        "effective_events": effective,
        "largest_share": largest,
        "expected_error": expected,
        "outside": missed,
    }
    return Estimate(
        probability,
        float(probability * np.exp(-wide)),
        float(min(1.0, probability * np.exp(wide))),
        n,
        relative,
        confidence,
        "",
        tuple(doubts),
        detail,
    )


def adapted(
    state: LimitState, size: int, rng: np.random.Generator, runs: int, modes: int
) -> tuple[Proposal, list[subset.Repetition]]:
    """The proposal nearest in cross-entropy to the starts that have the event, and how these were found.

    `SEARCHES` subset simulations with `runs` runs a level lead to starts that have the event, distributed as
    they are among all. The mixture of largest likelihood of these is the one of least cross-entropy. Those
    of the last simulation have no part in it, so that they tell what it misses.
    """
    found = subset.repeated(state, size, rng.spawn(SEARCHES), runs)
    some = [r for r in found[:-1] if len(r.below)]
    if not some:
        return Proposal.stated(np.zeros(size)), found
    weights = np.concatenate([np.full(len(r.below), r.probability / len(r.below)) for r in some])
    return widened(fitted(np.concatenate([r.below for r in some]), weights, modes, rng)), found


def widened(fit: Proposal) -> Proposal:
    """The mixture, each part once a little wider and, with a share of `WIDE`, about as wide as starts are.

    Without this, a few events on the flanks of a part that is too narrow would weigh more than all others.
    """
    unit = np.eye(fit.means.shape[1])
    return Proposal(
        np.concatenate([(1.0 - WIDE) * fit.shares, WIDE * fit.shares]),
        np.concatenate([fit.means, fit.means]),
        np.concatenate([1.2 * fit.covariances, fit.covariances + 0.5 * unit]),
    )


def fitted(z: Array, weights: Array, modes: int, rng: np.random.Generator, rounds: int = 20) -> Proposal:
    """The mixture of `modes` normal distributions of largest weighted likelihood of z (n, d), by EM.

    Covariances are drawn a little towards that of all, so that a few runs do not make one flat.
    """
    n, d = z.shape
    weights = weights / weights.sum()
    whole = _covariance(z, weights, weights @ z)
    # As far apart as weighted draws make them (k-means++).
    means = z[[int(rng.choice(n, p=weights))]]
    for _ in range(1, modes):
        away = ((z[:, None] - means[None]) ** 2).sum(axis=-1).min(axis=1) * weights
        if not away.sum() > 0.0:
            break
        means = np.vstack([means, z[int(rng.choice(n, p=away / away.sum()))]])
    k = len(means)
    shares, covariances = np.full(k, 1.0 / k), np.repeat(whole[None], k, axis=0)
    for _ in range(rounds):
        parts = zip(shares, means, covariances, strict=True)
        logs = np.stack([np.log(share) + log_normal(z, mean, cov) for share, mean, cov in parts])
        belongs = np.exp(logs - np.logaddexp.reduce(logs, axis=0)) * weights
        shares = np.maximum(belongs.sum(axis=1), 1e-3)
        shares = shares / shares.sum()
        means = belongs @ z / np.maximum(belongs.sum(axis=1), 1e-12)[:, None]
        for m in range(k):
            of = belongs[m] / max(float(belongs[m].sum()), 1e-12)
            count = 1.0 / max(float((of**2).sum()), 1e-12)
            trust = count / (count + d + 1.0)
            covariances[m] = trust * _covariance(z, of, means[m]) + (1.0 - trust) * whole
    return Proposal(shares, means, covariances)


def _covariance(z: Array, weights: Array, mean: Array) -> Array:
    away = z - mean
    return np.asarray((away * weights[:, None]).T @ away + 1e-4 * np.eye(z.shape[1]))
