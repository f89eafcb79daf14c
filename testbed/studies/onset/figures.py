"""Draws when overriding begins, and the turn rate of vehicle 1."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from testbed.report.style import (
    PAGE,
    STYLES,
    drawing,
    limits,
    save,
)
from testbed.studies.onset.onset import LATERAL_M, TURN_DEGPS, Onset, least

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# Until when turn rates are drawn: by then the vehicles have met in the middle.
CROSSING_S = 9.0


def onset(onsets: list[Onset], folder: Path) -> list[Path]:
    """`onset`: for each number of vehicles when evasion begins, and vehicle 1's turn rate till they meet."""
    counts = sorted({o.case.vehicles for o in onsets})
    with drawing() as plt:
        sheet, grid = plt.subplots(2, len(counts), figsize=(PAGE, 4.6), squeeze=False, layout="constrained")
        for column, n in zip(grid.T, counts, strict=True):
            some = [o for o in onsets if o.case.vehicles == n]
            _begins(column[0], some)
            column[0].set_title(f"{n} vehicles", loc="left", fontsize=8)
            for o in some:
                shown = o.t_s <= CROSSING_S
                column[1].plot(o.t_s[shown], o.omega_degps[shown], label=o.case.law, **STYLES[o.case.law])
            omega_max = some[0].case.scenario().limits.omega_max_degps
            limits(column[1], -omega_max, omega_max)
            column[1].set(xlabel="time [s]", ylabel="turn rate of vehicle 1 [deg/s]")
        grid[0, 0].legend(loc="best")
        grid[1, 0].legend(loc="lower left", ncols=2)
        return save(sheet, folder, "onset")


def _begins(axes: Axes, onsets: list[Onset]) -> None:
    """A row per law: when the first vehicle is overridden, turns, and leaves its line."""
    marks = (
        ("o", "overridden"),
        ("^", f"turns by {TURN_DEGPS:g} deg/s"),
        ("s", f"{LATERAL_M:g} m off its line"),
    )
    for row, o in enumerate(onsets):
        colour = STYLES[o.case.law]["color"]
        for (mark, label), times in zip(marks, (o.override, o.turn, o.lateral), strict=True):
            axes.plot(least(times), row, mark, color=colour, markersize=5, markerfacecolor="none")
            if row == 0:
                axes.plot([], [], mark, color="0.3", markersize=5, markerfacecolor="none", label=label)
    axes.set_yticks(range(len(onsets)), [o.case.law for o in onsets])
    axes.set(xlabel="first time of any vehicle [s]", xlim=(-0.3, CROSSING_S), ylim=(len(onsets) - 0.5, -0.5))
