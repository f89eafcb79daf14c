"""Makes the answer's part of a page."""

from __future__ import annotations

from pathlib import Path

from testbed.report import settings
from testbed.report.blocks import (
    KEPT,
    LOST,
    Part,
    Section,
    Table,
    read_csv,
)
from testbed.report.folder_files import (
    attached,
    json_of,
    pictures,
    rate_fact,
    text_of,
)
from testbed.studies.answer.cells import COLUMNS, Cell


def part(folder: Path, title: str) -> Part:
    """Fleets, missions, weather, remedies and guidance in one table."""
    data, rows = json_of(folder / "answer.json"), read_csv(text_of(folder / "answer.csv"))
    held = [r for r in rows if r["lost"] == 0]
    facts = [rate_fact(str(Cell(**{name: r[name] for name in COLUMNS})), r["lost"], r["runs"]) for r in rows]
    return Part(
        title=title,
        what="Does the guarantee survive? Every row one setting flown from common seeded starts.",
        status=KEPT if len(held) == len(rows) else LOST,
        headline=f"{len(held)} of {len(rows)} settings lose no run",
        facts=facts,
        sections=[
            Section(
                "Answer",
                [
                    *pictures(
                        folder,
                        ("answer",),
                        "Share of runs that lose Ds, with 95 % Clopper-Pearson intervals",
                        folder / "answer.csv",
                        rows,
                    ),
                    Table(rows, "A row per setting", downloads=attached(folder / "answer.csv")),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )
