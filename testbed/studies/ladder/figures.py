"""Draws the fidelity ladder: every run, rung by rung."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from testbed.records.verdict import Status
from testbed.report.style import (
    BLACK,
    BLUE,
    LIMIT,
    PAGE,
    VERMILION,
    drawing,
    save,
)

if TYPE_CHECKING:
    import pandas as pd

    from testbed.studies.ladder.ladder import Account


def ladder(table: pd.DataFrame, distance: Account, h: Account, d_safe: float, folder: Path) -> list[Path]:
    """Least distance and h on every rung: each run a dot, the mean a bar."""
    with drawing() as pyplot:
        figure, axes = pyplot.subplots(2, 1, figsize=(PAGE, 4.8), sharex=True, layout="constrained")
        names = [s.rung for s in distance.steps]
        for a, account, column, limit, label in (
            (axes[0], distance, "distance_m", d_safe, "least distance [m]"),
            (axes[1], h, "h_m", 0.0, "least h [m]"),
        ):
            for k, name in enumerate(names):
                of = table[table.rung == name].dropna(subset=[column])
                values = of[column].to_numpy(dtype=float)
                x = k + np.linspace(-0.18, 0.18, len(values))
                lost = (of[f"{column.partition('_')[0]}_verdict"] != Status.HOLDS.value).to_numpy()
                a.plot(x[~lost], values[~lost], "o", ms=2.5, color=BLUE, alpha=0.6)
                a.plot(x[lost], values[lost], "x", ms=3.5, color=VERMILION)
            a.plot(range(len(names)), [s.value for s in account.steps], "_", ms=18, color=BLACK, mew=2)
            a.axhline(limit, **LIMIT)
            a.set_ylabel(label)
        axes[0].set_title("The fidelity ladder: every run (cross: lost), the mean a bar, the bound dotted")
        axes[1].set_xticks(range(len(names)), names, rotation=25, ha="right")
        return save(figure, folder, "ladder")
