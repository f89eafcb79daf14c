"""Draws the answer: rates with intervals, cell by cell."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from testbed.report.style import (
    PAGE,
    drawing,
    save,
    styles,
)
from testbed.studies.answer.cells import COLUMNS, Cell

if TYPE_CHECKING:
    import pandas as pd


def answer(table: pd.DataFrame, folder: Path) -> list[Path]:
    """Share of runs that lose Ds, by cell, with intervals."""
    with drawing() as pyplot:
        figure, a = pyplot.subplots(figsize=(PAGE, 0.2 * len(table) + 0.9), layout="constrained")
        y = np.arange(len(table))[::-1]
        rate = 100 * table.lost / table.runs
        low, high = rate - 100 * table.rate_low, 100 * table.rate_high - rate
        looks = styles(table.vehicle)
        for vehicle, marker in zip(dict.fromkeys(table.vehicle), cycle("osD^v"), strict=False):
            of = (table.vehicle == vehicle).to_numpy()
            a.errorbar(
                rate[of],
                y[of],
                xerr=[low[of].clip(0), high[of].clip(0)],
                fmt=marker,
                ms=3.5,
                capsize=2,
                color=looks[vehicle]["color"],
                label=vehicle,
            )
        names = [str(Cell(*key)) for key in table[COLUMNS].itertuples(index=False)]
        a.set_yticks(y, names)
        a.set(xlabel="runs lost [%], 95 % intervals")
        a.set(xlim=(-2, 102), ylim=(-0.7, len(table) - 0.3))
        figure.legend(loc="outside upper right", ncols=4)
        return save(figure, folder, "answer")
