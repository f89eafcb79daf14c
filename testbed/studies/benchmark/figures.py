"""Draws a benchmark: runs lost against intervention, a panel per plant and size of fleet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from testbed.report.style import PAGE, drawing, save, styles

MARKERS = "osD^vPX<>*hp"


def loss(pooled: Sequence[Mapping[str, Any]], folder: Path, name: str = "loss") -> list[Path]:
    """Runs lost [%] over time in which commands are altered [%], with 95 % intervals of both.

    pooled  rows as `table.pooled` gives them
    """
    fleets, plants, filters = (list(dict.fromkeys(r[k] for r in pooled)) for k in ("set", "plant", "filter"))
    looks = styles(filters)
    with drawing() as pyplot:
        figure, grid = pyplot.subplots(
            len(fleets), len(plants), figsize=(PAGE, 0.6 + 2.1 * len(fleets)), layout="constrained",
            sharex=True, sharey="row", squeeze=False,
        )  # fmt: skip
        for r in pooled:
            if not r["runs"]:
                continue
            k = filters.index(r["filter"])
            axes = grid[fleets.index(r["set"]), plants.index(r["plant"])]
            x, y = 100 * r["altered"], 100 * r["lost"] / r["runs"]
            wide = np.clip([[x - 100 * r["altered_low"]], [100 * r["altered_high"] - x]], 0, None)
            high = np.clip([[y - 100 * r["lost_low"]], [100 * r["lost_high"] - y]], 0, None)
            axes.errorbar(
                x, y, xerr=wide, yerr=high, fmt=MARKERS[k % len(MARKERS)], ms=4.5, capsize=1.5, lw=0.8,
                color=looks[r["filter"]]["color"], label=r["filter"],
                mfc="white" if k >= 7 else None,
            )  # fmt: skip
        for i, fleet in enumerate(fleets):
            grid[i, 0].set_ylabel(f"runs lost [%], {fleet}")
            for j, plant in enumerate(plants):
                grid[i, j].set_title(plant if i == 0 else "")
                grid[i, j].set_xlim(-3, 103)
        for axes in grid[-1]:
            axes.set_xlabel("time altered [%]")
        by_name = {n: h for axes in grid.flat for h, n in zip(*axes.get_legend_handles_labels(), strict=True)}
        ordered = [n for n in filters if n in by_name]
        figure.legend(
            [by_name[n] for n in ordered], ordered, loc="outside upper center", ncols=min(5, len(ordered)),
            title="bars: 95 % intervals",
        )  # fmt: skip
        return save(figure, folder, name)
