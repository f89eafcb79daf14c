"""Studies of many runs as parts of a report: their tables, figures and settings, and what they found."""

from __future__ import annotations

from pathlib import Path

from testbed.report import settings
from testbed.report.blocks import KEPT, LOST, OPEN, Part, Section, Table, read_csv
from testbed.report.folder_files import (
    about,
    attached,
    counts,
    finite,
    in_words,
    json_of,
    pictures,
    rate_fact,
    text_of,
    worst,
)


def ladder(folder: Path, title: str) -> Part:
    """The fidelity ladder: the account rung by rung."""
    data = json_of(folder / "ladder.json")
    rows = data["rows"]
    bottom, top = rows[0], rows[-1]
    facts = [rate_fact(r["rung"], *counts(r["lost"])) for r in rows]
    change = data["distance_m"]["total"]
    sentence = (
        f"From the bottom rung to the top the least distance changes by {change['value']:.2f} m on average"
        f" (95 % interval {change['low']:.2f} to {change['high']:.2f} m)."
        if change.get("value") is not None
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
                        "Mean least distance d and h, paired differences [95 % interval]",
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


def remedies(folder: Path, title: str) -> Part:
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


def margin(folder: Path, title: str) -> Part:
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
                        f"Runs that lose Ds against {knob}, with 95 % intervals",
                        folder / "curve.csv",
                        rows,
                    ),
                    Table(rows, "Settings tried", downloads=attached(folder / "curve.csv")),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )


def answer(folder: Path, title: str) -> Part:
    """Aircraft, numbers, weather and remedies in one table."""
    data, rows = json_of(folder / "answer.json"), read_csv(text_of(folder / "answer.csv"))
    held = [r for r in rows if r["lost"] == 0]
    facts = [
        rate_fact(f"{r['number']} {r['vehicle']}, {r['weather']}, {r['remedy']}", r["lost"], r["runs"])
        for r in rows
    ]
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
                        "Share of runs that lose Ds, with 95 % intervals",
                        folder / "answer.csv",
                        rows,
                    ),
                    Table(rows, "A row per setting", downloads=attached(folder / "answer.csv")),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )
