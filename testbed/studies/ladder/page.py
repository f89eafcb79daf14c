"""Makes the fidelity ladder's part of a page."""

from __future__ import annotations

from pathlib import Path

from testbed.report import settings
from testbed.report.blocks import (
    Part,
    Section,
    Table,
)
from testbed.report.folder_files import (
    about,
    attached,
    counts,
    in_words,
    json_of,
    pictures,
    rate_fact,
    worst,
)


def part(folder: Path, title: str) -> Part:
    """The fidelity ladder: the account rung by rung."""
    data = json_of(folder / "ladder.json")
    rows = data["rows"]
    bottom, top = rows[0], rows[-1]
    facts = [rate_fact(r["rung"], *counts(r["lost"])) for r in rows]
    change = data["distance_m"]["total"]
    sentence = (
        f"From the bottom rung to the top the least distance changes by {change['value']:.2f} m on average"
        f" (95 % interval {change['low']:.2f} to {change['high']:.2f} m, {change['method']})."
        if None not in (change.get("value"), change.get("low"), change.get("high"))
        else ""
    )
    return Part(
        title=title,
        what=about(data, f"the fidelity ladder, {data['seeds']} seeds a rung"),
        status=worst(facts),
        headline=f"Separation lost in {in_words(bottom['lost'])} runs on the lowest rung, {bottom['rung']},"
        f" and in {in_words(top['lost'])} on the highest, all departures together",
        details=[sentence] if sentence else [],
        facts=facts,
        sections=[
            Section(
                "Ladder",
                [
                    Table(
                        rows,
                        "Mean least distance d and h, mean paired differences [95 % interval]. "
                        + data.get("intervals", ""),
                        downloads=attached(folder / "ladder.csv"),
                    ),
                    *pictures(
                        folder,
                        ("ladder",),
                        "Least distance and least h of every run, rung by rung",
                        folder / "ladder.csv",
                        rows,
                    ),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )
