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
    """One row per guarantee, one column per plant: value, verdict, worst instant and vehicles."""
    table = Table(title=title, title_justify="left", pad_edge=False)
    table.add_column("guarantee", no_wrap=True)
    for name in runs:
        table.add_column(name)
    first = next(iter(runs.values()))
    for entry in first.guarantees:
        table.add_row(entry["id"], *(cell(run.guarantee(entry["id"])) for run in runs.values()))
    return table


def plain_table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Rows as they are, four digits; an absent value is a dash."""
    table = Table(title=title, title_justify="left", pad_edge=False, box=None)
    for name in rows[0] if rows else ():
        table.add_column(name.replace("_", " "), overflow="fold")
    for row in rows:
        table.add_row(*(_short(value) for value in row.values()))
    return table


def _short(value: Any) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


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
    return str(value) if isinstance(value, int) else f"{value:.3f}"
