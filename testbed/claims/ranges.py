"""Judges P7: whether vehicles know of each other from far enough away."""

from __future__ import annotations

import math

from testbed.claims import registry
from testbed.claims.guarantees import QP_FILTERS, Flown
from testbed.claims.judging import decide_premise
from testbed.components.ranges import NONE, needed
from testbed.records.verdict import Verdict


def ranges(f: Flown) -> list[Verdict]:
    """P7, where the scenario limits the range; else nothing."""
    s = f.scenario
    if s.sensing.range_m is None:
        return []
    v = f.unjudged(registry.RANGE_IS_ENOUGH)
    if f.statistics.foreign or s.filter.kind not in QP_FILTERS:
        return [v.but(why="the filter is not the paper's")]
    if not f.i.size:
        return [v.but(why="a single vehicle has no pair")]
    due = needed(s)
    if not math.isfinite(due.range_m):
        return [decide_premise(v, False, NONE)]
    margin = s.sensing.range_m - due.range_m
    v = v.but(value=s.sensing.range_m, bound=due.range_m, margin=margin, vehicles=due.vehicles)
    if margin >= 0.0 and s.network.loss:
        return [decide_premise(v, False, "a lost packet may put off the first sight for as long as it likes")]
    why = f"{s.sensing.range_m:g} m is less than the {due.range_m:.1f} m that are enough"
    return [decide_premise(v, margin >= 0.0, "" if margin >= 0.0 else why)]
