"""Scores an airframe's gains on the step specification, and sweeps them with a scenario in the loop."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.campaigns.engine import fly_rows
from testbed.campaigns.journal import Journal, journal_beside
from testbed.errors import UserError
from testbed.records.store import check_free, write_json
from testbed.report.page import reported
from testbed.studies.tuning import figures, page
from testbed.studies.tuning.provenance import changed_gains, fingerprint, provenance_of
from testbed.studies.tuning.sweeps import MOST_POINTS, Point, Sweep, measure

if TYPE_CHECKING:
    import pandas as pd

    from aircraft.airframes.schema import Airframe
    from testbed.scenario.scenario import Scenario


@dataclass
class Tuned:
    """What was found: a table to print, sentences below it, and everything for JSON."""

    title: str
    rows: list[dict[str, Any]]
    lines: list[str] = field(default_factory=list)
    data: dict[str, Any] = field(default_factory=dict)
    met: bool = True


def specification(
    airframe: Airframe, out: Path | None = None, *, command: str = "", overwrite: bool = False
) -> Tuned:
    """Every row of the specification with the airframe's gains, the least margins in place of all.

    out  folder for tune.json, specification.csv and a page; None writes nothing
    """
    from aircraft.autopilots.faults import faults, in_short
    from aircraft.autopilots.specification import evaluate
    from testbed.report import aircraft_tables as tables

    if out is not None:
        check_free(out, overwrite)
    rows = evaluate(airframe)
    missed = [r for r in rows if not r.met]
    line = f"{len(missed)} of {len(rows)} bounds missed" if missed else f"all {len(rows)} bounds met"
    data = {"airframe": airframe.name, "rows": [vars(r) | {"met": r.met} for r in rows]}
    wrong = in_short(faults(airframe))
    data["faults"] = wrong
    shown = tables.specification(tables.worst(rows))
    lines = [*wrong, line]
    if out is not None:
        import pandas as pd

        with reported(out, page.part, overwrite) as folder:
            written = [
                {"case": r.case, "quantity": r.quantity, "value": r.value, "target": r.target, "met": r.met}
                for r in rows
            ]
            pd.DataFrame(written).to_csv(folder / "specification.csv", index=False)
            write_json(folder / "tune.json", provenance_of(command, airframe) | {"rows": written})
        lines.append(f"table and page: {out}")
    return Tuned(f"{airframe.title}: step specification", shown, lines, data, not (missed or wrong))


def sweep(
    airframe: Airframe,
    source: str,
    sweeps: Sequence[Sweep],
    scenario: Scenario | None,
    out: Path,
    *,
    command: str,
    workers: int | None = None,
    overwrite: bool = False,
) -> Tuned:
    """Fly every combination of the swept gains: sweep.csv, plots, tune.json, and gains files with a scenario.

    source  the airframe's name or folder
    """
    from aircraft.airframes.schema import INVERTING
    from aircraft.autopilots.gains import gain_faults
    from aircraft.autopilots.gains import write as write_gains

    check_free(out, overwrite)
    if len({s.gain for s in sweeps}) < len(sweeps):
        raise UserError("--sweep: each gain once")
    grid = list(itertools.product(*(s.values for s in sweeps)))
    if len(grid) > MOST_POINTS:
        raise UserError(f"--sweep: {len(grid)} points; at most {MOST_POINTS}")
    own = changed_gains(airframe, source)
    for values in grid:
        changes = own | dict(zip((s.gain for s in sweeps), values, strict=True))
        if faults := gain_faults(airframe.with_gains(changes)):
            raise UserError(f"--sweep: gains.{faults[0]}")
    prepared = _fields(scenario) if scenario is not None else None
    with (
        journal_beside(out, f"tune-{fingerprint(airframe)}") as book,
        reported(out, page.part, overwrite) as folder,
    ):
        (folder / "gains").mkdir()
        points = []
        for k, values in enumerate(grid):
            gains = own | dict(zip((s.gain for s in sweeps), values, strict=True))
            file = folder / "gains" / f"{k + 1:03d}.toml"
            provenance = {"command": command, "airframe_sha256": airframe.fingerprint()}
            write_gains(file, source, gains, provenance)
            fields = None if prepared is None else json.dumps(prepared | {"airframes": [str(file)]})
            points.append(Point(source, tuple(gains.items()), fields, file))
        rows = _flown(points, prepared, book, workers)
        table = _frame(rows, sweeps)
        table.to_csv(folder / "sweep.csv", index=False)
        files = [f.name for f in figures.draw(table, sweeps, airframe, scenario, folder)]
        records = table.to_dict("records")
        write_json(
            folder / "tune.json",
            provenance_of(command, airframe) | {"rows": records, "files": ["sweep.csv", *files]},
        )
    keep = [s.gain for s in sweeps] + ["missed", "omega_t63_s", "omega_overshoot", "phase_margin_deg"]
    # The inverting autopilot is judged by when the speed has settled, the others by 63 %.
    speed = "v_settling_s" if airframe.autopilot == INVERTING else "v_t63_s"
    keep += ["min_distance_m", "min_h_m"] if scenario is not None else [speed, "zeta_t63_s"]
    shown = [{k.split(".")[-1] if "." in k else k: row.get(k) for k in keep} for row in records]
    title = f"{airframe.title}: " + ", ".join(s.gain for s in sweeps)
    title += f" in {scenario.name}" if scenario is not None else ""
    return Tuned(title, shown, [f"tables and plots in {out}"], {"folder": str(out), "rows": records})


def _flown(
    points: Sequence[Point], prepared: Mapping[str, Any] | None, book: Journal, workers: int | None
) -> list[dict[str, Any]]:
    """Rows of the points in order, those of an interrupted sweep taken from the notebook."""

    keys = [json.dumps([p.gains, prepared]) for p in points]  # not where its gains file lies

    def said(p: Point, row: dict[str, Any]) -> str:
        gains = ", ".join(f"{name} {value:.4g}" for name, value in p.gains)
        return gains + (f": {row['min_distance_m']:.2f} m" if "min_distance_m" in row else "")

    return fly_rows(measure, points, keys, book, workers, said)


def _frame(rows: list[dict[str, Any]], sweeps: Sequence[Sweep]) -> pd.DataFrame:
    import pandas as pd

    table = pd.DataFrame(rows)
    first = [s.gain for s in sweeps]
    return table[[*first, *(c for c in table.columns if c not in first)]]


def _fields(scenario: Scenario) -> dict[str, Any]:
    fields: dict[str, Any] = scenario.model_dump(mode="json", exclude_unset=True)
    return fields | {"plant": "jsbsim"}
