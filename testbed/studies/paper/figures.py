"""Draws figures 2, 3 and 6 of Squires et al. 2022 from runs of the scenarios behind them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from testbed.claims.registry import SEPARATION
from testbed.records.run import Run
from testbed.report.figures import one
from testbed.report.style import COLUMN, PAGE, STYLES, drawing, limits, log_distance, save, separation
from testbed.studies.paper.reproduction import stamp_shift, vertices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Runs = Mapping[str, Run]
# What counts as the zoom of figure 3: the override around 8.2 s.
ZOOM_S = (7.4, 9.0)


def speed(axes: Axes, runs: Runs) -> None:
    """Vehicle 1's speed input."""
    _input(axes, runs, "v", "mps", 1.0)
    box = _scenario(runs)["limits"]
    limits(axes, box["v_min_mps"], box["v_max_mps"])
    axes.set(xlabel="time [s]", ylabel="speed of vehicle 1 [m/s]")


def turn_rate(axes: Axes, runs: Runs) -> None:
    """Vehicle 1's turn rate input."""
    _input(axes, runs, "omega", "radps", 180.0 / np.pi)
    box = _scenario(runs)["limits"]
    limits(axes, -box["omega_max_degps"], box["omega_max_degps"])
    axes.set(xlabel="time [s]", ylabel="turn rate of vehicle 1 [deg/s]")


def climb_rate(axes: Axes, runs: Runs) -> None:
    """Vehicle 1's climb rate input."""
    _input(axes, runs, "zeta", "mps", 1.0)
    box = _scenario(runs)["limits"]
    limits(axes, -box["zeta_max_mps"], box["zeta_max_mps"])
    axes.set(xlabel="time [s]", ylabel="climb rate of vehicle 1 [m/s]")


def climb_rate_zoom(axes: Axes, runs: Runs) -> None:
    """The same around the override, the limits far outside."""
    for name, run in runs.items():
        rows = one(run)
        rows = rows[(rows.t_s >= ZOOM_S[0]) & (rows.t_s <= ZOOM_S[1])]
        _curves(axes, name, run, rows.t_s, rows.zeta_command_mps, rows.zeta_mps)
    axes.set(xlabel="time [s]", ylabel="climb rate of vehicle 1 [m/s]", xlim=ZOOM_S)


def distance(axes: Axes, runs: Runs) -> None:
    """The smallest distance of any pair."""
    for name, run in runs.items():
        smallest = run.pairs.groupby("t_s").distance_m.min()
        least = run.guarantee(SEPARATION.id)["value"]
        axes.plot(smallest.index, smallest, label=f"{name}, least {least:.2f} m", **STYLES[name])
    separation(axes, _scenario(runs)["d_safe_m"])
    axes.set(xlabel="time [s]", ylabel="smallest distance [m]")
    log_distance(axes)


def path(axes: Axes, runs: Runs) -> None:
    """Vehicle 1's path, from its start (dot) to the right."""
    for name, run in runs.items():
        rows = one(run)
        axes.plot(rows.x_m, rows.y_m, label=name, **STYLES[name])
        axes.plot(rows.x_m.iloc[0], rows.y_m.iloc[0], "o", markersize=3, color=STYLES[name]["color"])
    axes.set(xlabel="east [m]", ylabel="north [m]")


@dataclass(frozen=True)
class Panel:
    """One panel: its letter, what it shows, who draws it, and the published vertices that belong on it."""

    letter: str
    shows: str
    draw: Callable[[Axes, Runs], None]
    published: str | None = None


@dataclass(frozen=True)
class PaperFigure:
    """One figure: its series, the scenario behind each, and its panels."""

    name: str
    title: str
    scenarios: dict[str, str]
    panels: tuple[Panel, ...]


