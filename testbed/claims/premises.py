"""Judges the premises of the paper's theorems, P1 to P6: whether a run met them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filters.barriers.closed_form import TurnBarrier
from filters.barriers.pairs import Barrier
from filters.model import Limits
from testbed.claims import registry
from testbed.claims.guarantees import QP_FILTERS, Flown
from testbed.claims.judging import at_pair, decide_premise
from testbed.records.verdict import Verdict

# |L_g h| that counts as zero.
LEAST_GRADIENT = 1e-9


def premises(f: Flown, barrier: Barrier, limits: Limits, unflyable: list[str]) -> list[Verdict]:
    """P1 to P6, in the order of the registry.

    unflyable  why vehicles cannot fly gamma here, one sentence each; empty if all can
    """
    return [
        _start(f, f.unjudged(registry.START_SAFE)),
        _shared(f, f.unjudged(registry.SHARED_MANOEUVRE)),
        _inside(f, barrier, limits, f.unjudged(registry.MANOEUVRE_IN_U)),
        _flyable(f, unflyable, f.unjudged(registry.MANOEUVRE_FLYABLE)),
        _gradient(f, f.unjudged(registry.GRADIENT)),
        _kink(f, barrier, f.unjudged(registry.OFF_THE_KINK)),
    ]


def _start(f: Flown, v: Verdict) -> Verdict:
    safe = f.started_safe and f.started_in_fences
    return decide_premise(v, safe, "" if safe else "h < 0 at the start")


def _shared(f: Flown, v: Verdict) -> Verdict:
    shared = f.scenario.barrier.shared
    if shared and f.roles is not None:
        return decide_premise(v, False, strangers(f.roles.intruders))
    return decide_premise(v, shared, "" if shared else "each pair has its own")


def strangers(vehicles: Sequence[int]) -> str:
    """Who does not fly the manoeuvre, `vehicles` from 0."""
    *first, last = [str(k + 1) for k in vehicles]
    if not first:
        return f"vehicle {last} is an intruder"
    return f"vehicles {', '.join(first)} and {last} are intruders"


def _inside(f: Flown, barrier: Barrier, limits: Limits, v: Verdict) -> Verdict:
    gamma = barrier.manoeuvre(f.scenario.vehicles)
    if gamma is None:
        return decide_premise(v, False, "there is no one manoeuvre")
    c, low, high = gamma.array(), limits.lower.array(), limits.upper.array()
    span = np.where(high > low, high - low, 1.0)
    margin = (np.minimum(c - low, high - c) / span).min(axis=-1)
    if f.under is not None:
        margin = np.where(f.under, margin, np.inf)
    worst = int(np.argmin(margin))
    least = float(margin[worst])
    v = v.but(value=least, bound=0.0, margin=least, vehicles=(worst + 1,))
    return decide_premise(v, least >= 0.0, "gamma exceeds the limits" if least < 0 else "")


def _flyable(f: Flown, unflyable: list[str], v: Verdict) -> Verdict:
    if not f.scenario.barrier.shared:
        return decide_premise(v, False, "there is no one manoeuvre")
    return decide_premise(v, not unflyable, "; ".join(unflyable))


def _gradient(f: Flown, v: Verdict) -> Verdict:
    v = at_pair(v, f.statistics.gradient.among(f.ours), f.i, f.j, LEAST_GRADIENT)
    if v.value is None:
        return v.but(why="no pair came to the boundary")
    return decide_premise(v, v.value > LEAST_GRADIENT)


def _kink(f: Flown, barrier: Barrier, v: Verdict) -> Verdict:
    if not isinstance(barrier, TurnBarrier) or f.scenario.filter.kind not in QP_FILTERS:
        return v.but(why="no kink, or nothing binds")
    if barrier.smoothing > 0:
        return decide_premise(v, True, "smoothed")
    v = at_pair(v, f.statistics.kink.among(f.ours), f.i, f.j, 1.0)
    if v.value is None:
        return v.but(why="no row ever bound")
    holds = v.value >= 1.0
    return decide_premise(v, holds, "" if holds else "one filter step can cross it")
