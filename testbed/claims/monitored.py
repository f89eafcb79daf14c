"""Turns what a filter recorded of its own claims into verdicts: theorem monitor, flow filter, rivals."""

from __future__ import annotations

import numpy as np

from filters.cbf.theorem_monitor import theorem_checks
from filters.filter import MonitorRecord
from filters.flow.flow_filter import flow_checks
from filters.rivals.collision_cone import cone_checks
from filters.rivals.gatekeeper import plan_checks
from testbed.claims.registry import check_claim, check_id
from testbed.records.verdict import Status, Verdict
from testbed.scenario.scenario import Scenario

MONITORED = tuple(check_claim(name, check.claim) for name, check in theorem_checks().items())
OF_THE_FLOW = tuple(
    check_claim(name, check.claim, f"F{k}", "the flow filter's own theorem, docs/guide/flow.md")
    for k, (name, check) in enumerate(flow_checks().items(), 1)
)
OF_PLANS = tuple(
    check_claim(name, check.claim, f"R{k}", "what is committed to is safe for ever, docs/guide/rivals.md")
    for k, (name, check) in enumerate(plan_checks().items(), 3)
)
OF_CONES = tuple(
    check_claim(name, check.claim, f"R{k}", "Thontepu et al. 2023, arXiv:2209.11524")
    for k, (name, check) in enumerate(cone_checks().items(), 1)
)
# The backup filter watches the flow's first claim alone, of the same flow.
OF_KINDS = {
    "flow": OF_THE_FLOW,
    "backup": OF_THE_FLOW[:1],
    "collision-cone": OF_CONES,
    "gatekeeper": OF_PLANS,
    "receding-horizon": OF_PLANS,
}
"""Kind of filter -> what it promises beside or instead of the paper's claims, as it records it."""
RECORDED = {claim.id: claim for claim in (*MONITORED, *OF_THE_FLOW, *OF_PLANS, *OF_CONES)}
# Of the monitor's checks, those that are premises of a theorem, not conclusions: one that fails violates
# nothing.
PREMISES = ("aligned", "aligned_limited", "gradient", "flow_wind", "cone_start")


def monitored(record: MonitorRecord, s: Scenario) -> list[Verdict]:
    """One verdict per check of a monitored run of `s`."""
    verdicts = []
    for name, check in record.checks.items():
        v = RECORDED[check_id(name)].unjudged(s.barrier.form, s.goal_radius_m)
        if not check.checked:
            verdicts.append(v.but(why="never met"))
            continue
        failed = Status.PREMISE_NOT_MET if name in PREMISES else Status.VIOLATED
        v = v.but(
            status=failed if check.failed else Status.HOLDS,
            why=f"{check.failed} of {check.checked} fail" if check.failed else "",
        )
        # A check that fails by NaN has no worst number.
        if (check.worst < check.least) == bool(check.failed) and np.isfinite(check.worst):
            v = v.but(value=check.worst, bound=check.least, margin=check.worst - check.least)
        if v.value is not None and check.worst_at is not None:
            step, vehicles = check.worst_at
            v = v.but(instant=step * s.rates.filter_dt_s, vehicles=vehicles)
        verdicts.append(v)
    return verdicts
