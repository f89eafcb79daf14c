"""Finds the smallest setting of a remedy that meets a rate and writes its table, figure and page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from testbed.campaigns.journal import journal_beside
from testbed.components.components import Parts
from testbed.records.store import check_free, write_json
from testbed.report.page import reported
from testbed.scenario.scenario import Scenario
from testbed.statistics import Rate
from testbed.studies.common.found import Found, hundredths, provenance, titled
from testbed.studies.common.measure import default_starts
from testbed.studies.margin import figures, page
from testbed.studies.margin import margin as margins

if TYPE_CHECKING:
    pass


def margin(
    s: Scenario,
    knob: str,
    target_rate: float,
    seeds: int,
    out: Path,
    workers: int | None,
    overwrite: bool,
    parts: Parts | None = None,
) -> Found:
    """The smallest setting of `knob` that meets the rate: margin.json, curve.csv, figure.

    parts  of the user's own, in every run
    """
    import pandas as pd

    check_free(out, overwrite)
    s = default_starts(s)
    with journal_beside(out, "margin") as kept:
        found = margins.find(s, knob, target_rate, seeds, workers, book=kept, parts=parts)
        curve = pd.DataFrame([vars(p) for p in found.points])
        data = found.as_dict() | {"sentence": margins.sentence(found)}
        with reported(out, page.part, overwrite) as folder:
            curve.to_csv(folder / "curve.csv", index=False)
            write_json(folder / "margin.json", data | provenance(s, s.plant, parts))
            figures.margin(found, folder)
    rows = [
        {
            "stage": p.stage,
            knob: round(p.setting, 4),
            "lost": f"{p.violations}/{p.runs}",
            "distinct": p.distinct,
            "95 % interval": f"{100 * p.rate_low:.1f}-{100 * p.rate_high:.1f} %",
            "d [m]": round(p.least_distance_m, 2),
            "no QP": p.infeasible,
            "path [m]": hundredths(p.path_added_m),
            "time [s]": hundredths(p.time_added_s),
        }
        for p in found.points
    ]
    title = f"{titled(s, parts)}: margin by {knob}, {found.unit}"
    return Found(out, title, rows, [data["sentence"], f"intervals of rates: {Rate.method}"], data)
