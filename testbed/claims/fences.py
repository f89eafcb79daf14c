"""Judges the claims about fences, G10 and G11, from what was counted at every step of a run."""

from __future__ import annotations

import numpy as np

from testbed.claims import registry
from testbed.claims.guarantees import H_TOLERANCE_M, Flown
from testbed.claims.judging import decide, finer, leave_open, premise_not_met
from testbed.measures.between_samples import TOLERANCE_M
from testbed.measures.extreme import Extreme
from testbed.measures.fence_statistics import FenceStatistics
from testbed.records.verdict import Verdict


def fence_claims(f: Flown) -> list[Verdict]:
    """G10 and G11; none of a scenario without fences."""
    seen = f.statistics.fences
    if seen is None:
        return []
    return [
        _clearance(f, seen, f.unjudged(registry.FENCE_CLEARANCE)),
        _invariance(f, seen, f.unjudged(registry.FENCE_SAFE_SET)),
    ]


def _clearance(f: Flown, seen: FenceStatistics, v: Verdict) -> Verdict:
    possible, reached = seen.least()
    (_, sampled, _), (_, nearest, _) = seen.clearance.worst(), reached.worst()
    # The value is that of the samples, unless only a passing between them tells.
    v = _at(v, seen, reached if nearest < 0.0 <= sampled else seen.clearance, 0.0)
    if v.value is None:
        return v.but(why="no fence is for any vehicle")
    worst = int(np.argmin(possible))
    v = v.but(detail=dict(v.detail) | {"possible_m": float(possible[worst])})
    if not nearest >= 0.0 or possible[worst] >= -TOLERANCE_M:
        return decide(v, nearest >= 0.0, f.end)
    radius, dt = float(seen.radius[worst]), f.scenario.rates.fdm_dt_s
    return leave_open(v, finer(float(possible[worst]), radius, 0.0, dt), f.end)


def _invariance(f: Flown, seen: FenceStatistics, v: Verdict) -> Verdict:
    v = _at(v, seen, seen.h, -H_TOLERANCE_M)
    if v.value is None:
        return v.but(why="no fence is for any vehicle")
    if not f.started_in_fences:
        return premise_not_met(v, "the start is outside the safe set of a fence")
    return decide(v, v.value >= -H_TOLERANCE_M, f.end)


def _at(v: Verdict, seen: FenceStatistics, extreme: Extreme, bound: float) -> Verdict:
    """With the worst vehicle, its fence in the detail (both from 1); unchanged if nothing was seen."""
    p, value, t = extreme.worst()
    if p < 0:
        return v
    fence, vehicle = (int(a[p]) + 1 for a in (seen.fences.fence, seen.fences.vehicle))
    margin, detail = value - bound, {"fence": fence}
    return v.but(value=value, bound=bound, margin=margin, instant=t, vehicles=(vehicle,), detail=detail)
