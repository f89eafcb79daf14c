"""Makes the part of a page about the paper's figures redrawn."""

from __future__ import annotations

from pathlib import Path

from testbed.report.blocks import (
    KEPT,
    LOST,
    OPEN,
    Block,
    Part,
    Section,
    Table,
)
from testbed.report.folder_files import (
    json_of,
    pictures,
)


def part(folder: Path, title: str) -> Part:
    """The paper's figures redrawn, with their errors at the published points."""
    data = json_of(folder / "figures.json")
    sheets = [f.removesuffix(".png") for f in data["files"] if f.endswith(".png")]
    # The single panels of a figure, fig2a-speed, are on its sheet, fig2.
    names = [n for n in sheets if not any(n != s and n.startswith(s) for s in sheets)]
    blocks: list[Block] = [Table(rows, name.capitalize()) for name, rows in data["tables"].items() if rows]
    rows = data["tables"].get("errors at the published vertices", [])
    within = [r for r in rows if r.get("within")]
    return Part(
        title=title,
        what="The paper's figures, flown again.",
        status=OPEN if not rows else KEPT if len(within) == len(rows) else LOST,
        headline=f"{len(within)} of {len(rows)} published curves met" if rows else f"{len(names)} figures",
        sections=[
            Section("Tables", blocks),
            Section("Figures", [p for n in names for p in pictures(folder, (n,), n, None, [])]),
            Section("Files", [Table([{"file": f} for f in data["files"]])]),
        ],
    )
