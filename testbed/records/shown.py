"""Shows a run where it is printed, in ten lines, and in a notebook, as a table of verdicts and two panels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.records.verdict import Kind, Status, Verdict

if TYPE_CHECKING:
    import pandas as pd

# Sign and colour of a status; the sign tells them apart without colour.
LOOKS = {
    Status.HOLDS: ("✓", "#009E73"),
    Status.VIOLATED: ("✗", "#D55E00"),
    Status.PREMISE_NOT_MET: ("?", "#8a6d00"),
    Status.NOT_APPLICABLE: ("–", "gray"),
    Status.OPEN: ("?", "#8a6d00"),
}
LINES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
WIDTH, HEIGHT, EDGE = 360, 220, 40
# A line of a panel has so many points at most, and a panel so many lines.
MOST_POINTS, MOST_LINES = 400, 50


def title(manifest: Mapping[str, Any]) -> str:
    """Scenario, number of vehicles, plant, filter and seed."""
    s = manifest["scenario"]
    n = s["vehicles"]
    return (
        f"{s['name']}: {n} vehicle{'s' if n > 1 else ''} on {s['plant']}, filter {s['filter']['kind']},"
        f" seed {s['seed']}"
    )


def ending(manifest: Mapping[str, Any]) -> str:
    """Whether the run was flown whole, and until when."""
    s = manifest["scenario"]
    return manifest["ended_early"] or f"flown whole, to {s['duration_s']:g} s"


def text(manifest: Mapping[str, Any], guarantees: Sequence[Verdict], parts: Mapping[str, str]) -> str:
    """A run in ten lines: what was flown, its verdicts by status, and where to find the rest.

    parts  what part it is -> the name of the user's own
    """
    premises = [v for v in guarantees if v.kind is Kind.PREMISE]
    claims = [v for v in guarantees if v.kind is not Kind.PREMISE]
    own = ", ".join(f"{what} {name}" for what, name in parts.items()) or "the scenario's own"
    lines = [title(manifest), f"  run             {ending(manifest)}"]
    lines += [f"  parts           {own}"]
    unmet = [v for v in premises if v.status is not Status.HOLDS]
    met = f"{len(premises) - len(unmet)} of {len(premises)} met"
    lines.append(f"  premises        {met}" + "".join(f"; {v.number} {v.id} {v.status}" for v in unmet))
    for status in Status:
        of = [v for v in claims if v.status is status]
        lines.append(f"  {status.value:15} {_numbers(of) or 'none'}")
    lines.append("  more            .scorecard, .guarantee(id), .vehicles, .pairs, .manifest")
    return "\n".join(lines)


def html(
    manifest: Mapping[str, Any], guarantees: Sequence[Verdict], vehicles: pd.DataFrame, pairs: pd.DataFrame
) -> str:
    """A run for a notebook: a row per claim, least distance over time, paths from above."""
    ds = float(manifest["scenario"]["d_safe_m"])
    rows = "".join(_row(v) for v in guarantees)
    panels = []
    if len(pairs):
        least = pairs.groupby("t_s").distance_m.min()
        times = least.index.to_numpy(dtype=float)
        panels.append(_panel("least distance [m] over time [s]", [(times, least.to_numpy())], level=ds))
    if len(vehicles):
        paths = [(p.x_m.to_numpy(), p.y_m.to_numpy()) for _, p in vehicles.groupby("vehicle")]
        panels.append(_panel("paths, east and north [m]", paths[:MOST_LINES], equal=True))
    head = "".join(
        f"<th>{h}</th>" for h in ("", "claim", "verdict", "value", "bound", "at", "vehicles", "why")
    )
    return (
        f"<div><b>{escape(title(manifest))}</b><br>{escape(ending(manifest))}"
        f"<div>{''.join(panels)}</div><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _numbers(verdicts: Iterable[Verdict]) -> str:
    return ", ".join(f"{v.number} {v.id}{_value(v)}" for v in verdicts)


def _value(v: Verdict) -> str:
    """The value where it says more than the status."""
    if v.value is None or v.status is Status.HOLDS or v.status is Status.NOT_APPLICABLE:
        return ""
    return f" ({_said(v.value, v.unit)})"


def _said(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.4g} {unit}".rstrip()


def _row(v: Verdict) -> str:
    sign, colour = LOOKS[v.status]
    cells = (
        escape(v.number),
        f'<span title="{escape(v.claim)}">{escape(v.id)}</span>',
        f'<span style="color:{colour}">{sign} {escape(v.status.value)}</span>',
        escape(_said(v.value, v.unit)),
        escape(_said(v.bound, v.unit)),
        "" if v.instant is None else f"{v.instant:.3f} s",
        "-".join(map(str, v.vehicles)),
        escape(v.why),
    )
    return "<tr>" + "".join(f"<td>{c}</td>" for c in cells) + "</tr>"


def _panel(
    what: str,
    lines: Sequence[tuple[np.ndarray, np.ndarray]],
    *,
    level: float | None = None,
    equal: bool = False,
) -> str:
    """Lines in a frame, as SVG; `level` is drawn across it, `equal` keeps one scale for both axes."""
    x, y = (np.concatenate([line[k] for line in lines]) for k in (0, 1))
    y = y if level is None else np.append(y, (0.0, level))
    (left, right), (low, high) = _span(x), _span(y)
    across, up = (WIDTH - 2 * EDGE) / (right - left), (HEIGHT - 2 * EDGE) / (high - low)
    if equal:
        across = up = min(across, up)

    def point(a: float, b: float) -> str:
        return f"{EDGE + (a - left) * across:.1f},{HEIGHT - EDGE - (b - low) * up:.1f}"

    drawn = []
    for k, (a, b) in enumerate(lines):
        every = slice(None, None, max(1, -(-len(a) // MOST_POINTS)))
        points = " ".join(point(p, q) for p, q in zip(a[every], b[every], strict=True) if np.isfinite(p + q))
        drawn.append(f'<polyline points="{points}" fill="none" stroke="{LINES[k % len(LINES)]}"/>')
    if level is not None:
        ends = (point(left, level), point(right, level))
        drawn.append(f'<polyline points="{" ".join(ends)}" fill="none" stroke="gray" stroke-dasharray="3"/>')
    end, top = EDGE + (right - left) * across, HEIGHT - EDGE - (high - low) * up
    marks = (
        (EDGE + 8, HEIGHT - EDGE + 14, f"{left:.4g}"),
        (end, HEIGHT - EDGE + 14, f"{right:.4g}"),
        (EDGE - 4, HEIGHT - EDGE, f"{low:.4g}"),
        (EDGE - 4, top, f"{high:.4g}"),
    )
    said = "".join(f'<text x="{a:.1f}" y="{b:.1f}" text-anchor="end">{c}</text>' for a, b, c in marks)
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT}" font-size="10" fill="currentColor" role="img">'
        f'<text x="{EDGE}" y="20">{escape(what)}</text>{said}{"".join(drawn)}</svg>'
    )


def _span(values: np.ndarray) -> tuple[float, float]:
    """Least and largest finite value; a metre or second apart at least."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    return (low, high) if high - low >= 1.0 else (low - 0.5, high + 0.5)
