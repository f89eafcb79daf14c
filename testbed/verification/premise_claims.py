"""P1 to P4: the start, the manoeuvre that all share, whether the limits and the vehicles allow it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.verification.finding import PREMISE, Finding, Judge
from testbed.verification.future import manoeuvre
from testbed.verification.pair_claims import H_ALLOWED, Pairs
from testbed.verification.recorded import Recorded
from testbed.verification.settings import box, inside

# Barriers with a manoeuvre that their h is made of, or that is flown in need.
MADE_OF_ONE = ("turn", "straight", "rollout", "euclidean")


def premises(run: Recorded, pairs: Pairs | None) -> Iterator[Finding]:
    for name, look in (
        ("start-safe", _start),
        ("shared-manoeuvre", _shared),
        ("manoeuvre-in-U", _inside),
        ("manoeuvre-flyable", _flyable),
    ):
        if name in run.guarantees:
            yield look(Judge(run, run.guarantees[name]), pairs)


def _start(judge: Judge, pairs: Pairs | None) -> Finding:
    if pairs is None:
        if judge.run.i.size:
            return judge.done("unknown", None, True, "a manoeuvre that we do not fly")
        judge.expect("verdict", judge.entry["verdict"], judge.verdict(True))
        return judge.done("no pair")
    least = float(pairs.now.h[0].min())
    judge.expect("verdict", judge.entry["verdict"], judge.verdict(least >= -H_ALLOWED, PREMISE))
    return judge.done(f"least h {least:.6g}", float(pairs.now.off[0].max()))


def _shared(judge: Judge, pairs: Pairs | None) -> Finding:
    shared = not judge.run.scenario["barrier"]["pairs"]
    judge.expect("verdict", judge.entry["verdict"], judge.verdict(shared, PREMISE))
    return judge.done("one for all" if shared else "one a pair")


def _inside(judge: Judge, pairs: Pairs | None) -> Finding:
    e, s = judge.entry, judge.run.scenario
    if s["barrier"]["pairs"]:
        return judge.nothing("one a pair", PREMISE)
    share = inside(manoeuvre(s), *box(s))
    least = float(share.min())
    judge.expect_near("value", e["value"], least, 1e-9)
    judge.expect("bound", e["bound"], 0.0)
    if e["value"] is not None:
        judge.expect("margin", e["margin"], e["value"])
        judge.expect("verdict", e["verdict"], judge.verdict(e["value"] >= 0.0, PREMISE))
    if len(e["vehicles"]) != 1 or abs(share[e["vehicles"][0] - 1] - least) > 1e-9:
        judge.wrong.append(f"vehicle {int(np.argmin(share)) + 1} has the least room")
    return judge.done(f"{least:.6g}", 1e-9)


def _flyable(judge: Judge, pairs: Pairs | None) -> Finding:
    e, run = judge.entry, judge.run
    s = run.scenario
    if s["barrier"]["pairs"]:
        judge.expect("verdict", e["verdict"], PREMISE)
        return judge.done("one a pair")
    if "plant" in run.parts:
        judge.expect("verdict", e["verdict"], PREMISE)
        return judge.done("unknown")
    if s["plant"] != "jsbsim":
        judge.expect("verdict", e["verdict"], judge.verdict(True))
        return judge.done("flies all of U")
    judge.expect("verdict", e["verdict"], judge.verdict(not e["why"], PREMISE))
    return judge.done("needs a trimmed aircraft", None, True, "whether the airframe trims is not recorded")
