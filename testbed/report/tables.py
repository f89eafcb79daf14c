"""Scorecards as text: guarantee by plant, fitting 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from math import degrees
from typing import Any

from rich.table import Table
from rich.text import Text

from testbed.records.run import Run

# Achieved channel -> unit shown, and its size in the unit recorded.
CHANNELS = (("v_mps", "m/s", 1.0), ("omega_radps", "deg/s", degrees(1.0)), ("zeta_mps", "m/s", 1.0))
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
    # Text, for rich reads markup into brackets and a unit would vanish.
    table = Table(title=Text(title), title_justify="left", pad_edge=False, padding=(0, 1), box=None)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    for name in columns:
        # Where a terminal is narrow words break at spaces, headings too, and numbers never.
        heading = Text(name.replace("_", " "))
        if any(isinstance(row.get(name), str) for row in rows):
            table.add_column(heading)
            continue
        width = max(len(_short(row.get(name))) for row in rows)
        broken = textwrap.fill(str(heading), width, break_long_words=False)
        table.add_column(Text(broken), no_wrap=True)
    for row in rows:
        table.add_row(*(Text(_short(row.get(name))) for name in columns))
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
    for line in further(entry):
        text.append(f"\n{line}", style="dim")
    return text


def further(entry: dict[str, Any]) -> list[str]:
    """What an entry reports beside its value: rates flown, surfaces at their stops, path and time added."""
    detail, lines = entry["detail"], []
    for name, unit, factor in CHANNELS:
        if ends := detail.get(f"achieved_{name}"):
            low, high = (factor * end for end in ends)
            lines.append(f"flown {name.partition('_')[0]} {low:.1f} to {high:.1f} {unit}")
    if shares := detail.get("share_at_stop"):
        surfaces = {name: share for name, share in shares.items() if not name.startswith("limited")}
        worst = max(surfaces, key=lambda name: surfaces[name])
        lines.append(f"at a stop: {worst} {100 * surfaces[worst]:.1f} % of the time")
    for name, what, unit in (("path_added_m", "path", "m"), ("time_added_s", "time", "s")):
        known = [value for value in detail.get(name, []) if value is not None]
        if known:
            lines.append(f"{what} added {max(known):+.2f} {unit} at most")
    return lines


def number(value: float) -> str:
    """Three decimals; no minus before a zero."""
    return str(value) if isinstance(value, int) else f"{round(value, 3) + 0.0:.3f}"
