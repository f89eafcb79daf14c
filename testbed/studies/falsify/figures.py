"""Draws a search for violations: the margin of every flight, and the counterexample."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.records.run import Run
from testbed.report import fences
from testbed.report.figures import one
from testbed.report.style import (
    BLACK,
    BLUE,
    GREEN,
    LIMIT,
    ORANGE,
    PAGE,
    PURPLE,
    SKY,
    VERMILION,
    drawing,
    log_distance,
    save,
    separation,
)

if TYPE_CHECKING:
    from testbed.studies.falsify.falsify import Falsified

STAGES = {
    "as it stands": (BLACK, "D"),
    "starts": (BLUE, "o"),
    "starts and weather": (SKY, "s"),
    "descent": (GREEN, "^"),
    "shrink": (ORANGE, "o"),
    "round": (PURPLE, "s"),
}


def margins(result: Falsified, unit: str, folder: Path) -> list[Path]:
    """Margin against the number of the flight: the search, and beside it the shrinking."""
    parts = [("Search", result.search.flown)]
    if result.shrinks is not None:
        parts.append(("Shrinking", result.shrinks.flown))
    with drawing() as pyplot:
        figure, axes = pyplot.subplots(
            1, len(parts), figsize=(PAGE, 3.0), sharey=True, squeeze=False, layout="constrained"
        )
        for a, (title, flown) in zip(axes[0], parts, strict=True):
            low = min((f.margin for f in flown if not f.refused), default=0.0)
            for stage, (colour, marker) in STAGES.items():
                own = [f for f in flown if f.stage == stage]
                kept = [f for f in own if not f.violated and not f.refused]
                lost = [f for f in own if f.violated]
                refused = [f for f in own if f.refused]
                if own:
                    a.plot([], [], marker, ms=4, color=colour, label=stage)
                a.plot([f.number for f in kept], [f.margin for f in kept], marker, ms=3, color=colour)
                a.plot(
                    [f.number for f in lost], [f.margin for f in lost], marker, ms=5, mfc="none", color=colour
                )
                a.plot([f.number for f in lost], [f.margin for f in lost], "x", ms=4, color=VERMILION)
                a.plot([f.number for f in refused], [low] * len(refused), "|", ms=6, color="0.5")
            a.axhline(0.0, **LIMIT)
            a.xaxis.set_major_locator(pyplot.MaxNLocator(integer=True))
            a.set_xlim(0.5, max((f.number for f in flown), default=1) + 0.5)
            a.set(xlabel="flight", title=f"{title} (cross: violated, tick: refused)")
            a.legend(loc="best")
        axes[0, 0].set_ylabel(f"margin of {result.guarantee}" + (f" [{unit}]" if unit else ""))
        return save(figure, folder, "margin")


def counterexample(run: Run, entry: Mapping[str, Any], folder: Path) -> list[Path]:
    """Paths with the worst pair drawn out, and that pair's distance and h over time.

    entry  the verdict on the guarantee or requirement
    """
    scenario = run.manifest["scenario"]
    worst = entry["vehicles"]
    with drawing() as pyplot:
        figure, axes = pyplot.subplot_mosaic("pd;ph", figsize=(PAGE, 3.8), layout="constrained")
        path, distance, h = (axes[k] for k in "pdh")
        for vehicle in range(1, scenario["vehicles"] + 1):
            rows = one(run, vehicle)
            look = {"color": "0.75", "linewidth": 0.7, "zorder": 1}
            if vehicle in worst:
                colour = (VERMILION, BLUE)[worst.index(vehicle) % 2]
                look = {"color": colour, "zorder": 2, "label": f"vehicle {vehicle}"}
            path.plot(rows.x_m, rows.y_m, **look)
            path.plot(
                rows.x_m.iloc[0], rows.y_m.iloc[0], "o", ms=3, color=look["color"], zorder=look["zorder"]
            )
            if vehicle in worst and entry["t_s"] is not None:
                at = rows.iloc[int(np.argmin(np.abs(rows.t_s.to_numpy() - entry["t_s"])))]
                path.plot(at.x_m, at.y_m, "x", ms=7, mew=1.5, color=look["color"], zorder=3)
        fences.draw(path, scenario)
        path.set(xlabel="east [m]", ylabel="north [m]", title="Paths (dot: start, cross: worst instant)")
        path.set_aspect("equal" if scenario["vehicles"] > 2 or scenario.get("fence") else "auto")
        if len(worst) == 2:
            pair = run.pairs[(run.pairs.i == worst[0]) & (run.pairs.j == worst[1])]
            distance.plot(pair.t_s, pair.distance_m, color=BLACK)
            h.plot(pair.t_s, pair.h_m, color=BLACK)
        separation(distance, scenario["d_safe_m"])
        log_distance(distance)
        h.axhline(0.0, **LIMIT)
        h.set_yscale("symlog", linthresh=2.0)
        unit = "m" if scenario["barrier"]["form"] == "root" else "m^2"
        distance.set(ylabel="distance [m]", title=f"Vehicles {' and '.join(map(str, worst))}")
        h.set(ylabel=f"h [{unit}]", xlabel="time [s]")
        path.legend(loc="best")
        return save(figure, folder, "counterexample")
