"""Checks the theorem monitor's verdicts, as far as the recorded commands determine them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.claims.registry import check_id
from testbed.records.verdict import Status
from testbed.verification.finding import Finding, Judge, Values
from testbed.verification.future import manoeuvre
from testbed.verification.pair_claims import EDGE, H_ALLOWED
from testbed.verification.recorded import Array
from testbed.verification.rows import Rows
from testbed.verification.settings import alpha, filters_own, steepness

# Check -> its bound. Those in PREMISES are premises of a theorem: a failure violates nothing.
BOUNDS = {
    "limited_is_safe": -1e-6, "gamma_is_safe": -1e-6, "gamma_is_safe_limited": -1e-6, "solvable": 1.0,
    "solvable_limited": 1.0, "aligned": 1e-12, "aligned_limited": 1e-12, "gradient": 1e-12, "cheaper": -1e-6,
}  # fmt: skip
PREMISES = ("aligned", "aligned_limited", "gradient")
UNSOLVED = "the solutions of the other QP are not recorded"


def monitored(rows: Rows) -> Iterator[Finding]:
    """One finding per check: the value where it can be told, the verdict from the value always."""
    for name, bound in BOUNDS.items():
        id = check_id(name)
        if id in rows.run.guarantees:
            judge = Judge(rows.run, rows.run.guarantees[id])
            follows(judge, bound, name in PREMISES)
            yield _look(rows, judge, name)


def follows(judge: Judge, bound: float, premise: bool = False) -> None:
    """The entry's bound, margin and verdict follow from its value."""
    e = judge.entry
    if e["value"] is None:
        judge.expect("verdict", e["verdict"], Status.NOT_APPLICABLE)
        return
    judge.expect("bound", e["bound"], bound)
    judge.expect("margin", e["margin"], float(e["value"] - bound))
    good = e["value"] >= bound
    fails = Status.PREMISE_NOT_MET if premise else Status.VIOLATED
    holds = Status.PREMISE_NOT_MET if judge.run.ended else Status.HOLDS
    judge.expect("verdict", e["verdict"], holds if good else fails)


def _look(rows: Rows, judge: Judge, name: str) -> Finding:
    own = rows.own
    if own is None or not rows.run.complete:
        return judge.done("unknown", None, True, "the rows behind it cannot be told from the record")
    value, off, who, counts, doubtful = _values(rows, name)
    if value is None:
        return judge.done("unknown", None, True, UNSOLVED)
    seen = Values.of(rows.run.t, value, off, who, counts, doubtful)
    low, high = seen.range()
    said = judge.entry["value"]
    if said is None and high < np.inf:
        judge.wrong.append(f"no value, should be {high:.6g}")
    if said is not None and not low <= said <= high:
        judge.wrong.append(f"value is {said:.6g}, should be {low:.6g} to {high:.6g}")
    return judge.done(f"{high:.6g}" if high < np.inf else "never met", float(np.max(off, initial=0.0)))


def _values(rows: Rows, name: str) -> tuple[Array | None, Array | float, list[list[int]], Array, Array]:
    """Value, error, vehicles, what counts and what round-off decides; None for what needs solutions."""
    run, own, s = rows.run, rows.own, rows.s
    assert own is not None and rows.pairs is not None
    h, h_off, never = own.h, own.off + H_ALLOWED, np.zeros(own.h.shape, dtype=bool)
    pair = rows.pairs.who
    if name == "gradient":
        size = np.sqrt((own.lie**2).sum(axis=(0, 1)))
        off = np.sqrt((own.lie_off**2).sum(axis=(0, 1))) + 1e-12 * size
        return size, off, pair, np.abs(h) <= EDGE, np.abs(np.abs(h) - EDGE) <= h_off
    made = filters_own(s)
    shared = not made["barrier"].get("pairs")
    if name.startswith("gamma_is_safe") and shared:
        gamma = manoeuvre(made)
        room = alpha(s, h)
        hdot, off = own.hdot(*(np.broadcast_to(gamma[v], (*h.shape, 3)) for v in (run.i, run.j)))
        off = off + steepness(s, h) * own.off + 1e-13 * np.abs(room)
        slack, off = (hdot + room, off) if name == "gamma_is_safe" else (0.5 * (hdot + room), 0.5 * off)
        return slack, off, pair, h >= 0.0, np.abs(h) <= h_off
    kind = s["filter"]["kind"]
    if name == "limited_is_safe" and kind == "limited":
        left, off = rows.left
        return left, off, pair, rows.solved[:, run.i] & rows.solved[:, run.j], never
    inside, doubt = np.all(h >= 0.0, axis=1)[:, None], np.any(np.abs(h) <= h_off, axis=1)[:, None]
    if name == "solvable" and kind == "centralised":
        return (rows.solved | ~run.present).all(axis=1).astype(float)[:, None], 0.0, [[]], inside, doubt
    if name == "solvable_limited" and kind == "limited":
        n = s["vehicles"]
        each = np.repeat(inside, n, axis=1), np.repeat(doubt, n, axis=1)
        return (rows.solved | ~run.present).astype(float), 0.0, [[v + 1] for v in range(n)], *each
    return None, 0.0, pair, never, never
