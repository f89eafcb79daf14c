"""Draws a margin: the rate against the setting, and what the setting costs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from testbed.report.style import (
    BLUE,
    GREEN,
    LIMIT,
    PAGE,
    VERMILION,
    drawing,
    save,
)

if TYPE_CHECKING:
    from testbed.studies.margin.margin import Margin


def margin(found: Margin, folder: Path) -> list[Path]:
    """Against the knob: the violation rate with intervals, and what the setting costs in path and time."""
    with drawing() as pyplot:
        figure, (a, cost) = pyplot.subplots(
            2, 1, figsize=(PAGE * 0.75, 4.6), sharex=True, layout="constrained", height_ratios=(3, 2)
        )
        for stage, colour, marker in (
            ("sweep", BLUE, "o"),
            ("bisect", GREEN, "s"),
            ("certify", VERMILION, "D"),
        ):
            points = [p for p in found.points if p.stage.startswith(stage)]
            if not points:
                continue
            x = [p.setting for p in points]
            y = np.array([100 * p.violations / p.runs for p in points])
            low = np.array([100 * p.rate_low for p in points])
            high = np.array([100 * p.rate_high for p in points])
            a.errorbar(
                x, y, yerr=[y - low, high - y], fmt=marker, ms=3.5, color=colour, capsize=2, label=stage
            )
        a.axhline(100 * found.target_rate, **LIMIT)
        a.set(ylabel="runs that lose Ds [%]")
        # Above the panels: within, it hides an interval of one knob or another.
        figure.legend(loc="outside upper center", ncols=3, title="bars: 95 % Clopper-Pearson intervals")
        swept = sorted((p for p in found.points if p.stage == "sweep"), key=lambda p: p.setting)
        time = cost.twinx()
        time.grid(False)
        for axes, name, colour, mark in (
            (cost, "path_added_m", BLUE, "o-"),
            (time, "time_added_s", GREEN, "s--"),
        ):
            known = [(p.setting, getattr(p, name)) for p in swept if getattr(p, name) is not None]
            if known:
                axes.plot(*zip(*known, strict=True), mark, ms=3, color=colour)
        cost.set_ylabel("path added [m], solid", color=BLUE)
        time.set_ylabel("time added [s], dashed", color=GREEN)
        cost.set(xlabel=f"{found.knob} [{found.unit}]")
        return save(figure, folder, "margin")
