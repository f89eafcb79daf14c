"""Draws the kink of the paper's barrier, the filter's chatter across it, and every run of the study."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from testbed.report.style import (
    BLACK,
    BLUE,
    COLUMN,
    ORANGE,
    PAGE,
    STYLES,
    drawing,
    limits,
    save,
    separation,
)
from testbed.studies.kink.kink import Look, over_heading

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


# Vehicles abreast, far enough apart for both barriers to hold at equal headings (the smoothed needs 7.4 m).
ABREAST_M = 9.0
# How far h must fall below its predicted value [m]; the figure begins before that moment, by s and by steps.
LOSS_M = 0.2
DRAIN_S, CHATTER_STEPS = (0.2, 0.7), (15, 35)


def kink(table: pd.DataFrame, seen: Look, d_safe: float, folder: Path) -> list[Path]:
    """`kink-mechanism`: the kink, the chatter across it, h falling. `kink-seeds`: every run."""
    with drawing() as plt:
        sheet, grid = plt.subplots(2, 2, figsize=(PAGE, 5.0), layout="constrained")
        for axes, draw in zip(grid.flat, (_shape, _chatter, _heading, _drain), strict=True):
            draw(axes, seen)
            if axes.get_legend_handles_labels()[0]:
                axes.legend(loc="best")
        c = seen.case
        grid[0, 0].set_title(f"(a) two vehicles {ABREAST_M:g} m abreast", loc="left", fontsize=8)
        grid[0, 1].set_title(
            f"(b) vehicles {seen.i} and {seen.j} of {c.vehicles}, seed {c.seed}, dt {c.dt_s:g} s",
            loc="left",
            fontsize=8,
        )
        grid[1, 0].set_title("(c) the same: equal headings crossed again and again", loc="left", fontsize=8)
        grid[1, 1].set_title("(d) the same: what L$_g$h u promised, and what came", loc="left", fontsize=8)
        files = save(sheet, folder, "kink-mechanism")
        sheet, axes = plt.subplots(figsize=(COLUMN, 2.6), layout="constrained")
        _seeds(axes, table, d_safe)
        return files + save(sheet, folder, "kink-seeds")


def _shape(axes: Axes, seen: Look) -> None:
    offset = np.linspace(-4.0, 4.0, 401)
    for name, h in over_heading(ABREAST_M, offset).items():
        axes.plot(offset, h, label=name, **STYLES[name])
    limits(axes, 0.0)
    axes.set(xlabel="difference of headings [deg]", ylabel="h [m]")


def _window(seen: Look, before_s: float, after_s: float) -> np.ndarray:
    """The steps around the moment when h falls below its predicted value; else around the smallest h."""
    lost = seen.lost_m() > LOSS_M
    begin = seen.t_s[np.argmax(lost) if lost.any() else np.argmin(seen.h_m)]
    return np.flatnonzero((seen.t_s >= begin - before_s) & (seen.t_s <= begin + after_s))


def _few_steps(seen: Look) -> np.ndarray:
    return _window(seen, *(n * seen.case.dt_s for n in CHATTER_STEPS))


def _chatter(axes: Axes, seen: Look) -> None:
    w = _few_steps(seen)
    for k, (vehicle, colour) in enumerate(((seen.i, BLUE), (seen.j, ORANGE))):
        axes.step(
            seen.t_s[w],
            seen.omega_degps[k, w],
            where="post",
            color=colour,
            linewidth=0.9,
            label=f"vehicle {vehicle}",
        )
    axes.set(xlabel="time [s]", ylabel="turn rate commanded [deg/s]")


def _heading(axes: Axes, seen: Look) -> None:
    w = _few_steps(seen)
    axes.plot(seen.t_s[w], seen.relative_deg[w], ".-", color=BLACK, markersize=2, linewidth=0.6)
    limits(axes, 0.0)
    axes.set(xlabel="time [s]", ylabel="difference of headings [deg]")


def _drain(axes: Axes, seen: Look) -> None:
    w = _window(seen, *DRAIN_S)
    t, h = seen.t_s[w], seen.h_m[w]
    lost = seen.lost_m()[w]
    axes.plot(t, h + (lost - lost[0]), label="promised", **STYLES["smoothed"])
    axes.plot(t, h, label="h", **STYLES["paper"])
    limits(axes, 0.0)
    # The predicted h soon departs far from the flown one; only the beginning of the difference is shown.
    low, high = float(h.min()), float(h.max())
    axes.set(xlabel="time [s]", ylabel="h of the pair [m]", ylim=(low - 0.3, high + 2.0))


def _seeds(axes: Axes, table: pd.DataFrame, d_safe: float) -> None:
    periods = sorted(table.dt_s.unique())
    for side, name in ((-0.12, "paper"), (0.12, "smoothed")):
        for k, dt in enumerate(periods):
            rows = table[(table.barrier == name) & (table.dt_s == dt)]
            spread = np.linspace(-0.08, 0.08, len(rows)) if len(rows) > 1 else np.zeros(len(rows))
            axes.plot(
                k + side + spread,
                rows.min_distance_m,
                "o" if name == "paper" else "s",
                markersize=3,
                markerfacecolor="none",
                color=STYLES[name]["color"],
                label=name if k == 0 else None,
            )
    separation(axes, d_safe)
    axes.set_xticks(range(len(periods)), [f"{dt:g}" for dt in periods])
    axes.set(xlabel="filter and unicycle period [s]", ylabel="least distance of a run [m]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
