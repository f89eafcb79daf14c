"""Makes a margin's part of a page."""

from __future__ import annotations

from pathlib import Path

from testbed.report import settings
from testbed.report.blocks import (
    KEPT,
    LOST,
    OPEN,
    Part,
    Section,
    Table,
)
from testbed.report.folder_files import (
    about,
    attached,
    json_of,
    pictures,
)


def part(folder: Path, title: str) -> Part:
    """The smallest setting of a knob that meets a rate."""
    data = json_of(folder / "margin.json")
    rows = [
        {"stage": p["stage"], f"{data['knob']} [{data['unit']}]": p["setting"]} | p for p in data["points"]
    ]
    for row in rows:
        del row["setting"]
    found, knob = data["setting"], f"{data['knob']}"
    if data["certified"]:
        status, text = KEPT, f"{knob} {found:g} {data['unit']} meets a rate of {data['target_rate']:g}"
        detail = f"No run lost on fresh seeds; the rate is below {data['bound']:.4f} with 95 % confidence."
    elif found is None:
        status, text = LOST, f"No setting of {knob} meets a rate of {data['target_rate']:g}"
        detail = "Every setting swept loses more runs than that."
    else:
        status, text = OPEN, f"{knob}: no setting certified at a rate of {data['target_rate']:g}"
        detail = "A setting met the rate on the sweep's seeds and lost runs on fresh ones."
    return Part(
        title=title,
        what=about(data, f"the smallest setting of {knob}"),
        status=status,
        headline=text,
        details=[data.get("sentence", detail)],
        sections=[
            Section(
                "Margin",
                [
                    *pictures(
                        folder,
                        ("margin",),
                        f"Runs that lose Ds against {knob}, with 95 % Clopper-Pearson intervals",
                        folder / "curve.csv",
                        rows,
                    ),
                    Table(rows, "Settings tried", downloads=attached(folder / "curve.csv")),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )
