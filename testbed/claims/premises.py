"""The premises the paper's theorems rest on: whether a run met them."""

from __future__ import annotations

import numpy as np

from filters.barriers.closed_form import Barrier, TurnBarrier
from filters.model import Command, Limits
from testbed.claims.guarantees import QP_FILTERS, Flown
from testbed.claims.verdict import Entry, at_pair, decide_premise, entry


def premises(f: Flown, barrier: Barrier, limits: Limits, unflyable: list[str]) -> list[Entry]:
    """P1 to P6.

    unflyable  why vehicles cannot fly gamma here, one sentence each; empty if all can
    """
    return [
        _start(f),
        _shared(f),
        _inside(f, barrier, limits),
        _flyable(f, unflyable),
        _gradient(f),
        _kink(f, barrier),
    ]


def _start(f: Flown) -> Entry:
    e = entry("start-safe", "P1", "the start is in the safe set", "Theorem 1", "h >= 0 at t = 0", "")
    return decide_premise(e, f.started_safe, "" if f.started_safe else "h < 0 at the start")


def _shared(f: Flown) -> Entry:
    e = entry("shared-manoeuvre", "P2", "all barriers share one manoeuvre", "Assumption 1", "", "")
    shared = f.scenario.barrier.shared
    return decide_premise(e, shared, "" if shared else "each pair has its own")


def _inside(f: Flown, barrier: Barrier, limits: Limits) -> Entry:
    e = entry("manoeuvre-in-U", "P3", "gamma lies in the input set", "Theorem 2", "distance inside U", "")
    gamma = _gamma(barrier, f.scenario.vehicles)
    if gamma is None:
        return decide_premise(e, False, "there is no one manoeuvre")
    c, low, high = gamma.array(), limits.lower.array(), limits.upper.array()
    span = np.where(high > low, high - low, 1.0)
    margin = (np.minimum(c - low, high - c) / span).min(axis=-1)
    worst = int(np.argmin(margin))
    e.update(value=float(margin[worst]), bound=0.0, margin=float(margin[worst]), vehicles=[worst + 1])
    return decide_premise(
        e, bool(margin[worst] >= 0.0), "gamma exceeds the limits" if margin[worst] < 0 else ""
    )


def _flyable(f: Flown, unflyable: list[str]) -> Entry:
    e = entry("manoeuvre-flyable", "P4", "the vehicles can fly gamma for ever", "Theorem 2", "", "")
    if not f.scenario.barrier.shared:
        return decide_premise(e, False, "there is no one manoeuvre")
    return decide_premise(e, not unflyable, "; ".join(unflyable))


def _gradient(f: Flown) -> Entry:
    e = entry(
        "gradient", "P5", "L_g h is not zero at the boundary", "Theorem 2, Proposition 1", "least |L_g h|", ""
    )
    if np.isnan(at_pair(e, f.statistics.gradient, f.i, f.j, 0.0)):
        return e | {"why": "no pair came to the boundary"}
    return decide_premise(e, e["value"] > 1e-9)


def _kink(f: Flown, barrier: Barrier) -> Entry:
    e = entry(
        "off-the-kink",
        "P6",
        "h is differentiable where it binds",
        "Theorem 2, Appendix",
        "filter steps' motion to the kink, least",
        "",
    )
    if not isinstance(barrier, TurnBarrier) or f.scenario.filter.kind not in QP_FILTERS:
        return e | {"why": "no kink, or nothing binds"}
    if barrier.smoothing > 0:
        return decide_premise(e, True, "smoothed")
    if np.isnan(at_pair(e, f.statistics.kink, f.i, f.j, 1.0)):
        return e | {"why": "no row ever bound"}
    holds = e["value"] >= 1.0
    return decide_premise(e, holds, "" if holds else "one filter step can cross it")


def _gamma(barrier: Barrier, n: int) -> Command | None:
    try:
        return barrier.manoeuvre(n)
    except (AttributeError, ValueError):
        return None
