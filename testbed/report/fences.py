"""Draws the fences of a scenario in plan views, and lists their outlines for the player."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.records.run import Run
from testbed.report.style import PAGE, PURPLE, limits, styles
from testbed.scenario.fence import title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE: dict[str, Any] = {"color": PURPLE, "linewidth": 1.0, "zorder": 1}


def outlines(scenario: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Fences with an outline on the map: title, whether to stay inside, corners or centre and radius.

    Their margins are beside them. Height bands have none.
    """
    found = []
    for number, fence in enumerate(scenario.get("fence", []), 1):
        shape = {"title": title(number, fence["name"]), "inside": fence["kind"] == "keep-in"}
        shape["margin"] = fence["margin_m"]
        if fence.get("polygon_m"):
            found.append(shape | {"corners": fence["polygon_m"]})
        elif fence.get("centre_m"):
            found.append(shape | {"centre": fence["centre_m"], "radius": fence["radius_m"]})
    return found


def bands(scenario: Mapping[str, Any]) -> list[str]:
    """Height bands in words."""
    found = []
    for number, fence in enumerate(scenario.get("fence", []), 1):
        if fence["kind"] == "heights":
            ends = [(fence["floor_m"], "above"), (fence["ceiling_m"], "below")]
            said = " and ".join(f"{word} {end:g} m" for end, word in ends if end is not None)
            found.append(f"{title(number, fence['name'])}: {said}")
    return found


def draw(axes: Axes, scenario: Mapping[str, Any]) -> None:
    """Fences in a plan view: areas to stay in as outlines, areas to stay out of hatched; margins dotted."""
    from matplotlib.patches import Circle, Polygon

    for shape in outlines(scenario):
        filled = {} if shape["inside"] else {"hatch": "////", "alpha": 0.6}
        if "corners" in shape:
            patch: Any = Polygon(shape["corners"], closed=True, fill=False, **LINE, **filled)
            at = np.asarray(shape["corners"], dtype=float)
        else:
            patch = Circle(shape["centre"], shape["radius"], fill=False, **LINE, **filled)
            at = np.asarray(shape["centre"]) + shape["radius"] * np.array([[-1.0, -1.0], [1.0, 1.0]])
        axes.add_patch(patch)
        axes.update_datalim(at)
    axes.autoscale_view()


def over_time(runs: Mapping[str, Run]) -> Figure:
    """The least clearance of any vehicle from any fence over time, and the least h; a line for each run."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(PAGE, 2.6), layout="constrained", sharex=True)
    looks = styles(runs)
    for name, run in runs.items():
        for a, column in zip(axes, ("clearance_m", "h_m"), strict=True):
            least = run.fences.groupby("t_s")[column].min()
            a.plot(least.index, least, label=name, **looks[name])
    for a, label in zip(axes, ("clearance [m]", "h [m]"), strict=True):
        limits(a, 0.0)
        a.set(xlabel="time [s]", ylabel=label, title=f"Least {label.split()[0]} of any fence")
    axes[0].legend(loc="best")
    return figure


def table(label: str, run: Run) -> list[dict[str, Any]]:
    """A row per fence: what it is, and the least clearance and h of its vehicles at recorded times."""
    rows = []
    for number, fence in enumerate(run.manifest["scenario"].get("fence", []), 1):
        of = run.fences[run.fences.fence == number]
        if not len(of):
            continue
        near = of.loc[of.clearance_m.idxmin()]
        rows.append(
            {
                "plant": label,
                "fence": title(number, fence["name"]),
                "kind": fence["kind"],
                "margin [m]": fence["margin_m"],
                "least clearance [m]": near.clearance_m,
                "at [s]": near.t_s,
                "vehicle": int(near.vehicle),
                "least h [m]": of.h_m.min(),
            }
        )
    return rows


def named(scenario: Mapping[str, Any], number: int) -> str:
    """The title of the fence with that number, from 1."""
    return title(number, scenario["fence"][number - 1]["name"])
