"""Every claim of a run that its recorded positions and commands can decide, decided again.

Where everything was recorded, values must agree to rounding. Where recording was thinned, the recorded
instants bound a value from one side and what flight can do in between from the other; a verdict that both
ends allow agrees, one between them is said to be open.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from testbed.errors import UserError
from testbed.verification.columns import columns
from testbed.verification.filter_claims import filtering
from testbed.verification.finding import Finding, Judge
from testbed.verification.future import Pose, fly_on
from testbed.verification.manoeuvre_claim import manoeuvre_keeps
from testbed.verification.monitor_claims import BOUNDS, monitored
from testbed.verification.pair_claims import SOLVING, Pairs
from testbed.verification.path_bounds import Way
from testbed.verification.path_claims import Ways
from testbed.verification.premise_claims import premises
from testbed.verification.recorded import Recorded, read
from testbed.verification.rows import Rows
from testbed.verification.solutions import solutions

# Every run's claims and their numbers: a premise is judged otherwise than a guarantee.
ALWAYS = {
    "start-safe": "P1", "shared-manoeuvre": "P2", "manoeuvre-in-U": "P3", "manoeuvre-flyable": "P4",
    "gradient": "P5", "off-the-kink": "P6", "separation": "G1", "safe-set": "G2", "barrier-condition": "G3",
    "zcbf-condition": "G4a", "qp-feasibility": "G4", "command-limits": "G5", "rows-satisfied": "G6",
    "goal": "G7", "intervention": "G8",
}  # fmt: skip


def verify(folder: Path) -> list[Finding]:
    """Look into the run in `folder`; UserError if it cannot be read, lacks rows or says nonsense."""
    run = read(folder)
    try:
        return list(_findings(run))
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise UserError(f"{folder} says what no run says: {type(error).__name__}: {error}") from None


def _findings(run: Recorded) -> Iterator[Finding]:
    changed = ", ".join(run.changed)
    yield Finding("files", "as written", "changed" if changed else "as written", not changed, None, changed)
    yield _entries(run)
    flown = fly_on(run.scenario, Pose(run.position, run.vehicles["theta_rad"]), run.i, run.j)
    pairs = Pairs(run, flown) if flown is not None and run.i.size else None
    rows, way = Rows.of(run, pairs), Way.of(run)
    yield from columns(run, way, pairs, rows)
    judged = [*premises(run, pairs), *(pairs.findings() if pairs is not None else _without_pairs(run))]
    judged += [*Ways(run, way).findings(), *filtering(rows), *solutions(rows)]
    if "manoeuvre-keeps-Ds" in run.guarantees:
        judged.append(manoeuvre_keeps(pairs, Judge(run, run.guarantees["manoeuvre-keeps-Ds"])))
    # Premises, then guarantees by number, then what a monitor checked.
    yield from sorted(judged, key=lambda f: (not f.what.startswith("P"), f.what.partition(" ")[0]))
    yield from monitored(rows)


def _entries(run: Recorded) -> Finding:
    """Every claim that such a run is judged by is there, once, and no other."""
    s = run.scenario
    due = dict(ALWAYS)
    if s["checks"]["manoeuvre_instants"] and not run.ended:
        due["manoeuvre-keeps-Ds"] = "G9"
    if s["filter"]["monitor"] and "filter" not in run.parts and s["filter"]["kind"] in SOLVING:
        due |= {f"monitor-{name}": "M" for name in BOUNDS}
    said = [(e["id"], e["number"]) for e in run.entries]
    odd = sorted(
        {name for name, _ in set(due.items()) ^ set(said)} | {n for n, _ in said if said.count((n, _)) > 1}
    )
    return Finding("entries", f"{len(said)} claims", f"{len(due)} claims", not odd, None, ", ".join(odd))


def _without_pairs(run: Recorded) -> Iterator[Finding]:
    """Claims on h where there is none, or none that we know."""
    for name in ("gradient", "off-the-kink", "safe-set", "barrier-condition", "zcbf-condition"):
        if name in run.guarantees:
            judge = Judge(run, run.guarantees[name])
            if run.i.size:
                yield judge.done("unknown", None, True, "a manoeuvre that we do not fly")
            else:
                yield judge.nothing("nobody else")
