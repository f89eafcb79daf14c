"""Makes the part of a page about a run's exported tables."""

from __future__ import annotations

from pathlib import Path

from testbed.claims.registry import SEPARATION
from testbed.records.verdict import Status
from testbed.report import settings
from testbed.report.blocks import (
    KEPT,
    LOST,
    OPEN,
    Block,
    Note,
    Part,
    Section,
    Table,
    read_csv,
)
from testbed.report.folder_files import (
    about,
    attached,
    json_of,
    text_of,
)

# Rows of a long table on the page; its file has them all.
SHOWN_ROWS = 5


def part(folder: Path, title: str) -> Part:
    """A run's tables as CSV: what happened, what the columns mean, and the beginning of each table."""
    data = json_of(folder / "export.json")
    events = read_csv(text_of(folder / "events.csv"))
    columns = read_csv(text_of(folder / "columns.csv"))
    names = [name for name in ("vehicles", "pairs", "fences") if (folder / f"{name}.csv").is_file()]
    guarantee = next(g for g in data["guarantees"] if g["id"] == SEPARATION.id)
    said = guarantee["verdict"] + (f", {guarantee['value']:.3f} m" if guarantee["value"] is not None else "")
    return Part(
        title=title,
        what=about(data["run"], "a run's tables as CSV"),
        status={Status.HOLDS: KEPT, Status.VIOLATED: LOST}.get(guarantee["verdict"], OPEN),
        headline=f"Separation: {said}",
        details=[f"{len(events)} events; testbed report RUN has the scorecard and the playback."],
        sections=[
            Section("Events", [Table(events, downloads=attached(folder / "events.csv")) if events else NONE]),
            Section("Tables", [_beginning(folder, name) for name in names]),
            Section("Columns", [Table(columns, downloads=attached(folder / "columns.csv"))]),
            Section("Settings and provenance", settings.of_study(data["run"])),
        ],
    )


NONE = Note("No event occurred.")


def _beginning(folder: Path, name: str) -> Block:
    """The first rows of a table of the folder, and how many there are."""
    path = folder / f"{name}.csv"
    text = text_of(path)
    count = max(0, text.count("\n") - 1)
    rows = read_csv("".join(text.splitlines(keepends=True)[: SHOWN_ROWS + 1]))
    shown = f", the first {SHOWN_ROWS} of {count} rows" if count > SHOWN_ROWS else ""
    files = attached(path)
    return Table(
        rows, path.name + shown + ("" if files else "; too long to travel in this page"), downloads=files
    )
