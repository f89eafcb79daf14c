"""Scorecards as text: guarantee by plant, fitting 80 columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table
from rich.text import Text

from testbed.record import Run

# A mark as well as a colour, for eyes and for pipes without colour.
MARKS = {"holds": ("+", "green"), "violated": ("x", "bold red"), "premise not met": ("?", "yellow")}


def scorecard(runs: Mapping[str, Run], title: str) -> Table:
    """One row per guarantee, one column per run: value, verdict, worst instant and vehicles.

    Premises that every run met are named in the caption; the others have rows of their own.
    """
    table = Table(title=title, title_justify="left", caption_justify="left", pad_edge=False)
    table.add_column("guarantee", no_wrap=True)
    for name in runs:
        table.add_column(name)
    met = []
    for entry in next(iter(runs.values())).guarantees:
        entries = [run.guarantee(entry["id"]) for run in runs.values()]
        if entry["number"].startswith("P") and all(e["verdict"] != "premise not met" for e in entries):
            met += [entry["id"]] if all(e["verdict"] == "holds" for e in entries) else []
            continue
        table.add_row(f"{entry['number']} {entry['id']}", *(cell(e) for e in entries))
    if met:
        table.caption = "premises met: " + ", ".join(met)
    return table


def plain_table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Rows as they are, three digits; an absent value is a dash."""
    table = Table(title=title, title_justify="left", pad_edge=False, padding=(0, 1), box=None)
    for name in rows[0] if rows else ():
        # Words stay whole; where a terminal is narrow, headings and long numbers break.
        words = any(isinstance(row[name], str) for row in rows)
        table.add_column(name.replace("_", " "), overflow="fold", no_wrap=words)
    for row in rows:
        table.add_row(*(_short(value) for value in row.values()))
    return table


def _short(value: Any) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return "-"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def cell(entry: dict[str, Any]) -> Text:
    """Value, verdict, and where the worst was met."""
    mark, colour = MARKS.get(entry["verdict"], ("-", "dim"))
    text = Text(f"{mark} {entry['verdict']}", style=colour)
    if entry["value"] is not None:
        text.append(f"\n{number(entry['value'])} {entry['unit']}".rstrip(), style="default")
        if entry["t_s"] is not None:
            text.append(f" at {entry['t_s']:.3f} s", style="default")
        if entry["vehicles"]:
            text.append(f" ({'-'.join(map(str, entry['vehicles']))})", style="default")
    if entry["verdict"] != "holds" and entry["why"]:
        text.append(f"\n{entry['why']}", style="dim")
    return text


def number(value: float) -> str:
    """Three decimals; no minus before a zero."""
    return str(value) if isinstance(value, int) else f"{round(value, 3) + 0.0:.3f}"
