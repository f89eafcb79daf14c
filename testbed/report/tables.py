"""Prints scorecards as text: a row per claim, a column per plant, within 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from math import degrees
from typing import Any

from rich.table import Table
from rich.text import Text

from testbed.records.run import Run
from testbed.records.verdict import Kind, Status, Verdict
from testbed.report.own_parts import origins, sentence

# Achieved channel -> unit shown, and its size in the unit recorded.
CHANNELS = (("v_mps", "m/s", 1.0), ("omega_radps", "deg/s", degrees(1.0)), ("zeta_mps", "m/s", 1.0))
# A mark as well as a colour: some readers and all pipes see no colours.
MARKS = {
    Status.HOLDS: ("+", "green"),
    Status.VIOLATED: ("x", "bold red"),
    Status.PREMISE_NOT_MET: ("?", "yellow"),
    Status.NOT_APPLICABLE: ("-", "dim"),
    Status.OPEN: ("?", "yellow"),
}


# Of more runs a table shows marks and values alone, a row per run: for the rest there is no room.
FULL = 3
NOT_APPLICABLE = "~"


def scorecard(runs: Mapping[str, Run], title: str) -> Table:
    """One row per claim, one column per run: value, status, worst instant and vehicles.

    Premises that every run met are named in the caption, and so are parts of the user's own; the other
    premises have rows. Of more than three runs: one row per run, one column per claim, each cell a mark and
    the value.
    """
    told, met = [], []
    claims = {v.id: v for run in runs.values() for v in run.guarantees}
    for first in claims.values():
        verdicts = [next((v for v in run.guarantees if v.id == first.id), None) for run in runs.values()]
        statuses = {v.status for v in verdicts if v is not None}
        if first.kind is Kind.PREMISE and Status.PREMISE_NOT_MET not in statuses:
            met += [first.id] if statuses == {Status.HOLDS} else []
            continue
        told.append((first, verdicts))
    premises = ["premises met: " + ", ".join(met)] if met else []
    if len(runs) > FULL:
        return _of_many(list(runs), [run.manifest for run in runs.values()], told, title, premises)
    table = Table(title=title, title_justify="left", caption_justify="left", pad_edge=False)
    table.add_column("guarantee", no_wrap=True)
    for name in runs:
        table.add_column(Text(name))
    for first, verdicts in told:
        table.add_row(f"{first.number} {first.id}", *("" if v is None else cell(v) for v in verdicts))
    for name, run in runs.items():
        own = sentence(run.manifest)
        premises += [f"{name}: {own}" if len(runs) > 1 else own] if own else []
    if premises:
        table.caption = Text("\n".join(premises))
    return table


def _of_many(
    names: Sequence[str],
    manifests: Sequence[Mapping[str, Any]],
    told: Sequence[tuple[Verdict, Sequence[Verdict | None]]],
    title: str,
    lines: Sequence[str],
) -> Table:
    """A row per run, numbered, its label below; `told` has the claims, each with the verdict of every run."""
    table = Table(title=title, title_justify="left", caption_justify="left", padding=(0, 1, 0, 0), box=None)
    table.add_column("", no_wrap=True)
    for first, _ in told:
        table.add_column(first.number, overflow="fold")
    for k in range(len(names)):
        cells = (verdicts[k] for _, verdicts in told)
        table.add_row(str(k + 1), *(Text() if v is None else _mark_and_value(v) for v in cells))
    own = dict.fromkeys(said for manifest in manifests for said in origins(manifest).values())
    below = [
        *(f"{k}: {name}" for k, name in enumerate(names, 1)),
        f"+ holds, x violated, ? premise not met or open, {NOT_APPLICABLE} not applicable",
        ", ".join(f"{first.number} {first.id}" for first, _ in told),
        *lines,
        *([f"Parts of the user's own: {'; '.join(own)}"] if own else []),
    ]
    table.caption = Text("\n".join(below))
    return table


def plain_table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Rows as they are, three digits; an absent value is a dash."""
    # As Text: rich would take a unit in brackets for markup and drop it.
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


def cell(verdict: Verdict) -> Text:
    """Status, value, and where the worst was seen."""
    mark, colour = MARKS[verdict.status]
    text = Text(f"{mark} {verdict.status}", style=colour)
    if verdict.value is not None:
        text.append(f"\n{number(verdict.value)} {verdict.unit}".rstrip(), style="default")
        if verdict.instant is not None:
            text.append(f" at {verdict.instant:.3f} s", style="default")
        if verdict.vehicles:
            text.append(f" ({'-'.join(map(str, verdict.vehicles))})", style="default")
    if verdict.status is not Status.HOLDS and verdict.why:
        text.append(f"\n{verdict.why}", style="dim")
    for line in further(verdict):
        text.append(f"\n{line}", style="dim")
    return text


def _mark_and_value(verdict: Verdict) -> Text:
    mark, colour = MARKS[verdict.status]
    value = verdict.value
    # A dash would be read as the value's sign.
    text = Text(NOT_APPLICABLE if verdict.status is Status.NOT_APPLICABLE else mark, style=colour)
    if value is not None:
        digits = 0 if isinstance(value, int) or abs(value) >= 10.0 else 1 if abs(value) >= 1.0 else 2
        said = f"{round(value, digits) + 0.0:.{digits}f}"
        said = f"{value:.0e}".replace("e+0", "e") if abs(value) >= 1e4 else said
        text.append(said.replace("0.", ".") if digits == 2 and float(said) else said, style="default")
    return text


def further(verdict: Verdict) -> list[str]:
    """What a verdict reports beside its value: rates flown, surfaces at their stops, path and time added."""
    detail, lines = verdict.detail, []
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
