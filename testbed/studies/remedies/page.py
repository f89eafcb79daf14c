"""Makes the part of a page about remedies compared."""

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
    about,
    attached,
    finite,
    json_of,
    pictures,
    rate_fact,
    text_of,
)


def part(folder: Path, title: str) -> Part:
    """Remedies compared at equal seeds."""
    data, rows = json_of(folder / "remedies.json"), read_csv(text_of(folder / "remedies.csv"))
    facts = [rate_fact(r["remedy"], r["violations"], r["n"]) for r in rows]
    best = min(rows, key=lambda r: (r["rate"], -finite(r["median_distance_m"])))
    first = rows[0]
    held = [r["remedy"] for r in rows if r["violations"] == 0]
    text = f"{len(held)} of {len(rows)} settings lose no run" if held else "No setting keeps Ds in every run"
    return Part(
        title=title,
        what=about(data, f"remedies at equal seeds {data['seeds'][0]} to {data['seeds'][-1]}"),
        status=KEPT if held else LOST,
        headline=text,
        details=[
            f"{first['remedy']}: {first['violations']} of {first['n']} runs lose Ds."
            f" Fewest lost: {best['remedy']}, {best['violations']} of {best['n']};"
            f" its median least distance is {finite(best['median_distance_m']):.2f} m."
        ],
        facts=facts,
        sections=[
            Section(
                "Remedies",
                [
                    *pictures(
                        folder,
                        ("remedies",),
                        "Runs that lose Ds and least distance, remedy by remedy",
                        folder / "remedies.csv",
                        rows,
                    ),
                    Table(
                        rows,
                        "A row per remedy",
                        downloads=(*attached(folder / "remedies.csv"), *attached(folder / "runs.csv")),
                    ),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )
