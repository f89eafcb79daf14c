"""Fills in verdicts: the worst pair of an extreme, and holds, violated or premise not met."""

from __future__ import annotations

import numpy as np

from testbed.measures.extreme import Extreme
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


def leave_open(verdict: Verdict, why: str, end: str | None) -> Verdict:
    """Open, `why` saying what would decide it. A run that ended early (`end` says why) decides nothing."""
    if end:
        return verdict.but(status=Status.PREMISE_NOT_MET, why=end)
    return verdict.but(status=Status.OPEN, why=why)


def finer(possible: float, radius: float, bound: float, dt: float) -> str:
    """Why a distance between samples is open, and the period of the flight dynamics that would decide it.

    possible  m, lower bound of the distance, below `bound`
    radius    m, how far paths may leave the straight lines between samples `dt` [s] apart; grows with dt^2

    With the largest acceleration seen, paths leave the straight lines by half of `radius`. By so much finer
    samples may come nearer; what then remains above `bound` is the radius that they may have.
    """
    room = possible + 0.5 * radius - bound
    if room > 0.0 and np.isfinite(radius):
        share, would = float(np.sqrt(room / radius)), "fdm_dt_s <= {:.2g} would do"
    else:  # the paths may really come nearer: finer samples will tell, and may find a violation
        share, would = 0.25, "for example fdm_dt_s = {:.2g}"
    period = dt * share
    digit = 10.0 ** (np.floor(np.log10(period)) - 1)
    may = f"come as near as {possible:.6g} m" if np.isfinite(possible) else "be anywhere"
    would = would.format(np.floor(period / digit) * digit)
    return f"paths between samples may {may}: sample finer, {would}"


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
