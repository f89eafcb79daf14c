"""Decides whether a fault ends a run, and writes what happened, to whom, and when.

A fault ends the run for all vehicles: an aircraft outside its model, or a part that fails, has no
motion against which a guarantee could be judged; see docs/decisions/0008-a-fault-ends-the-run.md.
"""

from __future__ import annotations

import math

import numpy as np

from filters.model import Array
from testbed.components.border.contract import Breach, describe


def lost(reported: list[str], track: Array) -> str | None:
    """The faults of the fleet, vehicle by vehicle; None if there are none.

    reported  what the plant says, one per vehicle, "" for no fault
    track     (n, N, 3) m, positions since the filter step before
    """
    if not any(reported) and math.isfinite(track.sum()):
        return None
    said = list(reported)
    for vehicle in np.flatnonzero(~np.isfinite(track).all(axis=(0, 2))):
        said[vehicle] = said[vehicle] or "position not finite"
    return "; ".join(f"vehicle {v}: {what}" for v, what in enumerate(said, 1) if what) or None


def raised(doing: str, error: Exception, step: int) -> str:
    """What an exception in this filter step, from 0, says: a breach names its part, others file and line."""
    if isinstance(error, Breach):
        return f"{error}, in step {step}"
    return f"{doing} failed: {describe(error)}"


def ended(fault: str, t: float) -> str:
    """Why a run ended before its time: the fault, and when [s]."""
    return f"{fault} at {t:.3f} s; run stopped"
