"""Judges G7b: whether vehicles come nearer to their goals again and again."""

from __future__ import annotations

import numpy as np

from testbed.claims import registry
from testbed.claims.guarantees import Flown
from testbed.claims.judging import decide, premise_not_met
from testbed.measures.progress import seeking
from testbed.records.verdict import Verdict


def progress(f: Flown) -> list[Verdict]:
    """G7b, of runs longer than the patience; else nothing."""
    waiting = f.statistics.progress
    if waiting is None:
        return []
    seeks, bound = seeking(f.scenario), waiting.patience_s
    v = f.unjudged(registry.PROGRESS)
    if not f.statistics.filter_steps:
        return [premise_not_met(v, "no step was flown")]
    longest, begin = waiting.waits(f.statistics.last_s)
    worst = int(np.argmax(np.where(seeks, longest, -np.inf)))
    value, arrived = float(longest[worst]), waiting.arrived & seeks
    alone = np.full(len(seeks), np.nan) if f.solo_time_s is None else f.solo_time_s
    added = (f.statistics.passed - alone)[arrived & np.isfinite(alone)]
    v = v.but(
        value=value,
        bound=bound,
        margin=bound - value,
        instant=float(begin[worst]),
        vehicles=(worst + 1,),
        detail={
            "arrived": int(arrived.sum()),
            "of": int(seeks.sum()),
            "waiting": int((longest[seeks] > bound).sum()),
            "added_s": float(added.max()) if added.size else None,
        },
    )
    return [decide(v, value <= bound, f.end)]
