"""Draws swept gains: the guarantee, the steps and the margins against the gain."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aircraft.autopilots.specification import MARGINS
from testbed.report.style import LIMIT, PAGE, drawing, limits, nth, save, separation

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from aircraft.airframes.schema import Airframe
    from testbed.scenario.scenario import Scenario
    from testbed.studies.tuning.sweeps import Sweep

LABELS = {
    "min_distance_m": "smallest distance [m]",
    "min_h_m": "smallest h [m]",
    "omega_t63_s": "t63 of omega [s]",
    "omega_overshoot": "overshoot of omega",
    "v_settling_s": "5 % settling of v [s]",
    "v_t63_s": "t63 of v [s]",
    "zeta_t63_s": "t63 of zeta [s]",
    "phase_margin_deg": "least phase margin [deg]",
    "disk_margin": "least disk margin",
}


def draw(
    table: pd.DataFrame, sweeps: Sequence[Sweep], airframe: Airframe, scenario: Scenario | None, folder: Path
) -> list[Path]:
    """`sweep.png` and `.pdf`: the first gain along the axis, a line for each combination of the others."""
    shown = [name for name in LABELS if name in table and table[name].notna().any()]
    with drawing() as plt:
        rows = (len(shown) + 1) // 2
        figure, grid = plt.subplots(rows, 2, figsize=(PAGE, 2.2 * rows), layout="constrained", squeeze=False)
        for axes, name in zip(grid.flat, shown, strict=False):
            _lines(axes, table, sweeps, name)
            axes.axvline(airframe.gain(sweeps[0].gain), **LIMIT)
            axes.set(xlabel=sweeps[0].gain, ylabel=LABELS[name])
            if name == "min_distance_m" and scenario is not None:
                separation(axes, scenario.d_safe_m)
            if name == "min_h_m":
                limits(axes, 0.0)
            if name in ("phase_margin_deg", "disk_margin"):
                limits(axes, MARGINS["phase_deg" if name.startswith("phase") else "disk"])
        for axes in list(grid.flat)[len(shown) :]:
            axes.set_visible(False)
        if len(sweeps) > 1:
            grid[0, 0].legend(loc="best")
        title = f"{airframe.title}; vertical line: the gain as it stands"
        figure.suptitle(title + (f"; scenario {scenario.name}" if scenario else ""), fontsize=8)
        return save(figure, folder, "sweep")


def _lines(axes: Axes, table: pd.DataFrame, sweeps: Sequence[Sweep], name: str) -> None:
    first, *others = (s.gain for s in sweeps)
    groups = table.groupby(others) if others else [((), table)]
    for k, (values, rows) in enumerate(groups):
        said = ", ".join(f"{g.split('.')[-1]} {v:.3g}" for g, v in zip(others, values, strict=True))
        axes.plot(rows[first], rows[name], marker="o", markersize=2.5, label=said or None, **nth(k))
