"""Flies the central table and writes it with its figure and page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from testbed.campaigns.journal import journal_beside
from testbed.components import catalogue
from testbed.components.versions import versions
from testbed.records.store import check_free, write_json
from testbed.report.page import reported
from testbed.statistics import Rate
from testbed.studies.answer import answer as answers
from testbed.studies.answer import figures, page
from testbed.studies.common.found import Found

if TYPE_CHECKING:
    pass


def answer(
    airframes: list[str], vehicles: list[int], seeds: int, out: Path, workers: int | None, overwrite: bool
) -> Found:
    """The central table: answer.csv, answer.md, figure. Fleets of 20 fly a fifth of the seeds, at least 5."""
    check_free(out, overwrite)
    made = answers.cases(airframes, vehicles)
    each = {n: seeds if n == 2 else max(5, seeds // 5) for n in vehicles}
    with journal_beside(out, "answer") as kept:
        table = answers.answer(made, each, kept, workers)
        with reported(out, page.part, overwrite) as folder:
            table.to_csv(folder / "answer.csv", index=False)
            (folder / "answer.md").write_text(answers.markdown(table), encoding="utf-8")
            asked = {"seeds": {str(n): k for n, k in each.items()}, "versions": versions()}
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
        }
        for r in table.itertuples()
    ]
    title = f"does the guarantee survive? runs that lose Ds = {answers.d_safe_m():g} m"
    return Found(out, title, rows, [f"intervals of rates: {Rate.method}"])
