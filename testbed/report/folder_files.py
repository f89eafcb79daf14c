"""Turns files of a study's folder into blocks of a page, and rates into words."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.report import embed
from testbed.report.blocks import KEPT, LOST, OPEN, Download, Fact, Picture, download
from testbed.report.own_parts import sentence

Rows = list[dict[str, Any]]


def pictures(folder: Path, names: Sequence[str], what: str, sheet: Path | None, rows: Rows) -> list[Picture]:
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
                svg=embed.inline(text_of(svg)) if svg.is_file() else "",
                image="" if svg.is_file() else embed.image(png),
                downloads=attached(sheet) if sheet else (),
            )
        )
    return made


def attached(path: Path) -> tuple[Download, ...]:
    return download(f"{path.name}", path.name, text_of(path)) if path.is_file() else ()


def csv_text(rows: Rows) -> str:
    import pandas as pd

    return str(pd.DataFrame(rows).to_csv(index=False))


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8-sig")


def json_of(path: Path) -> dict[str, Any]:
    return dict(json.loads(text_of(path)))


def about(data: Mapping[str, Any], study: str) -> str:
    """What a study's or a run's data are about: scenario, plant, fleet, and parts of the user's own."""
    s = data.get("scenario")
    if not s:
        return study
    fleet = f"{s['vehicles']} vehicles, Ds {s['d_safe_m']:g} m"
    own = sentence(data)
    text = f"{s['name']} on {s['plant']}: {study}; {fleet}. {s['description']}"
    return text + (f" {own}." if own else "")


def counts(text: str) -> tuple[int, int]:
    """3/20 (...) -> 3, 20."""
    lost, _, runs = text.split()[0].partition("/")
    return int(lost), int(runs)


def in_words(text: str) -> str:
    return "{} of {}".format(*counts(text))


def rate_fact(name: str, lost: int, runs: int) -> Fact:
    from testbed.statistics import Rate, rate_of

    seen = rate_of(lost, runs)
    bounds = f"{100 * seen.low:.0f} to {100 * seen.high:.0f} %, {Rate.method}"
    text = f"{lost} of {runs} runs lose Ds (95 % interval {bounds})"
    return Fact(name, LOST if lost else KEPT, text, lost / runs if runs else None, rate=True)


def worst(facts: Sequence[Fact]) -> str:
    statuses = {f.status for f in facts}
    return next((s for s in (LOST, OPEN, KEPT) if s in statuses), OPEN)


def finite(value: Any) -> float:
    return float(value) if isinstance(value, int | float) and value == value else float("nan")
