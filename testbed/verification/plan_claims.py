"""Checks R3, that the plans which vehicles commit to keep clear of each other for ever.

A gatekeeper's plans follow from the record. A receding-horizon plan is the answer of programs that are not
solved again: there the value is bounded by what no plan can change any more, and compared with the statuses.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.verification.finding import Finding, Judge, Values
from testbed.verification.flow_claims import Lagging, model_lags
from testbed.verification.monitor_claims import follows
from testbed.verification.plan_decisions import ContradictionError, Decisions, level
from testbed.verification.plans_flown import GAMMA, Plan, Plans, Way, nearest
from testbed.verification.recorded import Recorded
from testbed.verification.rows import Rows

PLANS, BOUND = "monitor-plan_clear", -0.01
# Switching times of a gatekeeper, as shares of its horizon; and one period.
SHARES = (1.0, 0.5, 0.25, 0.125)
# What steps of 5 ms may do to a value [m]: 2e-4 has been seen.
OFF_M = 5e-3
# Clearances beyond this are recorded as bounds below [m].
EXACT_M = 20.0
OPEN = "plans of programs are not solved again; the value is at most {:.6g}"


def plan_claims(rows: Rows) -> Iterator[Finding]:
    """The finding of R3."""
    run, s = rows.run, rows.s
    if PLANS not in run.guarantees:
        return
    judge = Judge(run, run.guarantees[PLANS])
    follows(judge, BOUND)
    why, known = rows.untold, None
    if not why:
        known = model_lags(s)
        why = "" if known is not None else "the lags of the model are not to be found"
    if known is None or why:
        yield judge.done("unknown", None, True, why)
    elif s["filter"]["kind"] == "gatekeeper":
        yield _gatekeeper(run, judge, Lagging.of(known))
    else:
        yield _bounded(run, judge, Lagging.of(known))


def _gatekeeper(run: Recorded, judge: Judge, lagging: Lagging) -> Finding:
    s = run.scenario
    periods = s["filter"]["horizon_s"] / s["rates"]["filter_dt_s"]
    switching = sorted({max(1, round(share * periods)) for share in (*SHARES, 0.0)}, reverse=True)
    try:
        low, high = Decisions(run, lagging, switching).clearances()
    except ContradictionError as error:
        judge.wrong.append(str(error))
        return judge.done("unknown", None, True, str(error))
    who = [[int(a) + 1, int(b) + 1] for a, b in zip(run.i, run.j, strict=True)]
    seen = Values.of(run.t, 0.5 * (low + high), 0.5 * (high - low) + OFF_M, who)
    least, most = seen.range()
    said = judge.entry["value"]
    if said is None:
        if run.i.size:
            judge.wrong.append(f"no value, should be {most:.6g}")
    elif not min(least, EXACT_M) <= said <= most:
        judge.wrong.append(f"value is {said:.6g}, should be {min(least, EXACT_M):.6g} to {most:.6g}")
    elif said < EXACT_M:
        here = seen.at(judge.entry["t_s"], judge.entry["vehicles"])
        if here is None or abs(here[0] - said) > here[1]:
            judge.wrong.append(f"not the value at {judge.entry['t_s']:g} s of {judge.entry['vehicles']}")
    found = f"{seen.least():.6g}" if most - least < 4 * OFF_M else f"{least:.6g} to {most:.6g}"
    return judge.done(found if run.i.size else "never met", OFF_M)


def _bounded(run: Recorded, judge: Judge, lagging: Lagging) -> Finding:
    """Of plans that are not known: at the start they are gamma, and commands on their way are certain."""
    said, e = judge.entry["value"], judge.entry
    if said is None or not run.i.size:
        return judge.done("never met", 0.0)
    plans = Plans(run, lagging, 1, run.command)
    n = run.scenario["vehicles"]
    plans.fly((0, v, GAMMA) for v in range(n))
    ways = [_there(plans, 0, v, GAMMA) for v in range(n)]
    started = min(float(nearest(ways[v], ways[:v]).min()) for v in range(1, n))
    most = min(started, float(plans.certain().min())) - level(run)
    if said > most + OFF_M:
        judge.wrong.append(f"value is {said:.6g}, should be {most:.6g} at most")
    # Who has no clear plan says so, and by how much is the residual.
    short = run.vehicles["qp_status"] == "infeasible"
    if bool(short.any()) != (said < BOUND):
        judge.wrong.append(f"value is {said:.6g}, but {int(short.sum())} statuses are infeasible")
    elif said < BOUND:
        judge.expect_near("value", said, -float(run.manifest["worst_qp_residual"]), 1e-6)
        k = int(np.argmin(np.abs(run.t - e["t_s"])))
        if not short[k, [v - 1 for v in e["vehicles"]]].all():
            judge.wrong.append(f"no plan of {e['vehicles']} is short at {e['t_s']:g} s")
    return judge.done("unknown", None, True, OPEN.format(most))


def _there(plans: Plans, k: int, v: int, plan: Plan) -> Way:
    way = plans.way((k, v, plan))
    assert way is not None
    return way
