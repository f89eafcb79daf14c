"""Draws a campaign: rates and distributions, cell by cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.claims.registry import SEPARATION, SEPARATION_INTRUDERS
from testbed.report.style import BLACK, BLUE, LIMIT, PAGE, VERMILION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Marks of single runs in one cell: more would overlap, so a larger cell shows evenly spaced ranks.
MOST_MARKS = 400


def cells(
    rows: Sequence[Mapping[str, Any]],
    values: Sequence[np.ndarray],
    lost: Sequence[np.ndarray],
    bound: float | None,
    guarantee: str,
) -> Figure:
    """Left the share of runs lost with its interval, right every run's value with the median.

    rows    a campaign's summary, a row per cell
    values  of each cell (runs,)
    lost    of each cell (runs,), whether the run's verdict is anything but "holds"
    bound   that all runs share; None draws no line
    """
    from matplotlib import pyplot as plt

    names = [r["cell"] for r in rows]
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(PAGE, 0.34 * len(rows) + 1.1), sharey=True, layout="constrained"
    )
    y = np.arange(len(rows))[::-1]
    share = 100 * np.array([r["lost"] / max(1, r["runs"]) for r in rows])
    low, high = (100 * np.array([r[k] for r in rows]) for k in ("rate_low", "rate_high"))
    away = [np.clip(share - low, 0, None), np.clip(high - share, 0, None)]
    left.errorbar(share, y, xerr=away, fmt="o", ms=3.5, color=VERMILION, capsize=2)
    left.set(xlabel=f"runs that lose {guarantee} [%]", xlim=(-3, 103), ylim=(-0.6, len(rows) - 0.4))
    left.set_yticks(y, names)
    for k, of, without in zip(y, values, lost, strict=True):
        rank = np.argsort(of, kind="stable")
        if len(of):
            rank = rank[np.unique(np.linspace(0, len(rank) - 1, MOST_MARKS).astype(int))]
        shown, crossed = of[rank], without[rank]
        # Neighbours in rank at different heights, so that equal values do not hide each other.
        offset = 0.3 * (np.arange(len(shown)) * 0.618 % 1.0 - 0.5)
        right.plot(shown[~crossed], k + offset[~crossed], "o", ms=2, color=BLUE, alpha=0.5)
        right.plot(shown[crossed], k + offset[crossed], "x", ms=3, color=VERMILION)
        if len(of):
            right.plot(np.median(of), k, "|", ms=14, mew=2, color=BLACK)
    if bound is not None:
        right.axvline(bound, **LIMIT)
    if guarantee in (SEPARATION.id, SEPARATION_INTRUDERS.id):
        right.set_xlabel("least distance [m]" + ("" if bound is None else " (dotted: Ds)"))
    else:
        right.set_xlabel(f"value of {guarantee}")
    return figure
