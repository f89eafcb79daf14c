"""The form of a verdict: one entry per claim, and how its verdict is reached."""

from __future__ import annotations

from typing import Any

import numpy as np

from testbed.measures.run_statistics import Extreme

HOLDS, VIOLATED, PREMISE, NOT_APPLICABLE = "holds", "violated", "premise not met", "not applicable"

Entry = dict[str, Any]


def entry(name: str, number: str, claim: str, source: str, quantity: str, unit: str) -> Entry:
    """A claim without data yet: not applicable until something decides it.

    number  P1.. for a premise of the theorems, G1.. for a guarantee, M.. for a monitor's check
    """
    return {
        "id": name,
        "number": number,
        "claim": claim,
        "source": source,
        "quantity": quantity,
        "unit": unit,
        "value": None,
        "bound": None,
        "margin": None,
        "t_s": None,
        "vehicles": [],
        "verdict": NOT_APPLICABLE,
        "why": "",
        "detail": {},
    }


def at_pair(e: Entry, extreme: Extreme, i: np.ndarray, j: np.ndarray, bound: float) -> float:
    """Fill in the worst pair of `extreme`; nan if nothing was seen."""
    p, value, t = extreme.worst()
    if p >= 0:
        vehicles = [int(i[p]) + 1, int(j[p]) + 1]
        e.update(value=value, bound=bound, margin=value - bound, t_s=t, vehicles=vehicles)
    return value


def decide(e: Entry, holds: bool, end: str | None) -> Entry:
    """Holds or violated; a run that ended early holds nothing. Call with False for a value that is nan."""
    e["verdict"] = HOLDS if holds else VIOLATED
    if holds and end:
        e["verdict"], e["why"] = PREMISE, end
    return e


def decide_premise(e: Entry, holds: bool, why: str = "") -> Entry:
    """A premise that fails violates nothing: it voids what rests on it."""
    e["verdict"] = HOLDS if holds else PREMISE
    e["why"] = e["why"] or why
    return e
