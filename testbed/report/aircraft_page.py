"""Writes an airframe's datasheet as one self-contained page."""

from __future__ import annotations

import base64
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.records.checksums import plain
from testbed.records.store import staged, write_json
from testbed.report.aircraft_tables import specification, tables, worst
from testbed.report.style import drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aircraft.datasheets.datasheet import Datasheet

PAGE_FILE, DATA_FILE = "index.html", "datasheet.json"


def write(sheet: Datasheet, out: Path, overwrite: bool = False) -> None:
    """`out`/index.html and `out`/datasheet.json. Raises UserError if `out` is taken."""
    with staged(out, overwrite) as folder:
        (folder / PAGE_FILE).write_text(page(sheet), encoding="utf-8")
        write_json(folder / DATA_FILE, sheet.as_dict())


def page(sheet: Datasheet) -> str:
    """The page; equal datasheets give equal bytes."""
    from jinja2 import Environment, PackageLoader

    from testbed.report import aircraft_figures

    with drawing():
        figures = {name: _embedded(f) for name, f in aircraft_figures.all_of(sheet).items()}
    listed = tables(sheet)
    environment = Environment(loader=PackageLoader("testbed.report"), autoescape=True, trim_blocks=True)
    environment.filters["cell"] = _cell
    unmet = [row for row in specification(worst(sheet.rows)) if row["met"] == "NO"]
    speeds = sheet.airframe.speeds
    return environment.get_template("aircraft.html").render(
        sheet=sheet,
        airframe=sheet.airframe,
        span=f"{speeds.v_min_mps:g} to {speeds.v_max_mps:g} m/s",
        sections=[(title, rows, figures.get(_figure(title))) for title, rows in listed.items()],
        unmet=unmet,
        bad=[c for c in sheet.corners if not c.sustainable],
        least=_least(sheet),
        gains=sheet.airframe.gains,
        degrees=math.degrees,
    )


# Title of a table, up to its first ; -> the plot above it.
_FIGURES = {
    "Steady flight": "trim",
    "Envelope": "envelope",
    "Modes of the airframe, controls fixed": "modes",
    "Loops broken at the plant input": "loops",
    "Step specification": "steps",
    "Identified channels": "channels",
}


def _figure(title: str) -> str:
    return _FIGURES.get(title.split(";")[0], "")


def _least(sheet: Datasheet) -> dict[str, float] | None:
    """The smallest margins of any loop at any speed, and the largest disagreement; None without margins."""
    if sheet.unstable or not sheet.loops:
        return None
    return {
        "gain_db": min(x.model.gain_db for x in sheet.loops),
        "phase_deg": min(x.model.phase_deg for x in sheet.loops),
        "disk": min(x.model.disk for x in sheet.loops),
        "off_db": max(x.off_db for x in sheet.loops),
        "off_deg": max(x.off_deg for x in sheet.loops),
    }


def _embedded(figure: Figure) -> str:
    from matplotlib import pyplot as plt

    image = io.BytesIO()
    figure.savefig(image, format="svg", metadata={"Date": None})
    plt.close(figure)
    return "data:image/svg+xml;base64," + base64.b64encode(image.getvalue()).decode()


def _cell(value: Any) -> str:
    value = plain(value)
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
