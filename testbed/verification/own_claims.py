"""Checks O1 to O3 of a user's filter that declares a barrier, from the columns of that barrier.

The columns themselves are not computed again: only the filter's own code gives that barrier, and flying the
run again shows it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.claims import registry
from testbed.records.verdict import Status
from testbed.verification.filter_claims import own_rows
from testbed.verification.finding import Finding, Judge, Values
from testbed.verification.pair_claims import H_ALLOWED, RATE_ALLOWED
from testbed.verification.recorded import Recorded


def declared(run: Recorded) -> Iterator[Finding]:
    """The findings of the columns and claims of the declared barrier; none of a run without one."""
    if not run.declared:
        return
    alone = not run.i.size
    if not alone:
        yield _columns(run)
    for claim, look in (
        (registry.OWN_SAFE_SET, _safe_set),
        (registry.OWN_CONDITION, _condition),
        (registry.OWN_ROWS, _rows),
    ):
        if claim.id in run.guarantees:
            judge = Judge(run, run.guarantees[claim.id])
            yield judge.nothing("nobody else") if alone else look(run, judge)


def _columns(run: Recorded) -> Finding:
    """h is a number; alpha is one where it is declared, grows with h, and is 0 where h is."""
    h, alpha = (run.pairs[name] for name in ("h_declared", "alpha_declared"))
    wrong = [] if np.isfinite(h).all() else ["h is not finite"]
    if "alpha" not in run.declared:
        wrong += [] if np.isnan(alpha).all() else ["alpha is recorded and not declared"]
    elif not np.isfinite(alpha).all():
        wrong.append("alpha is not finite")
    else:
        order = np.argsort(h, axis=None)
        sizes = 1.0 + np.abs(alpha.ravel()[order])
        if (np.diff(alpha.ravel()[order]) < -1e-9 * sizes[1:]).any() or (alpha * h < -1e-9).any():
            wrong.append("alpha does not grow with h from alpha(0) = 0")
    own = "; ".join(wrong) or "of class K"
    return Finding("declared", f"{h.size} values", own, not wrong, None, "; ".join(wrong))


def _who(run: Recorded) -> list[list[int]]:
    return [[int(a) + 1, int(b) + 1] for a, b in zip(run.i, run.j, strict=True)]


def _safe_set(run: Recorded, judge: Judge) -> Finding:
    floor = None if run.complete else -np.inf
    seen = Values.of(run.t, run.pairs["h_declared"], 0.0, _who(run), floor=floor)
    return judge.least(seen, -H_ALLOWED, lambda h: h >= -H_ALLOWED, empty=Status.PREMISE_NOT_MET)


def _condition(run: Recorded, judge: Judge) -> Finding:
    if "alpha" not in run.declared:
        return judge.nothing("no alpha")
    h, alpha = run.pairs["h_declared"], run.pairs["alpha_declared"]
    who, steps = _who(run), slice(0, len(run.t) - 1)
    if run.complete:
        dt = run.scenario["rates"]["filter_dt_s"]
        value = np.diff(h, axis=0) / dt + alpha[steps]
        off = 1e-12 * (np.abs(h[1:]) + np.abs(h[:-1])) / dt + 1e-12 * np.abs(alpha[steps])
        seen = Values.of(run.t[steps], value, off, who)
    else:
        seen = Values.of(np.zeros(0), np.zeros((0, len(who))), 0.0, who, floor=-np.inf)
    return judge.least(seen, -RATE_ALLOWED, lambda x: x >= -RATE_ALLOWED, empty=Status.PREMISE_NOT_MET)


def _rows(run: Recorded, judge: Judge) -> Finding:
    if "constraints" not in run.declared:
        return judge.nothing("no constraints")
    return own_rows(judge)
