"""Finds the verdict on separation that matters most: of pairs under the filter, or beside intruders."""

from __future__ import annotations

from testbed.claims.registry import SEPARATION, SEPARATION_INTRUDERS
from testbed.records.run import Run
from testbed.records.verdict import Verdict


def nearest_approach(run: Run) -> Verdict:
    """The verdict with the smaller distance; that on pairs under the filter where there are no intruders."""
    found = [v for v in run.guarantees if v.id in (SEPARATION.id, SEPARATION_INTRUDERS.id)]
    measured = [v for v in found if v.value is not None]
    return min(measured, key=lambda v: float(v.value or 0.0)) if measured else found[0]
