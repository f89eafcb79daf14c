"""Flies the fidelity ladder and writes its tables, figures and page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from testbed.campaigns.journal import journal_beside
from testbed.components.components import Parts
from testbed.components.installed_parts import effective
from testbed.errors import UserError
from testbed.records.store import check_free, write_json
from testbed.report.page import reported
from testbed.scenario.scenario import Scenario
from testbed.statistics import Mean, Rate
from testbed.studies.common.found import Found, flown_with, provenance
from testbed.studies.common.measure import default_starts
from testbed.studies.ladder import figures, page
from testbed.studies.ladder import ladder as ladders

if TYPE_CHECKING:
    import pandas as pd


def ladder(
    s: Scenario,
    seeds: range,
    out: Path,
    workers: int | None,
    overwrite: bool,
    parts: Parts | None = None,
    autopilots: bool = False,
) -> Found:
    """The fidelity ladder of `s`: ladder.csv (a row per run), rungs.csv and ladder.json, figures.

    parts       of the user's own, in every run; UserError for a plant, the rungs have their own
    autopilots  the rungs are sensing and autopilots in place of plants and weather
    """
    if "plant" in effective(s, parts).own():
        raise UserError("--ladder: the rungs have plants of their own; leave out the plant of your own")
    check_free(out, overwrite)
    s = default_starts(s)
    rungs = ladders.autopilot_rungs(s) if autopilots else ladders.rungs(s)
    with journal_beside(out, "ladder") as kept:
        table = ladders.climb(s, rungs, seeds, kept, workers, parts=parts)
        distance = ladders.account(table, rungs, "distance_m")
        h = ladders.account(table, rungs, "h_m")
        lost = ladders.rates(table, rungs)
        rows = [
            {
                "rung": d.rung,
                "lost": _rate(lost[d.rung]),
                "distinct": ladders.distinct_runs(table, d.rung),
                "d [m]": round(d.value, 2),
                "change of d [95 %]": _mean(d.difference),
                "alone": _mean(d.alone),
                "h [m]": round(g.value, 2),
            }
            for d, g in zip(distance.steps, h.steps, strict=True)
        ]
        how = ladders.methods((distance, h))
        data = {"seeds": len(seeds), "first_seed": seeds[0], "rows": rows, "intervals": how} | {
            a.quantity: {"total": vars(a.total), "interaction": vars(a.interaction)} for a in (distance, h)
        }
        with reported(out, page.part, overwrite) as folder:
            table.to_csv(folder / "ladder.csv", index=False)
            ladders.summary(table, rungs).to_csv(folder / "rungs.csv", index=False)
            write_json(folder / "ladder.json", data | provenance(s, "jsbsim", parts))
            figures.ladder(table, distance, h, s.d_safe_m, folder)
    return Found(
        out,
        f"{s.name}{flown_with(s, parts)}: the fidelity ladder, {len(seeds)} seeds"
        " (mean, paired differences [95 % interval])",
        rows,
        [
            f"least distance, top rung against bottom: {distance.total} m;"
            f" interaction of the single effects: {distance.interaction} m",
            f"least h, top rung against bottom: {h.total} m; interaction: {h.interaction} m",
            how,
            *_not_flown(table),
        ],
        data,
    )


def _not_flown(table: pd.DataFrame) -> list[str]:
    refused = table[table.refused != ""]
    if not len(refused):
        return []
    where = ", ".join(f"{count} on {rung}" for rung, count in refused.rung.value_counts(sort=False).items())
    return [f"could not start and are not counted: {where}; for example seed {refused.seed.iloc[0]}"]


def _mean(m: Mean | None) -> str:
    return str(m) if m is not None else ""


def _rate(r: Rate) -> str:
    return f"{r.count}/{r.runs} {100 * r.low:.0f}-{100 * r.high:.0f} %"
