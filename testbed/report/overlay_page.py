"""Writes the loops of several airframes over each other: figures, a table, and one page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.records.checksums import plain
from testbed.records.store import write_json
from testbed.report import overlay_figures, settings
from testbed.report.blocks import OPEN, Block, Part, Section, Table
from testbed.report.folder_files import attached, json_of, pictures
from testbed.report.page import reported
from testbed.report.style import drawing, save

if TYPE_CHECKING:
    from aircraft.datasheets.overlay import Compared

DATA_FILE, TABLE_FILE = "overlay.json", "overlay.csv"
_WHAT = "The {} loop broken at the plant input: Bode, Nyquist, and the step that it flies"


def write(found: Sequence[Compared], out: Path, command: str, overwrite: bool = False) -> None:
    """`out`/overlay.csv, overlay.json, report.html and a figure for each loop; UserError if it is taken."""
    with reported(out, part, overwrite) as folder:
        write_into(found, folder, command)


def write_into(found: Sequence[Compared], folder: Path, command: str) -> list[str]:
    """The same files in a folder that is there, without the page; the names of the figures."""
    import pandas as pd

    from aircraft.datasheets.overlay import rows
    from testbed.components.versions import versions

    listed = [plain(row) for row in rows(found)]
    pd.DataFrame(listed).to_csv(folder / TABLE_FILE, index=False)
    with drawing():
        drawn = overlay_figures.figures(found)
        for name, figure in drawn.items():
            save(figure, folder, f"overlay-{name}")
    data: dict[str, Any] = {"command": command, "versions": versions(), "rows": listed}
    data |= {"airframes": {c.airframe.name: c.airframe.fingerprint() for c in found}}
    write_json(folder / DATA_FILE, data | {"figures": [f"overlay-{name}" for name in drawn]})
    return [f"overlay-{name}" for name in drawn]


def shown(found: Sequence[Compared]) -> list[dict[str, Any]]:
    """The table as a terminal shows it: a row for each loop of each airframe, "unstable" where it is."""
    from aircraft.datasheets.overlay import rows

    made = []
    for row in rows(found):
        listed = {"loop": row["loop"], "airframe": row["airframe"], "m/s": row["v_mps"]}
        margins = {"dB": ("gain_db", ".1f"), "deg": ("phase_deg", ".0f"), "disk": ("disk", ".2f")}
        for head, (name, form) in (margins | {"rad/s": ("crossover", ".2g")}).items():
            listed[head] = f"{row[name]:{form}}" if row["stable"] else "unstable" if head == "dB" else ""
        listed["by"] = "flight" if row["transfer"] == "flown" else "model"
        if "t63" in row:
            listed |= {"t63 s": f"{row['t63']:.2f}", "over %": f"{100 * row['overshoot']:.0f}"}
        made.append(listed)
    return made


def blocks(folder: Path) -> list[Block]:
    """What a page shows of these files, if the folder has them."""
    if not (folder / DATA_FILE).is_file():
        return []
    data = json_of(folder / DATA_FILE)
    made: list[Block] = []
    for name in data["figures"]:
        what = _WHAT.format(name.removeprefix("overlay-"))
        made += pictures(folder, (name,), what, folder / TABLE_FILE, data["rows"])
    return [*made, Table(data["rows"], "Margins and steps", downloads=attached(folder / TABLE_FILE))]


def part(folder: Path, title: str) -> Part:
    """The account of airframes or gains that were compared."""
    data = json_of(folder / DATA_FILE)
    names = list(data["airframes"])
    shaky = sorted({row["airframe"] for row in data["rows"] if not row["stable"]})
    return Part(
        title=title,
        what=f"Made by {data['command']}",
        status=OPEN,
        headline=f"{len(names)} autopilots over each other: {', '.join(names)}",
        details=[f"Unstable: {', '.join(shaky)}."] if shaky else [],
        sections=[
            Section("Loops and steps", blocks(folder)),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )
