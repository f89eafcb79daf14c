"""Checks P1 to P4: the start, the shared manoeuvre, whether limits and vehicles allow it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.claims import registry
from testbed.records.verdict import Status
from testbed.verification import fleet
from testbed.verification.fence_claims import Fenced
from testbed.verification.finding import Finding, Judge
from testbed.verification.future import manoeuvre
from testbed.verification.pair_claims import H_ALLOWED, Pairs
from testbed.verification.recorded import Recorded
from testbed.verification.settings import box, inside


def premises(run: Recorded, pairs: Pairs | None, fenced: Fenced | None) -> Iterator[Finding]:
    if registry.START_SAFE.id in run.guarantees:
        yield _start(Judge(run, run.guarantees[registry.START_SAFE.id]), pairs, fenced)
    for claim, look in (
        (registry.SHARED_MANOEUVRE, _shared),
        (registry.MANOEUVRE_IN_U, _inside),
        (registry.MANOEUVRE_FLYABLE, _flyable),
    ):
        if claim.id in run.guarantees:
            yield look(Judge(run, run.guarantees[claim.id]), pairs)


def _start(judge: Judge, pairs: Pairs | None, fenced: Fenced | None) -> Finding:
    least, off = np.inf, 0.0
    if fenced is not None:
        least, off = float(fenced.h[0].min()), fenced.now.off
    if pairs is None:
        if judge.run.i.size:
            return judge.done("unknown", None, True, "verification does not cover this manoeuvre")
    else:
        least, off = min(least, float(pairs.now.h[0].min())), max(off, float(pairs.now.off[0].max()))
    judge.expect(
        "verdict", judge.entry["verdict"], judge.verdict(least >= -H_ALLOWED, Status.PREMISE_NOT_MET)
    )
    return judge.done("no pair" if least == np.inf else f"least h {least:.6g}", off)


def _shared(judge: Judge, pairs: Pairs | None) -> Finding:
    shared = not judge.run.scenario["barrier"].get("pairs")
    strange = fleet.strangers(judge.run.scenario)
    judge.expect(
        "verdict", judge.entry["verdict"], judge.verdict(shared and not strange, Status.PREMISE_NOT_MET)
    )
    return judge.done("not of intruders" if strange else "one for all" if shared else "one a pair")


def _inside(judge: Judge, pairs: Pairs | None) -> Finding:
    e, s = judge.entry, judge.run.scenario
    if s["barrier"].get("pairs"):
        return judge.nothing("one a pair", Status.PREMISE_NOT_MET)
    share = np.where(fleet.under(s), inside(manoeuvre(s), *box(s)), np.inf)
    least = float(share.min())
    judge.expect_near("value", e["value"], least, 1e-9)
    judge.expect("bound", e["bound"], 0.0)
    if e["value"] is not None:
        judge.expect("margin", e["margin"], e["value"])
        judge.expect("verdict", e["verdict"], judge.verdict(e["value"] >= 0.0, Status.PREMISE_NOT_MET))
    if len(e["vehicles"]) != 1 or abs(share[e["vehicles"][0] - 1] - least) > 1e-9:
        judge.wrong.append(f"vehicle {int(np.argmin(share)) + 1} has the least room")
    return judge.done(f"{least:.6g}", 1e-9)


def _flyable(judge: Judge, pairs: Pairs | None) -> Finding:
    e, run = judge.entry, judge.run
    s = run.scenario
    if s["barrier"].get("pairs"):
        judge.expect("verdict", e["verdict"], Status.PREMISE_NOT_MET)
        return judge.done("one a pair")
    if "plant" in run.parts:
        judge.expect("verdict", e["verdict"], Status.PREMISE_NOT_MET)
        return judge.done("unknown")
    if s["plant"] != "jsbsim":
        judge.expect("verdict", e["verdict"], judge.verdict(True))
        return judge.done("flies all of U")
    judge.expect("verdict", e["verdict"], judge.verdict(not e["why"], Status.PREMISE_NOT_MET))
    return judge.done("needs a trimmed aircraft", None, True, "whether the airframe trims is not recorded")
