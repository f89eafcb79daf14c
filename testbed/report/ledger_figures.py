"""Draws the ledger: by how much each channel reduced hdot over time, and its quantiles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.measures.hdot_ledger import CHANNELS, NEAR_H_M, near, summary
from testbed.records.run import Run
from testbed.report.style import BLACK, BLUE, GREEN, LIMIT, ORANGE, PAGE, PURPLE, VERMILION

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = {
    "v": "speed",
    "omega": "turn rate",
    "zeta": "climb rate",
    "course": "course - heading",
    "rest": "rest",
}
DASHES = {"v": "-", "omega": (0, (5, 1)), "zeta": ":", "course": "-."}
COLOURS = {"v": BLUE, "omega": VERMILION, "zeta": GREEN, "course": PURPLE, "rest": ORANGE, "total": BLACK}


def ledger(runs: Mapping[str, Run], near_h_m: float = NEAR_H_M) -> Figure | None:
    """A row per run: h's residual by channel over time, of the pair of least residual, and its quantiles.

    None where no run has a pair with h below `near_h_m`.
    """
    from matplotlib import pyplot as plt

    found = {name: summary(run, near_h_m) for name, run in runs.items()}
    drawn = [name for name in runs if found[name]["rows"]]
    if not drawn:
        return None
    figure, axes = plt.subplots(
        len(drawn),
        2,
        figsize=(PAGE, 2.4 * len(drawn) + 0.5),
        layout="constrained",
        squeeze=False,
        width_ratios=(3, 2),
    )
    for row, name in zip(axes, drawn, strict=True):
        _over_time(row[0], name, runs[name], found[name])
        _quantiles(row[1], found[name])
    axes[0][1].set_title("Quantiles: 5 to 95 %, all")
    # Below the panels: within, it hides the curves of one run or another.
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def _over_time(a: Axes, name: str, run: Run, found: dict[str, Any]) -> None:
    i, j = found["worst"][0]["vehicles"]
    rows = with_gaps(run, i, j, found["near_h_m"])
    total = rows.hdot_realised_mps - rows.hdot_predicted_mps
    for channel in CHANNELS:
        part = rows[f"residual_{channel}_mps"]
        look: Any = {"color": COLOURS[channel], "linestyle": DASHES[channel]}
        a.plot(rows.t_s, part, **look, linewidth=1.0, label=NAMES[channel])
    a.plot(
        rows.t_s, total, color=COLOURS["total"], linestyle="--", linewidth=1.0, label="realised - predicted"
    )
    for begin, end in spans(rows.t_s.to_numpy(), (rows.h_m < 0).to_numpy()):
        a.axvspan(begin, end, color="0.85", zorder=0)
    a.axhline(0.0, **LIMIT)
    a.set(xlabel="time [s]", ylabel="residual of hdot [m/s]")
    a.set_title(f"{name}, vehicles {i} and {j}, h below {found['near_h_m']:g} m (grey: h < 0)")


def with_gaps(run: Run, i: int, j: int, near_h_m: float) -> pd.DataFrame:
    """Every recorded row of a pair in order of time; all but t_s is nan where the ledger omits the row.

    So no line joins two rows between which others were recorded and omitted.
    """
    of = run.pairs[(run.pairs.i == i) & (run.pairs.j == j)].sort_values("t_s")
    kept = near(run, near_h_m)
    kept = kept[(kept.i == i) & (kept.j == j)].set_index("t_s")
    return kept.reindex(of.t_s).rename_axis("t_s").reset_index()


def spans(t: np.ndarray, inside: np.ndarray) -> list[tuple[float, float]]:
    """Intervals of the times `t` (n,) in which `inside` (n,) stays true, without joining across false ones.

    An interval reaches half-way to the recorded times beside it, so that a single one is seen.
    """
    middle = 0.5 * (t[1:] + t[:-1])
    edges = np.concatenate([t[:1], middle, t[-1:]])
    padded = np.concatenate([[False], inside, [False]])
    begins, ends = np.flatnonzero(padded[1:] & ~padded[:-1]), np.flatnonzero(padded[:-1] & ~padded[1:])
    return [(float(edges[b]), float(edges[e])) for b, e in zip(begins, ends, strict=True)]


def _quantiles(a: Axes, found: dict[str, Any]) -> None:
    names = [*CHANNELS, "rest", "total"]
    for k, channel in enumerate(names):
        q = found["quantiles"][channel]
        colour = COLOURS[channel]
        a.plot([q["0"], q["1"]], [k, k], color=colour, linewidth=0.8)
        a.plot([q["0.05"], q["0.95"]], [k, k], color=colour, linewidth=5, solid_capstyle="butt")
        a.plot(q["0.5"], k, "|", color="white", ms=7)
    a.axvline(0.0, **LIMIT)
    a.set_yticks(range(len(names)), [NAMES.get(n, n) for n in names])
    a.invert_yaxis()
    a.set_xlabel("residual of hdot [m/s]")
