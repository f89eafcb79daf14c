"""Flies the central table and writes it with its figure and page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from testbed.campaigns.journal import journal_beside
from testbed.components import catalogue
from testbed.components.versions import versions
from testbed.records.store import check_free, write_json
from testbed.report.page import reported
from testbed.statistics import Rate
from testbed.studies.answer import answer as answers
from testbed.studies.answer import figures, page
from testbed.studies.common.found import Found


def answer(
    airframes: list[str],
    vehicles: dict[int, range],
    out: Path,
    workers: int | None,
    overwrite: bool,
    only: Sequence[str] = (),
    changes: Sequence[str] = (),
) -> Found:
    """The central table: runs.csv (a row per run), answer.csv, answer.md, figure.

    vehicles  numbers of vehicles, and the seeds of each
    only      names of the remedies to fly; empty flies the usual ones
    changes   of every scenario, as --set takes them
    """
    check_free(out, overwrite)
    made = answers.cases(airframes, vehicles, only, changes)
    with journal_beside(out, "answer") as kept:
        runs = answers.answer(made, vehicles, kept, workers)
        table = answers.table(runs)
        with reported(out, page.part, overwrite) as folder:
            runs.to_csv(folder / "runs.csv", index=False)
            table.to_csv(folder / "answer.csv", index=False)
            (folder / "answer.md").write_text(answers.markdown(table), encoding="utf-8")
            asked: dict[str, Any] = {
                "seeds": {str(n): [k[0], k[-1]] for n, k in vehicles.items()},
                "versions": versions(),
            }
            if changes:
                asked["set"] = list(changes)
            hashes = [catalogue.airframe_hashes(s) for s in made.values()]
            asked["airframes"] = {name: sha for of in hashes for name, sha in of.items()}
            write_json(folder / "answer.json", asked)
            figures.answer(table, folder)
    rows = [
        {
            "fleet": f"{r.number} {r.vehicle}",
            "air": r.weather,
            "remedy": r.remedy,
            "lost": f"{r.lost}/{r.runs}",
            "distinct": r.distinct,
            "95 % interval": f"{100 * r.rate_low:.0f}-{100 * r.rate_high:.0f} %",
            "least [m]": round(r.least_distance_m, 2),
            "arrived": f"{r.arrived}/{r.runs}",
            "vehicles": f"{100 * r.arrived_share:.0f} %",
            "added [s]": round(r.time_added_s, 1),
        }
        for r in table.itertuples()
    ]
    title = f"does the guarantee survive? runs that lose Ds = {answers.d_safe_m():g} m"
    return Found(out, title, rows, [f"intervals of rates: {Rate.method}"])
