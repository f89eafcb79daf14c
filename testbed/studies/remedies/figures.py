"""Draws remedies compared: rates with intervals, least and median distances."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from testbed.report.style import (
    BLUE,
    LIMIT,
    PAGE,
    VERMILION,
    drawing,
    save,
)

if TYPE_CHECKING:
    import pandas as pd


def remedies(table: pd.DataFrame, d_safe: float, folder: Path) -> list[Path]:
    """Violation rate with its interval, and least and median distance, remedy by remedy."""
    with drawing() as pyplot:
        figure, axes = pyplot.subplots(
            1, 2, figsize=(PAGE, 0.28 * len(table) + 1.0), sharey=True, layout="constrained"
        )
        y = np.arange(len(table))[::-1]
        rate = 100 * table.rate.to_numpy()
        low, high = 100 * table.rate_low.to_numpy(), 100 * table.rate_high.to_numpy()
        axes[0].errorbar(rate, y, xerr=[rate - low, high - rate], fmt="o", ms=3.5, color=VERMILION, capsize=2)
        axes[0].set(xlabel="runs that lose Ds [%], 95 % Clopper-Pearson interval", xlim=(-2, 102))
        axes[0].set_yticks(y, table.remedy)
        axes[1].plot(table.least_distance_m, y, "x", color=VERMILION, label="least of all runs")
        axes[1].plot(table.median_distance_m, y, "o", ms=3.5, color=BLUE, label="median")
        axes[1].axvline(d_safe, **LIMIT)
        axes[1].set(xlabel="least distance [m] (dotted: Ds)", ylim=(-0.6, len(table) - 0.4))
        figure.legend(loc="outside upper right", ncols=2)
        return save(figure, folder, "remedies")
