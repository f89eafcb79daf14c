"""Checks that exactly the near pairs are recorded where the manifest says that only they are."""

from __future__ import annotations

import numpy as np

from testbed.verification.departed import told as told_of_those_there
from testbed.verification.finding import Finding
from testbed.verification.future import Pose, fly_on, manoeuvre
from testbed.verification.near_table import centres, recorded_below
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import Scenario, alpha, box

# What a boundary between recorded and not may be off [m]: round-off of h.
ROUNDING = 1e-6


def told(run: Recorded, said: Array, own: Array, ahead: bool = False) -> Array:
    """A column of pairs (T', P) at the first T' instants, and ours where nothing is recorded."""
    said = told_of_those_there(run, said, own, ahead)
    return said if run.near is None else np.where(run.near[: len(said)], said, own)


def near_pairs(run: Recorded) -> Finding | None:
    """Exactly the pairs are recorded whose h is at most what the manifest says; None where all are due."""
    if run.near is None:
        return None
    s, h = run.scenario, recorded_below(run.manifest)
    assert h is not None
    wrong = [] if _due(s, h) else [f"{h:g} m is not the h at which alpha is 8 times the largest rate"]
    wrong += [] if s["vehicles"] > int(run.manifest["near_pairs"]["above"]) else ["all pairs are due"]
    flown = fly_on(s, Pose(run.position, run.vehicles["theta_rad"]), run.i, run.j)
    if flown is None or s["barrier"]["kind"] != "turn" or s["barrier"]["form"] != "root":
        return Finding("near_pairs", f"h <= {h:g} m", "unknown", None, None, "no turn barrier in root form")
    missing = int(((flown.h < h - ROUNDING) & ~run.near).sum())
    extra = int(((flown.h > h + ROUNDING) & run.near).sum())
    wrong += [f"{missing} rows are missing"] if missing else []
    wrong += [f"{extra} rows are of pairs further away"] if extra else []
    rows = int(run.near.sum())
    own = f"{rows + missing - extra} rows"
    return Finding("near_pairs", f"{rows} rows", own, not wrong, ROUNDING, "; ".join(wrong))


def _due(s: Scenario, h: float) -> bool:
    """Whether `h` [m] is where pairs are due to end: alpha(h) is 8 times what one vehicle can change h by.

    Within its limits, or flying gamma, every point of a vehicle's circle moves by no more than the vehicle
    and twice the radius times the turn. No row of two vehicles, or of a vehicle's share, binds above that.
    """
    low, high = box(s)
    gamma = manoeuvre(s)
    _, radius = centres(s, np.zeros((s["vehicles"], 3)), np.zeros(s["vehicles"]))
    most = np.maximum(np.maximum(np.abs(low), np.abs(high)).max(axis=0), 0.0)
    rates = [most[0] + most[2] + 2.0 * radius * most[1]]
    rates.append(float((np.abs(gamma) @ np.array([1.0, 2.0 * radius, 1.0])).max()))
    return bool(abs(float(alpha(s, np.asarray(h))) - 8.0 * max(rates)) <= 1e-6 * 8.0 * max(rates))
