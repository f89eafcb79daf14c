"""Makes the part of a page about swept or optimised gains."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from testbed.report import overlay_page, settings
from testbed.report.blocks import (
    KEPT,
    LOST,
    OPEN,
    Block,
    Listing,
    Part,
    Section,
    Table,
    download,
)
from testbed.report.folder_files import (
    attached,
    csv_text,
    finite,
    json_of,
    pictures,
    text_of,
)


def part(folder: Path, title: str) -> Part:
    """The account of scored, swept or optimised gains."""
    data = json_of(folder / "tune.json")
    rows = data["rows"]
    blocks: list[Block] = []
    if (folder / "sweep.csv").is_file():
        text, status = f"{len(rows)} sets of gains flown", OPEN
        # Gains are SECTION.NAME, parameters of an autopilot begin with a capital; scores are neither.
        varied = {name for row in rows for name in row if "." in name or name[:1].isupper()}
        # Gains with which the airframe could not fly have no count.
        scored = [r for r in rows if finite(r.get("missed")) == finite(r.get("missed"))]
        fewest: dict[str, Any] = min(scored, key=lambda r: finite(r["missed"]), default={})
        where = ", ".join(f"{name} {value:.4g}" for name, value in fewest.items() if name in varied)
        details = (
            [f"The fewest bounds of the step specification are missed at {where}: {fewest['missed']:.0f}."]
            if fewest
            else ["With none of these gains the airframe could fly the steps."]
        )
        blocks += pictures(
            folder,
            ("sweep",),
            "Scores, margins and the guarantee against the gain",
            folder / "sweep.csv",
            rows,
        )
        sheet = attached(folder / "sweep.csv")
    else:
        missed = sum(not r["met"] for r in rows)
        status = LOST if missed else KEPT
        text = (
            f"{missed} of {len(rows)} bounds missed"
            if missed
            else f"All {len(rows)} bounds of the step specification met"
        )
        details = [f"{said[0].upper()}{said[1:]}." for said in data.get("lags_said", [])]
        file = folder / "specification.csv"
        sheet = attached(file) or download("CSV", file.name, csv_text(rows))
    bad = frozenset(k for k, r in enumerate(rows) if r.get("met") is False)
    blocks.append(
        Table(rows, "A row per set of gains" if "met" not in rows[0] else "The specification", bad, sheet)
    )
    blocks += overlay_page.blocks(folder)
    if data.get("lags"):
        blocks.append(Table(data["lags"], "Lags identified on step responses [s], before and after"))
    gains = folder / "gains.toml"
    if gains.is_file():
        blocks.append(Listing("gains.toml", text_of(gains)))
    return Part(
        title=title,
        what=f"Made by {data['command']}",
        status=status,
        headline=text,
        details=details,
        sections=[Section("Tuning", blocks), Section("Settings and provenance", settings.of_study(data))],
    )
