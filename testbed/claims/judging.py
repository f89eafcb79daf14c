"""Fills in verdicts: the worst pair of an extreme, and holds, violated or premise not met."""

from __future__ import annotations

import numpy as np

from testbed.measures.run_statistics import Extreme
from testbed.records.verdict import Kind, Status, Verdict


def at_pair(verdict: Verdict, extreme: Extreme, i: np.ndarray, j: np.ndarray, bound: float) -> Verdict:
    """With the worst pair of `extreme`; unchanged, its value None, if nothing was seen."""
    p, value, t = extreme.worst()
    if p < 0:
        return verdict
    vehicles = (int(i[p]) + 1, int(j[p]) + 1)
    return verdict.but(value=value, bound=bound, margin=value - bound, instant=t, vehicles=vehicles)


def decide(verdict: Verdict, holds: bool, end: str | None) -> Verdict:
    """Holds or violated. A run that ended early (`end` says why) holds nothing."""
    if holds and end:
        return verdict.but(status=Status.PREMISE_NOT_MET, why=end)
    return verdict.but(status=Status.HOLDS if holds else Status.VIOLATED)


def decide_premise(verdict: Verdict, holds: bool, why: str = "") -> Verdict:
    """Holds or premise not met: a premise that fails violates nothing, what rests on it is not shown."""
    status = Status.HOLDS if holds else Status.PREMISE_NOT_MET
    return verdict.but(status=status, why=verdict.why or why)


def premise_not_met(verdict: Verdict, why: str) -> Verdict:
    """For a guarantee whose own premise is missing in this run."""
    return verdict.but(status=Status.PREMISE_NOT_MET, why=why)


def void(verdicts: list[Verdict], end: str | None) -> list[Verdict]:
    """Verdicts of a run that ended early (`end` says why): what holds, and is no premise, is not shown."""
    if end is None:
        return verdicts
    return [
        premise_not_met(v, end) if v.status is Status.HOLDS and v.kind is not Kind.PREMISE else v
        for v in verdicts
    ]
