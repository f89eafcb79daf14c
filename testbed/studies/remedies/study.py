"""Flies remedies at equal seeds and writes their tables, figure and page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from testbed.campaigns import named_remedies
from testbed.campaigns.journal import journal_beside
from testbed.components.components import Parts
from testbed.components.initial_conditions import generators, places
from testbed.components.installed_parts import effective
from testbed.components.remedies import FOR_ANY_FILTER
from testbed.errors import UserError, nearest
from testbed.records.store import check_free, write_json
from testbed.report.page import reported
from testbed.scenario.scenario import Scenario
from testbed.statistics import Rate
from testbed.studies.common.found import Found, provenance, titled
from testbed.studies.common.measure import default_starts
from testbed.studies.remedies import figures, page, remedies

if TYPE_CHECKING:
    pass


def compare(
    s: Scenario,
    seeds: range,
    only: list[str],
    out: Path,
    workers: int | None,
    overwrite: bool,
    parts: Parts | None = None,
) -> Found:
    """Remedies on `s` at equal seeds: runs.csv, remedies.csv, figure.

    only   names of the remedies to fly; empty flies all, with a filter of the user's own those that the
           testbed applies to any filter
    parts  of the user's own, in every run
    """
    check_free(out, overwrite)
    s = default_starts(s)
    known = named_remedies.catalogue(s)
    if unknown := [name for name in only if name not in known]:
        raise UserError(f"--only {unknown[0]!r}: unknown remedy; {nearest(unknown[0], known)}")
    own_filter = "filter" in effective(s, parts).own()
    usual = [name for name, fields in known.items() if not own_filter or fields.keys() <= FOR_ANY_FILTER]
    chosen = {name: known[name] for name in (only or usual)}
    with journal_beside(out, "remedies") as kept:
        runs = remedies.compare(s, chosen, seeds, kept, workers, parts)
        table = remedies.table(runs, _straight(s))
        with reported(out, page.part, overwrite) as folder:
            runs.to_csv(folder / "runs.csv", index=False)
            table.to_csv(folder / "remedies.csv", index=False)
            write_json(
                folder / "remedies.json", {"seeds": [seeds[0], seeds[-1]]} | provenance(s, s.plant, parts)
            )
            figures.remedies(table, s.d_safe_m, folder)
    rows = [
        {
            "remedy": r.remedy,
            "lost": f"{r.violations}/{r.n}",
            "distinct": int(r.distinct),
            "95 % interval": f"{100 * r.rate_low:.1f}-{100 * r.rate_high:.1f} %",
            "d [m]": round(r.least_distance_m, 2),
            "h [m]": round(r.least_h_m, 2),
            "no QP": int(r.infeasible_steps),
            "arrived": f"{r.arrived}/{r.n}",
            "path %": round(100 * r.path_cost, 1),
            "delay [s]": round(r.goal_delay_s, 2),
        }
        for r in table.itertuples()
    ]
    title = f"{titled(s, parts)}: remedies, seeds {seeds[0]} to {seeds[-1]}, Ds {s.d_safe_m:g} m"
    return Found(out, title, rows, [f"intervals of rates: {Rate.method}"])


def _straight(s: Scenario) -> float:
    """Mean length of the undisturbed way to the goal radius [m]."""
    start, goal = places(s, generators(s.seed)["start"])
    position = start.array()[:, [0, 1, 3]]
    return float(((position - goal) ** 2).sum(axis=-1).mean() ** 0.5) - s.goal_radius_m
