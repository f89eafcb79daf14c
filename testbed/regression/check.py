"""Checking a baseline: a block of seeds flown again and judged against what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from testbed.claims.registry import SEPARATION
from testbed.components import catalogue
from testbed.components.components import Parts
from testbed.components.versions import versions
from testbed.errors import UserError
from testbed.regression.baseline import Baseline, read, scenario_of
from testbed.regression.judging import DEGRADED, Finding, findings
from testbed.regression.own_parts import changed_parts, check_given, own_parts
from testbed.regression.recording import AIRCRAFT, UNICYCLE, Runs, fly_rungs
from testbed.regression.staleness import refuse_stale
from testbed.statistics import mean


@dataclass(frozen=True)
class Report:
    """What a check found.

    title   of the table
    lines   what degraded, where to look, what else is new
    """

    title: str
    findings: list[Finding]
    lines: list[str] = field(default_factory=list)

    @property
    def degraded(self) -> bool:
        return any(f.verdict == DEGRADED for f in self.findings)

    def rows(self, every: bool = False) -> list[dict[str, Any]]:
        """The quantities that changed, or all that were compared."""
        chosen = [f for f in self.findings if every or f.verdict or f.quantity.name == SEPARATION.id]
        return [f.row() for f in chosen]

    def as_dict(self) -> dict[str, Any]:
        found = [f.as_dict() for f in self.findings]
        return {"title": self.title, "degraded": self.degraded, "quantities": found, "lines": self.lines}

    def text(self, every: bool = False, width: int = 110) -> str:
        """The table and the lines, as the command prints them."""
        from io import StringIO

        from rich.console import Console

        from testbed.report.tables import plain_table

        into = StringIO()
        Console(file=into, width=width).print(plain_table(self.title, self.rows(every)))
        return into.getvalue().rstrip() + "\n" + "\n".join(self.lines)


def check(
    where: Path,
    name: str,
    *,
    block: int = 1,
    overrides: Sequence[str] = (),
    workers: int | None = None,
    parts: Parts | None = None,
) -> Report:
    """Fly block `block` of baseline `name` in folder `where`, and judge it.

    block      recorded blocks are compared run by run with what the same seeds gave; a later one is fresh
               and compared with all recorded runs
    parts      of the user's own: needed where the baseline was recorded with some; a changed one is named
    overrides  FIELD=VALUE: what would become of the baseline with these changed
    Raises     UserError if there is no such baseline, its scenario changed, or an airframe's derived numbers
               are stale
    """
    if block < 1:
        raise UserError(f"--block {block}: blocks count from 1")
    b = read(where, name)
    s = scenario_of(b.source, [*b.overrides, *overrides], where) if overrides else b.scenario
    first = (block - 1) * b.seeds
    refuse_stale(s)
    own = own_parts(s, parts)
    check_given(name, b.parts, own)
    now = fly_rungs(s, b.rungs, range(first + 1, first + b.seeds + 1), workers, parts, b.requirements)
    paired = block <= b.blocks
    recorded: Runs = b.runs
    if paired:
        part = slice(first, first + b.seeds)
        recorded = {rung: {q: v[part] for q, v in of.items()} for rung, of in b.runs.items()}
    found = findings(b.quantities, recorded, now, b.tolerances, paired)
    kind = "recorded" if paired else "fresh"
    title = f"{name}: {kind} seeds {first + 1} to {first + b.seeds}, {len(found)} quantities compared"
    flown = catalogue.airframe_hashes(s.model_copy(update={"plant": "jsbsim"}))
    lines = [f.sentence() for f in found if f.verdict] + _where(found, paired) + _price(recorded, now)
    news = changed_parts(b.parts, own) + _news(b, flown)
    return Report(title, found, lines + news + [_verdict(name, found)])


def _where(found: list[Finding], paired: bool) -> list[str]:
    """Whether unicycles on the same seeds changed too says where the cause is."""
    bad = {f.rung for f in found if f.verdict == DEGRADED}
    if not bad or not paired or not any(f.rung == UNICYCLE for f in found):
        return []
    if all(abs(f.change.worse) <= f.quantity.resolution for f in found if f.rung == UNICYCLE):
        return ["unicycles fly as recorded: look at the aircraft, its autopilot or the flight dynamics"]
    return ["unicycles fly otherwise too: look at the filter, the nominal controller or the scenario"]


def _price(recorded: Runs, now: Runs) -> list[str]:
    """What the aircraft costs in distance against unicycles from the same starts, then and now."""
    if not {UNICYCLE, AIRCRAFT} <= now.keys():
        return []
    then, today = (
        mean(runs[AIRCRAFT][SEPARATION.id] - runs[UNICYCLE][SEPARATION.id], np.random.default_rng(0))
        for runs in (recorded, now)
    )
    return [f"least distance, aircraft minus unicycle [95 %]: recorded {then} m, now {today} m"]


def _news(b: Baseline, flown: dict[str, str]) -> list[str]:
    """Airframes and packages that are not those of the recording: no findings, but likely causes."""
    said = [f"airframe {n}: not as recorded" for n, sha in flown.items() if sha != b.airframes.get(n)]
    here = versions()
    changed = [f"{n} {old} -> {here.get(n)}" for n, old in b.versions.items() if old != here.get(n)]
    return said + ([f"versions since: {', '.join(changed)}"] if changed else [])


def _verdict(name: str, found: list[Finding]) -> str:
    bad = sum(f.verdict == DEGRADED for f in found)
    if bad:
        return f"{name}: {bad} of {len(found)} quantities significantly degraded"
    return f"{name}: no significant degradation"
