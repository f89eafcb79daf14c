"""Says which runs look at near pairs only, and which pairs their tables then have.

All pairs of a large fleet cost more than its flight does. Of a turn barrier it is known how near vehicles
have to be for a pair to matter (`filters.barriers.reach`); the conditions here keep to where that is proved.
"""

from __future__ import annotations

import numpy as np

from testbed.scenario import fleet
from testbed.scenario.barrier import Turn
from testbed.scenario.contents import Contents
from testbed.scenario.nonideal import Network, Sensing
from testbed.scenario.remedy import Remedy

# Up to so many vehicles all pairs are looked at and recorded.
ABOVE = 80
# An h [m] above which no row may bind, or neighbours are no few.
MOST_H_M = 100.0
# Filters whose rows are known, or that have none; and the longest period of samples.
_FILTERS, _LONGEST_FDM_S = ("centralised", "limited", "none"), 0.1
# Pairs recorded at an instant, for each vehicle: some, for an estimate.
_EACH = 4


def near_only(s: Contents) -> bool:
    """Whether a run of `s` by the scenario's own filter looks at near pairs only."""
    return s.vehicles > ABOVE and not why_all(s)


def why_all(s: Contents) -> str:
    """What makes a run of `s` look at all pairs, whatever the number of vehicles; "" for nothing."""
    barrier = fleet.barrier(s)
    if not (isinstance(barrier, Turn) and barrier.form == "root" and barrier.gradient == "analytic"):
        return "barrier"
    causes = {
        "filter": s.filter.kind not in _FILTERS or getattr(s.filter, "monitor", False),
        "checks.manoeuvre_instants": bool(s.checks.manoeuvre_instants),
        "goal.on_arrival": s.goal.on_arrival == "leave",
        "vehicle.filter": bool(fleet.intruders(s)),
        "sensing": s.sensing != Sensing(),
        "network": s.network != Network(),
        "remedy": s.remedy != Remedy(),
        "rates.fdm_dt_s": s.rates.fdm_dt_s > _LONGEST_FDM_S,
        "alpha": _slow(s, barrier),
    }
    return next((name for name, true in causes.items() if true), "")


def recorded_pairs(s: Contents) -> int:
    """About how many pairs are recorded at an instant."""
    everyone = s.vehicles * (s.vehicles - 1) // 2
    return min(everyone, _EACH * s.vehicles) if near_only(s) else everyone


def _slow(s: Contents, barrier: Turn) -> bool:
    """Whether alpha is too small at `MOST_H_M` to keep any row from binding, roughly; see `Reach.binding`."""
    ratio = max(np.atleast_1d(barrier.sigma))
    radius = barrier.v_mps * ratio / np.radians(abs(barrier.omega_degps))
    boxes = fleet.limits(s)
    most = [b.v_max_mps + b.zeta_max_mps + 2.0 * radius * np.radians(b.omega_max_degps) for b in boxes]
    rate = 8.0 * max(*most, 3.0 * barrier.v_mps * ratio)
    a = s.alpha
    if a.kind == "odd-polynomial":
        return bool(sum(c * MOST_H_M ** (2 * k + 1) for k, c in enumerate(a.coefficients)) < rate)
    return bool(a.coefficient * MOST_H_M ** (1 if a.kind == "linear" else 3) < rate)
