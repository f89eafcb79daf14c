"""Checks a run that ended before its first decision, of which nothing is recorded but its claims."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.claims import registry
from testbed.records.verdict import Kind, Status
from testbed.verification import fleet
from testbed.verification.finding import Finding, Judge
from testbed.verification.future import Pose, fly_on
from testbed.verification.pair_claims import Pairs
from testbed.verification.premise_claims import premises
from testbed.verification.recorded import Recorded
from testbed.verification.settings import goals, start

# What a distance at the start may be off [m]: aircraft and plants of the user's own start where they can.
START_M = 1e-3
NOTHING = (Status.PREMISE_NOT_MET, Status.NOT_APPLICABLE)


def unflown(run: Recorded) -> Iterator[Finding]:
    """The claims: premises from the scenario's start, distances at it, and nothing else has a value."""
    begun = start(run.scenario)
    flown = fly_on(run.scenario, Pose(begun.position[None], begun.theta[None]), run.i, run.j)
    at_start = Pairs(run, flown) if flown is not None and run.i.size else None
    looked = list(premises(run, at_start and at_start.among("judged"), None))
    if run.scenario.get("fence"):
        looked = [f for f in looked if registry.START_SAFE.id not in f.what]
    yield from looked
    done = {f.what for f in looked}
    apart = np.linalg.norm(begun.position[run.i] - begun.position[run.j], axis=-1)
    sides: dict[registry.Claim | None, dict[tuple[int, ...], float]] = {
        claim: {
            (int(i) + 1, int(j) + 1): float(d)
            for i, j, d, of in zip(run.i, run.j, apart, fleet.which(run, kind), strict=True)
            if of
        }
        for claim, kind in ((registry.SEPARATION, "ours"), (registry.SEPARATION_INTRUDERS, "beside"))
    }
    ways = np.linalg.norm(begun.position - goals(run.scenario), axis=-1)
    away: dict[tuple[int, ...], float] = {(k,): float(way) for k, way in enumerate(ways, 1)}
    for entry in run.entries:
        claim = registry.CLAIMS.get(entry["id"])
        if f"{entry['number']} {entry['id']}" in done:
            continue
        judge = Judge(run, entry)
        if sides.get(claim):
            pairs = sides[claim]
            yield _at_start(judge, pairs, min(pairs.values()), run.scenario["d_safe_m"], 1.0)
        elif claim is registry.GOAL:
            yield _at_start(judge, away, max(away.values()), run.scenario["goal_radius_m"], -1.0)
        else:
            yield _nothing(judge, claim is registry.COMMAND_LIMITS)


def _at_start(
    judge: Judge, every: dict[tuple[int, ...], float], due: float, bound: float, sign: float
) -> Finding:
    """A distance that is known at the start, at 0 s.

    every  vehicles -> their distance
    due    the worst of them
    sign   1 where it must be above the bound, -1 below
    """
    e, margin = judge.entry, sign * (due - bound)
    judge.expect_near("value", e["value"], due, START_M)
    judge.expect("bound", e["bound"], float(bound))
    judge.expect_near("margin", e["margin"], margin, START_M)
    judge.expect("t_s", e["t_s"], 0.0)
    judge.expect("verdict", e["verdict"], Status.PREMISE_NOT_MET if margin >= 0.0 else Status.VIOLATED)
    if abs(every.get(tuple(e["vehicles"]), np.inf) - due) > START_M:
        judge.wrong.append(f"vehicles {e['vehicles']} are not the worst at the start")
    possible = e["detail"].get("possible_m")
    if possible is not None and possible > due + START_M:
        judge.wrong.append(f"possible_m is {possible:.6g}, at most {due:.6g} is possible")
    return judge.done(f"{due:.6g} m at the start", START_M)


def _nothing(judge: Judge, commanded: bool) -> Finding:
    """No value but 0, and neither holds nor violated; a command that is no number violates the limits."""
    e = judge.entry
    refused = commanded and "command" in (judge.run.ended or "")
    if e["verdict"] not in NOTHING and not (refused and e["verdict"] == Status.VIOLATED):
        judge.wrong.append(f"verdict is {e['verdict']}, and nothing was flown")
    if e["value"]:
        judge.wrong.append(f"value is {e['value']:.6g}, and nothing was flown")
    if refused or e["value"] is not None or e["number"][:1] == Kind.PREMISE.value:
        what = f"{e['number']} {e['id']}"
        return Finding(what, e["verdict"], "nothing flown", not judge.wrong, None, "; ".join(judge.wrong))
    return judge.done("nothing flown")
