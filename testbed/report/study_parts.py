"""Studies of many runs as parts of a report: their tables, figures and settings, and what they found."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.report import embed, settings
from testbed.report.blocks import KEPT, LOST, OPEN, Block, Download, Fact, Listing, Part, Picture, Section, Table
from testbed.report.blocks import download, read_csv

Rows = list[dict[str, Any]]


def ladder(folder: Path, title: str) -> Part:
    """The fidelity ladder: the account rung by rung."""
    data = _json(folder / "ladder.json")
    rows = data["rows"]
    bottom, top = rows[0], rows[-1]
    facts = [_rate_fact(r["rung"], *_counts(r["lost"])) for r in rows]
    change = data["distance_m"]["total"]
    sentence = (
        f"From the bottom rung to the top the least distance changes by {change['value']:.2f} m on average"
        f" (95 % interval {change['low']:.2f} to {change['high']:.2f} m)."
        if change.get("value") is not None
        else ""
    )
    return Part(
        title=title,
        what=_what(data, f"the fidelity ladder, {data['seeds']} seeds a rung"),
        status=_worst(facts),
        headline=f"Runs that lose Ds: {bottom['lost']} on {bottom['rung']}, {top['lost']} on {top['rung']}",
        details=[sentence] if sentence else [],
        facts=facts,
        sections=[
            Section(
                "Ladder",
                [
                    Table(rows, "Mean least distance d and h, paired differences [95 % interval]", downloads=_file(folder / "ladder.csv")),
                    *_pictures(folder, ("ladder",), "Least distance and least h of every run, rung by rung", folder / "ladder.csv", rows),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )


def remedies(folder: Path, title: str) -> Part:
    """Remedies compared at equal seeds."""
    data, rows = _json(folder / "remedies.json"), read_csv(_text(folder / "remedies.csv"))
    facts = [_rate_fact(r["remedy"], r["violations"], r["n"]) for r in rows]
    best = min(rows, key=lambda r: (r["rate"], -_finite(r["median_distance_m"])))
    first = rows[0]
    held = [r["remedy"] for r in rows if r["violations"] == 0]
    text = f"{len(held)} of {len(rows)} settings lose no run" if held else "No setting keeps Ds in every run"
    return Part(
        title=title,
        what=_what(data, f"remedies at equal seeds {data['seeds'][0]} to {data['seeds'][-1]}"),
        status=KEPT if held else LOST,
        headline=text,
        details=[
            f"{first['remedy']}: {first['violations']} of {first['n']} runs lose Ds. Fewest lost: {best['remedy']},"
            f" {best['violations']} of {best['n']}; its median least distance is {_finite(best['median_distance_m']):.2f} m."
        ],
        facts=facts,
        sections=[
            Section(
                "Remedies",
                [
                    *_pictures(folder, ("remedies",), "Runs that lose Ds and least distance, remedy by remedy", folder / "remedies.csv", rows),
                    Table(rows, "A row per remedy", downloads=(*_file(folder / "remedies.csv"), *_file(folder / "runs.csv"))),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )


def margin(folder: Path, title: str) -> Part:
    """The smallest setting of a knob that meets a rate."""
    data = _json(folder / "margin.json")
    rows = [{"stage": p["stage"], f"{data['knob']} [{data['unit']}]": p["setting"]} | p for p in data["points"]]
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
        what=_what(data, f"the smallest setting of {knob}"),
        status=status,
        headline=text,
        details=[detail],
        sections=[
            Section(
                "Margin",
                [
                    *_pictures(folder, ("margin",), f"Runs that lose Ds against {knob}, with 95 % intervals", folder / "curve.csv", rows),
                    Table(rows, "Settings tried", downloads=_file(folder / "curve.csv")),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )


def answer(folder: Path, title: str) -> Part:
    """Aircraft, numbers, weather and remedies in one table."""
    data, rows = _json(folder / "answer.json"), read_csv(_text(folder / "answer.csv"))
    held = [r for r in rows if r["lost"] == 0]
    facts = [
        _rate_fact(f"{r['number']} {r['vehicle']}, {r['weather']}, {r['remedy']}", r["lost"], r["runs"]) for r in rows
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
                    *_pictures(folder, ("answer",), "Share of runs that lose Ds, with 95 % intervals", folder / "answer.csv", rows),
                    Table(rows, "A row per setting", downloads=_file(folder / "answer.csv")),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data)),
        ],
    )


def tune(folder: Path, title: str) -> Part:
    """Swept or optimised gains."""
    data = _json(folder / "tune.json")
    rows = data["rows"]
    blocks: list[Block] = []
    if (folder / "sweep.csv").is_file():
        text, status = f"{len(rows)} sets of gains flown", OPEN
        fewest = min(rows, key=lambda r: _finite(r.get("missed")))
        details = [f"Fewest bounds of the step specification missed at one of them: {fewest.get('missed')}."]
        blocks += _pictures(folder, ("sweep",), "Scores, margins and the guarantee against the gain", folder / "sweep.csv", rows)
        sheet = _file(folder / "sweep.csv")
    else:
        missed = sum(not r["met"] for r in rows)
        status = LOST if missed else KEPT
        text = f"{missed} of {len(rows)} bounds missed" if missed else f"All {len(rows)} bounds of the step specification met"
        details, sheet = [], download("CSV", "specification.csv", _csv(rows))
    bad = frozenset(k for k, r in enumerate(rows) if r.get("met") is False)
    blocks.append(Table(rows, "A row per set of gains" if "met" not in rows[0] else "The specification", bad, sheet))
    gains = folder / "gains.toml"
    if gains.is_file():
        blocks.append(Listing("gains.toml", _text(gains)))
    return Part(
        title=title,
        what=f"Made by {data['command']}",
        status=status,
        headline=text,
        details=details,
        sections=[Section("Tuning", blocks), Section("Settings and provenance", settings.of_study(data))],
    )


def figures(folder: Path, title: str) -> Part:
    """The paper's figures redrawn, with their errors at the published points."""
    data = _json(folder / "figures.json")
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
            Section("Figures", [p for n in names for p in _pictures(folder, (n,), n, None, [])]),
            Section("Files", [Table([{"file": f} for f in data["files"]])]),
        ],
    )


