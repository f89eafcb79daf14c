"""Flies cells of the answer and writes them with their figure and page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from testbed.studies.answer.cells import Cell, scenarios
from testbed.studies.answer.folders import added
from testbed.studies.common.found import Found


def answer(
    seeds: Mapping[Cell, range],
    out: Path,
    workers: int | None,
    overwrite: bool,
    changes: Sequence[str] = (),
    add: Sequence[Path] = (),
) -> Found:
    """The answer's cells: runs.csv (a row per run), answer.csv (per cell), answer.md, figure, page.

    seeds    the cells to fly, and the seeds of each
    changes  of every scenario, as --set takes them
    add      folders of earlier answers, whose runs are taken over and not flown again
    """
    check_free(out, overwrite)
    made = scenarios(seeds, changes)
    airframes = {name: sha for s in made.values() for name, sha in catalogue.airframe_hashes(s).items()}
    known, airframes = added(add, list(changes), airframes)
    with journal_beside(out, "answer") as kept:
        runs = answers.fly(made, seeds, kept, workers, known)
        table = answers.table(runs)
        with reported(out, page.part, overwrite) as folder:
            runs.to_csv(folder / "runs.csv", index=False)
            table.to_csv(folder / "answer.csv", index=False)
            (folder / "answer.md").write_text(answers.markdown(table), encoding="utf-8")
            asked: dict[str, Any] = {"versions": versions(), "airframes": airframes}
            if changes:
                asked["set"] = list(changes)
            write_json(folder / "answer.json", asked)
            figures.answer(table, folder)
    rows = [
        {
            "fleet": f"{r.number} {r.vehicle} {r.mission}",
            "air": r.weather,
            "remedy; guidance": f"{r.remedy}; {r.guidance}",
            "lost": f"{r.lost}/{r.runs}",
            "95 %": f"{100 * r.rate_low:.0f}-{100 * r.rate_high:.0f} %",
            "least": round(r.least_distance_m, 2),
            "h < 0": f"{r.h_below_0}/{r.runs}",
            "home": f"{100 * r.arrived_share:.0f} %",
        }
        for r in table.itertuples()
    ]
    title = f"does the guarantee survive? runs that lose Ds = {answers.d_safe_m():g} m"
    return Found(out, title, rows, [f"intervals of rates: {Rate.method}; home: vehicles that arrived"])
