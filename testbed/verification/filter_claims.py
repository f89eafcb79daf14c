"""Checks G4, G5 and G6: how the QPs ended, commands against the limits and against the filter's rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.claims import promises, registry
from testbed.records.verdict import Status
from testbed.verification import fleet
from testbed.verification.fence_claims import Fenced
from testbed.verification.finding import Finding, Judge, Values
from testbed.verification.pair_claims import H_ALLOWED
from testbed.verification.recorded import Array
from testbed.verification.rows import Rows
from testbed.verification.settings import box, inside

ROW_ALLOWED = 1e-6
FAILED = ("infeasible", "iteration_limit")


def filtering(rows: Rows, fenced: Fenced | None) -> Iterator[Finding]:
    if registry.QP_FEASIBILITY.id in rows.run.guarantees:
        yield _feasibility(rows, Judge(rows.run, rows.run.guarantees[registry.QP_FEASIBILITY.id]), fenced)
    for claim, look in (
        (registry.COMMAND_LIMITS, _limits),
        (registry.ROWS_SATISFIED, _satisfied),
    ):
        if claim.id in rows.run.guarantees:
            yield look(rows, Judge(rows.run, rows.run.guarantees[claim.id]))


def own_rows(judge: Judge) -> Finding:
    """O3: rows are not recorded, but what is said of them must fit together."""
    return _own_filter(judge, -ROW_ALLOWED, 1)


def _own_filter(judge: Judge, bound: float, more: int) -> Finding:
    """G4 or G6 of a user's own filter: its rows are not recorded, but value, margin and verdict must fit.

    more  1 where a larger value is better, -1 where a smaller one is
    """
    e = judge.entry
    if e["value"] is not None:
        judge.expect_near("bound", e["bound"], bound, 0.0)
        judge.expect_near(
            "margin", e["margin"], more * (e["value"] - bound), 1e-9 * max(1.0, abs(e["value"]))
        )
        judge.expect("verdict", e["verdict"] == Status.VIOLATED, not e["margin"] >= 0.0)
    if e["verdict"] == Status.HOLDS:
        judge.expect("verdict", e["verdict"], judge.verdict(e["value"] is not None))
    return judge.done("not recorded", open_=True, why="the filter was not the scenario's")


def _feasibility(rows: Rows, judge: Judge, fenced: Fenced | None) -> Finding:
    run, e = rows.run, judge.entry
    if "filter" in run.parts:
        return _own_filter(judge, 0.0, -1)
    if not (rows.solves or rows.s["filter"]["kind"] in promises.ALWAYS_SOLVING):
        return judge.nothing("no QP")
    status = run.vehicles["qp_status"]
    failed = np.isin(status, FAILED)
    count = int(failed.sum())
    if not isinstance(e["value"], int) or e["value"] < count or (run.complete and e["value"] != count):
        judge.wrong.append(f"{count} are recorded")
    value = e["value"] if isinstance(e["value"], int) else count
    judge.expect("bound", e["bound"], 0)
    judge.expect("margin", e["margin"], -value)
    judge.expect("verdict", e["verdict"], judge.verdict(value == 0))
    if run.complete:
        due = {name: int((status == name).sum()) for name in FAILED if (status == name).any()}
        judge.expect("detail", {k: n for k, n in e["detail"].items() if k in FAILED}, due)
        fewest, most = (int(failed[safe].sum()) for safe in _safe(rows, fenced))
        if not fewest <= e["detail"].get("in_safe_set", -1) <= most:
            judge.wrong.append(f"in_safe_set is {e['detail'].get('in_safe_set')}, should be {most}")
        if count:
            k, v = (int(a[0]) for a in np.nonzero(failed))
            judge.expect("t_s", e["t_s"], float(run.t[k]))
            judge.expect("vehicles", e["vehicles"], [v + 1])
    return judge.done(f"{count} recorded", open_=not run.complete and count == 0)


def _safe(rows: Rows, fenced: Fenced | None) -> tuple[Array, Array]:
    """Instants (T,) at which all pairs and fences are safe beyond round-off, and at which they may be."""
    surely = maybe = np.ones(len(rows.run.t), dtype=bool)
    if fenced is not None:
        wrong = fenced.now.off + H_ALLOWED
        surely, maybe = np.all(fenced.h >= wrong, axis=1), np.all(fenced.h >= -wrong, axis=1)
    if rows.pairs is None:
        return np.asarray(surely & (rows.run.i.size == 0)), maybe
    now = rows.pairs.among("judged").now
    h, off = now.h, now.off + H_ALLOWED
    return surely & np.all(h >= off, axis=1), maybe & np.all(h >= -off, axis=1)


def _limits(rows: Rows, judge: Judge) -> Finding:
    run, e = rows.run, judge.entry
    if e["value"] is None and e["verdict"] == Status.VIOLATED and "filter" in run.parts:
        # A command that is not finite ended the run, at an instant that need not be recorded.
        judge.expect("a command in what ended the run", ": command." in (run.ended or ""), True)
        return judge.done("not finite", open_=True)
    share = np.where(run.present, inside(run.command, *box(rows.s)), np.inf)
    who = [[v + 1] for v in range(rows.s["vehicles"])]
    seen = Values.of(run.t, share, 1e-12, who, floor=None if run.complete else -np.inf)
    for k, name in enumerate(("v_mps", "omega_radps", "zeta_mps")):
        seen_rates = run.rates[..., k][run.present]
        low, high = float(seen_rates.min(initial=np.inf)), float(seen_rates.max(initial=-np.inf))
        said = e["detail"].get(f"achieved_{name}", [np.nan, np.nan])
        if not (said[0] <= low and said[1] >= high):
            judge.wrong.append(f"achieved {name} {low:.6g} to {high:.6g} are recorded")
        elif run.complete and not (said[0] == low and said[1] == high):
            judge.wrong.append(f"achieved {name} is only {low:.6g} to {high:.6g}")
    _stops(judge)
    return judge.least(seen, 0.0, lambda x: x >= 0.0, empty=Status.PREMISE_NOT_MET)


def _stops(judge: Judge) -> None:
    """Shares of the recorded instants held back by the autopilot, or with the throttle at a stop."""
    held = judge.entry["detail"].get("share_at_stop", {})
    for name in ("limited_v", "limited_omega", "limited_zeta", "throttle"):
        if name in held and name in judge.run.vehicles:
            x = judge.run.vehicles[name]
            stopped = ((x <= 0.01) | (x >= 0.99) if name == "throttle" else x > 0.5) & judge.run.present
            judge.expect_near(f"{name} at a stop", held[name], float(stopped.mean(axis=0).max()), 1e-9)


def _satisfied(rows: Rows, judge: Judge) -> Finding:
    run = rows.run
    if judge.excused:
        return _true_rows(rows, judge)
    if "filter" in run.parts:
        return _own_filter(judge, -ROW_ALLOWED, 1)
    if not rows.solves or not run.i.size:
        return judge.nothing("no rows")
    if rows.own is None:
        missing = rows.seen if isinstance(rows.seen, str) else "verification does not cover this manoeuvre"
        empty = np.zeros((0, run.i.size))
        assert rows.pairs is not None or missing
        who = [[int(a) + 1, int(b) + 1] for a, b in zip(run.i, run.j, strict=True)]
        seen = Values.of(np.zeros(0), empty, 0.0, who, floor=-np.inf)
        return judge.least(
            seen, -ROW_ALLOWED, lambda x: x >= -ROW_ALLOWED, empty=Status.PREMISE_NOT_MET, missing=missing
        )
    assert rows.pairs is not None
    left, off = rows.left
    counts = rows.answered[:, run.i] & rows.answered[:, run.j] & fleet.which(run, "judged")
    counts = counts if rows.apart is None else counts & ~rows.apart
    floor = None if run.complete else -np.inf
    seen = Values.of(run.t, left, off, rows.pairs.who, counts, floor=floor)
    return judge.least(seen, -ROW_ALLOWED, lambda x: x >= -ROW_ALLOWED, empty=Status.PREMISE_NOT_MET)


def _true_rows(rows: Rows, judge: Judge) -> Finding:
    """G6 where it is not the filter's claim: the rows of the scenario's barrier at the true states."""
    run, pairs = rows.run, rows.pairs
    if not run.i.size:
        return judge.nothing("no rows")
    if pairs is None:
        return judge.done("unknown", None, True, "verification does not cover this manoeuvre")
    hdot, off = pairs.now.hdot(run.command[:, run.i], run.command[:, run.j])
    off = off + pairs.alpha_off + 1e-13 * (np.abs(pairs.alpha) + np.abs(hdot))
    floor = None if run.complete else -np.inf
    seen = Values.of(run.t, hdot + pairs.alpha, off, pairs.who, floor=floor)
    return judge.least(seen, -ROW_ALLOWED, lambda x: x >= -ROW_ALLOWED)