# What a folder's mark says it is -> who accounts for it. Runs and comparisons are in `run_part`.
PARTS: Mapping[str, Callable[[Path, str], Part]] = {
    "ladder.json": ladder,
    "remedies.json": remedies,
    "margin.json": margin,
    "answer.json": answer,
    "tune.json": tune,
    "figures.json": figures,
}


def _pictures(folder: Path, names: Sequence[str], what: str, sheet: Path | None, rows: Rows) -> list[Picture]:
    """Those of the figures the folder has, as SVG where it has that, with their data."""
    made = []
    for name in names:
        svg, png = folder / f"{name}.svg", folder / f"{name}.png"
        if not (svg.is_file() or png.is_file()):
            continue
        made.append(
            Picture(
                name=name,
                caption=f"{what}.",
                alt=f"{what}; {len(rows)} rows, all in the table beside it." if rows else f"{what}.",
                svg=embed.inline(_text(svg), name) if svg.is_file() else "",
                image="" if svg.is_file() else embed.image(png),
                downloads=_file(sheet) if sheet else (),
            )
        )
    return made


def _file(path: Path) -> tuple[Download, ...]:
    return download(f"{path.name}", path.name, _text(path)) if path.is_file() else ()


def _csv(rows: Rows) -> str:
    import pandas as pd

    return str(pd.DataFrame(rows).to_csv(index=False))


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _json(path: Path) -> dict[str, Any]:
    return dict(json.loads(_text(path)))


def _what(data: Mapping[str, Any], study: str) -> str:
    s = data.get("scenario")
    if not s:
        return study
    return f"{s['name']} on {s['plant']}: {study}; {s['vehicles']} vehicles, Ds {s['d_safe_m']:g} m. {s['description']}"


def _counts(text: str) -> tuple[int, int]:
    """3/20 (...) -> 3, 20."""
    lost, _, runs = text.split()[0].partition("/")
    return int(lost), int(runs)


def _rate_fact(name: str, lost: int, runs: int) -> Fact:
    from testbed.statistics import rate_of

    seen = rate_of(lost, runs)
    text = f"{lost} of {runs} runs lose Ds (95 % interval {100 * seen.low:.0f} to {100 * seen.high:.0f} %)"
    return Fact(name, LOST if lost else KEPT, text, lost / runs if runs else None, rate=True)


def _worst(facts: Sequence[Fact]) -> str:
    statuses = {f.status for f in facts}
    return next((s for s in (LOST, OPEN, KEPT) if s in statuses), OPEN)


def _finite(value: Any) -> float:
    return float(value) if isinstance(value, int | float) and value == value else float("nan")
