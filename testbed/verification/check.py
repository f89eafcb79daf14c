"""Judges every claim of a finished run again from its recorded positions and commands.

Where every step was recorded, values must agree to rounding. Where fewer were, the recorded instants bound a
value from one side, and what a vehicle can do in between bounds it from the other: a verdict that both bounds
lead to is reproduced, any other is open.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from testbed.claims import registry
from testbed.claims.monitored import MONITORED, OF_KINDS
from testbed.errors import UserError
from testbed.verification import departed, fleet
from testbed.verification.columns import columns, ending
from testbed.verification.cone_claims import cone_claims
from testbed.verification.coverage import Uncovered, uncovered
from testbed.verification.fence_claims import Fenced, without_fences
from testbed.verification.filter_claims import filtering
from testbed.verification.finding import Finding, Judge
from testbed.verification.flow_claims import flow_claims
from testbed.verification.future import Pose, fly_on
from testbed.verification.manoeuvre_claim import manoeuvre_keeps
from testbed.verification.monitor_claims import monitored
from testbed.verification.near import near_pairs
from testbed.verification.no_steps import unflown
from testbed.verification.own_claims import declared
from testbed.verification.pair_claims import OF_PAIRS, SOLVING, Pairs
from testbed.verification.path_bounds import PathBounds
from testbed.verification.path_claims import PathClaims
from testbed.verification.plan_claims import plan_claims
from testbed.verification.premise_claims import premises
from testbed.verification.progress_claim import patience, waits
from testbed.verification.range_claim import enough
from testbed.verification.recorded import Recorded, read
from testbed.verification.rows import Rows
from testbed.verification.solutions import solutions
from testbed.verification.wording import wording


def verify(folder: Path) -> list[Finding]:
    """Check the run in `folder`; UserError if it cannot be read, lacks rows or is malformed."""
    return check(folder).findings


@dataclass(frozen=True)
class Checked:
    """What was compared in a run folder, and what was not covered."""

    findings: list[Finding]
    uncovered: list[Uncovered]


def check(folder: Path) -> Checked:
    """As `verify`, with everything in the folder that no finding decided."""
    try:
        run = read(folder)
        run = departed.marked(replace(run, scenario=fleet.lowered(run.scenario)))
        findings = list(_findings(run))
        return Checked(findings, uncovered(run, findings))
    except (KeyError, TypeError, IndexError, AttributeError, ValueError, ArithmeticError) as error:
        raise UserError(f"{folder} is malformed: {type(error).__name__}: {error}") from None


def _findings(run: Recorded) -> Iterator[Finding]:
    changed = ", ".join(run.changed)
    yield Finding("files", "as written", "changed" if changed else "as written", not changed, None, changed)
    yield Finding("rows", f"{len(run.t)} instants", "all there", True)
    yield _entries(run)
    yield from wording(run)
    if not len(run.t):
        yield ending(run)
        yield from sorted(unflown(run), key=_place)
        return
    if (found := departed.left(run)) is not None:
        yield found
    if (found := near_pairs(run)) is not None:
        yield found
    run = departed.filled(run)
    flown = fly_on(run.scenario, Pose(run.position, run.vehicles["theta_rad"]), run.i, run.j)
    flown = departed.without(run, flown)
    pairs = Pairs(run, flown) if flown is not None and run.i.size else None
    rows, paths = Rows.of(run, pairs), PathBounds.of(run)
    fenced = Fenced(run, paths) if run.fences else None
    yield from columns(run, paths, pairs, rows)
    yield from fenced.table() if fenced else ()
    judged = [
        *premises(run, pairs and pairs.among("judged"), fenced),
        *(pairs.findings() if pairs is not None else _without_pairs(run)),
    ]
    judged += [*PathClaims(run, paths).findings(), *filtering(rows, fenced), *solutions(rows), *declared(run)]
    judged += fenced.findings() if fenced else without_fences(run)
    if (p7 := run.guarantees.get(registry.RANGE_IS_ENOUGH.id)) is not None:
        judged.append(enough(Judge(run, p7)))
    if (g7b := run.guarantees.get(registry.PROGRESS.id)) is not None:
        judged.append(waits(Judge(run, g7b)))
    if (g9 := run.guarantees.get(registry.MANOEUVRE_KEEPS_DS.id)) is not None:
        some = fleet.among(run, fleet.which(run, "ours")) if fleet.strangers(run.scenario) else run
        judged.append(manoeuvre_keeps(pairs and pairs.among("ours"), Judge(some, g9)))
    yield from sorted(judged, key=_place)
    yield from monitored(rows)
    yield from flow_claims(rows)
    yield from plan_claims(rows)
    yield from cone_claims(rows)


def _place(finding: Finding) -> int:
    """Its place in the registry's order; what is no claim comes after it."""
    order = [f"{claim.number} {claim.id}" for claim in registry.CLAIMS.values()]
    return order.index(finding.what) if finding.what in order else len(order)


def _entries(run: Recorded) -> Finding:
    """Every claim that such a run is judged by is there, once, and no other."""
    s = run.scenario
    claims = [*registry.PREMISES, *registry.GUARANTEES]
    if s.get("fence"):
        claims += registry.FENCES
    if s["checks"]["manoeuvre_instants"] and not run.ended:
        claims.append(registry.MANOEUVRE_KEEPS_DS)
    if fleet.strangers(s):
        claims += registry.INTRUDERS
    if patience(s) is not None:
        claims += registry.LIVENESS
    if run.declared:
        claims += registry.OWN
    if s["sensing"].get("range_m") is not None:
        claims += registry.RANGES
    if s["filter"].get("monitor") and "filter" not in run.parts and s["filter"]["kind"] in SOLVING:
        claims += MONITORED
    if "filter" not in run.parts:
        claims += OF_KINDS.get(s["filter"]["kind"], ())
    due = {claim.id: claim.number for claim in claims}
    said = [(e["id"], e["number"]) for e in run.entries]
    odd = sorted(
        {name for name, _ in set(due.items()) ^ set(said)} | {n for n, _ in said if said.count((n, _)) > 1}
    )
    return Finding("entries", f"{len(said)} claims", f"{len(due)} claims", not odd, None, ", ".join(odd))


def _without_pairs(run: Recorded) -> Iterator[Finding]:
    """The claims about h where there is no pair, or no h that we can compute."""
    for claim in OF_PAIRS:
        if claim.id in run.guarantees:
            judge = Judge(run, run.guarantees[claim.id])
            if run.i.size:
                yield judge.done("unknown", None, True, "verification does not cover this manoeuvre")
            else:
                yield judge.nothing("nobody else")
