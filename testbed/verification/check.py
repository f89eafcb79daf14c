"""Every claim of a run that its recorded positions and commands can decide, decided again.

Where everything was recorded, values must agree to rounding. Where recording was thinned, the recorded
instants bound a value from one side and what flight can do in between from the other; a verdict that both
ends allow agrees, one between them is said to be open.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from testbed.errors import UserError
from testbed.verification.columns import columns
from testbed.verification.filter_claims import Rows
from testbed.verification.finding import OTHER, Finding, Judge
from testbed.verification.future import Pose, fly_on
from testbed.verification.manoeuvre_claim import manoeuvre_keeps
from testbed.verification.monitor_claims import BOUNDS, monitored
from testbed.verification.pair_claims import Pairs
from testbed.verification.premise_claims import premises
from testbed.verification.recorded import Recorded, read
from testbed.verification.way import Way
from testbed.verification.way_claims import Ways

ALWAYS = (
    "start-safe", "shared-manoeuvre", "manoeuvre-in-U", "manoeuvre-flyable", "gradient", "off-the-kink",
    "separation", "safe-set", "barrier-condition", "zcbf-condition", "qp-feasibility", "command-limits",
    "rows-satisfied", "goal", "intervention",
)  # fmt: skip


def verify(folder: Path) -> list[Finding]:
    """Look into the run in `folder`; UserError if it cannot be read, lacks rows or says nonsense."""
    run = read(folder)
    try:
        return list(_findings(run, folder))
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise UserError(f"{folder} says what no run says: {type(error).__name__}: {error}") from None


def _findings(run: Recorded, folder: Path) -> Iterator[Finding]:
    changed = ", ".join(run.changed)
    yield Finding("files", "as written", "changed" if changed else "as written", not changed, None, changed)
    yield _entries(run, folder)
    flown = fly_on(run.scenario, Pose(run.position, run.vehicles["theta_rad"]), run.i, run.j)
    pairs = Pairs(run, flown) if flown is not None and run.i.size else None
    rows, way = Rows.of(run, pairs), Way.of(run)
    yield from columns(run, way, pairs, rows)
    judged = [*premises(run, pairs), *(pairs.findings() if pairs is not None else _without_pairs(run))]
    judged += [*Ways(run, way).findings(), *rows.findings()]
    if "manoeuvre-keeps-Ds" in run.guarantees:
        judged.append(manoeuvre_keeps(pairs, Judge(run, run.guarantees["manoeuvre-keeps-Ds"])))
    # Premises, then guarantees by number, then what a monitor checked.
    yield from sorted(judged, key=lambda f: (not f.what.startswith("P"), f.what.partition(" ")[0]))
    yield from monitored(rows)


def _entries(run: Recorded, folder: Path) -> Finding:
    """Every claim that such a run is judged by is there, once, and no other."""
    s = run.scenario
    due = list(ALWAYS)
    if s["checks"]["manoeuvre_instants"] and not run.ended:
        due.append("manoeuvre-keeps-Ds")
    if (
        s["filter"]["monitor"]
        and "filter" not in run.parts
        and s["filter"]["kind"] in ("centralised", "limited")
    ):
        due += [f"monitor-{name}" for name in BOUNDS]
    said = [e["id"] for e in json.loads((folder / "guarantees.json").read_text(encoding="utf-8"))]
    odd = sorted(set(due) ^ set(said)) + sorted({name for name in said if said.count(name) > 1})
    return Finding("entries", f"{len(said)} claims", f"{len(due)} claims", not odd, None, ", ".join(odd))


def _without_pairs(run: Recorded) -> Iterator[Finding]:
    """Claims on h where there is none, or none that we know."""
    for name in ("gradient", "off-the-kink", "safe-set", "barrier-condition", "zcbf-condition"):
        if name in run.guarantees:
            judge = Judge(run, run.guarantees[name])
            if run.i.size:
                yield judge.done("unknown", None, True, "a manoeuvre that we do not fly")
            else:
                judge.expect("value", judge.entry["value"], None)
                judge.expect("verdict", judge.entry["verdict"], OTHER)
                yield judge.done("nobody else")