FIGURES = (
    PaperFigure(
        "fig2",
        "two vehicles",
        {"turn": "published-2-turn", "straight": "published-2-straight"},
        (
            Panel("a", "speed", speed, "v"),
            Panel("b", "turn-rate", turn_rate, "omega"),
            Panel("c", "distance", distance, "min_distance"),
            Panel("d", "path", path, "path"),
        ),
    ),
    PaperFigure(
        "fig3",
        "two vehicles, one metre below and above",
        {"turn": "published-2-turn-altitude", "straight": "published-2-straight-altitude"},
        (Panel("a", "climb-rate", climb_rate), Panel("b", "climb-rate-zoom", climb_rate_zoom)),
    ),
    PaperFigure(
        "fig6",
        "twenty vehicles",
        {s: f"published-20-{s}" for s in ("turn", "straight", "navigation")},
        (
            Panel("a", "speed", speed),
            Panel("b", "turn-rate", turn_rate),
            Panel("c", "distance", distance),
            Panel("d", "path", path),
        ),
    ),
)


def draw(figure: PaperFigure, runs: Runs, folder: Path) -> list[Path]:
    """Each panel at column width, and all on one sheet, as PNG and PDF.

    runs  series -> a finished run of `figure.scenarios`
    """
    files = []
    with drawing() as plt:
        for panel in figure.panels:
            sheet, axes = plt.subplots(figsize=(COLUMN, 2.4), layout="constrained")
            _draw_panel(axes, panel, runs)
            files += save(sheet, folder, f"{figure.name}{panel.letter}-{panel.shows}")
        rows = (len(figure.panels) + 1) // 2
        sheet, grid = plt.subplots(rows, 2, figsize=(PAGE, 2.5 * rows), layout="constrained")
        plants = {run.manifest["scenario"]["plant"] for run in runs.values()}
        sheet.suptitle(
            f"Figure {figure.name[3:]}: {figure.title}, {' and '.join(sorted(plants))}", fontsize=9
        )
        for axes, panel in zip(np.ravel(grid), figure.panels, strict=True):
            _draw_panel(axes, panel, runs)
            axes.set_title(f"({panel.letter})", loc="left", fontsize=8)
        files += save(sheet, folder, figure.name, dpi=120)
    return files


def _draw_panel(axes: Axes, panel: Panel, runs: Runs) -> None:
    panel.draw(axes, runs)
    if panel.published:
        for series, run in runs.items():
            _published(axes, panel.published, series, run)
        axes.plot([], [], "o", markersize=3, markerfacecolor="none", color="0.3", label="published")
    axes.legend(loc="best")


def _published(axes: Axes, quantity: str, series: str, run: Run) -> None:
    """The published vertices within the run, as circles; their stamps are one step early."""
    points = vertices(quantity, series)
    x = points.x
    if quantity != "path":
        x = x + stamp_shift(run)
        points = points[x <= run.manifest["scenario"]["duration_s"] + stamp_shift(run)]
        x = x[points.index]
    axes.plot(
        x,
        points.y,
        "o",
        markersize=3,
        markerfacecolor="none",
        markeredgewidth=0.6,
        color=STYLES[series]["color"],
    )


def _input(axes: Axes, runs: Runs, channel: str, unit: str, scale: float) -> None:
    for name, run in runs.items():
        rows = one(run)
        command, achieved = rows[f"{channel}_command_{unit}"], rows[f"{channel}_{unit}"]
        _curves(axes, name, run, rows.t_s, scale * command, scale * achieved)


def _curves(
    axes: Axes, name: str, run: Run, t: np.ndarray, command: np.ndarray, achieved: np.ndarray
) -> None:
    """The command; on an aircraft what it achieved, with the command thin beside it."""
    look = STYLES[name]
    if run.manifest["scenario"]["plant"] == "unicycle":
        axes.plot(t, command, label=name, **look)
        return
    axes.plot(t, command, color=look["color"], linewidth=0.6, alpha=0.7)
    axes.plot(t, achieved, label=f"{name}, flown (thin: commanded)", **look)


def _scenario(runs: Runs) -> dict:  # type: ignore[type-arg]
    return next(iter(runs.values())).manifest["scenario"]  # type: ignore[no-any-return]
