"""Draws runs: the paper's four panels with the plants overlaid, and an aircraft's attitude and tracking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.claims.nearest import nearest_approach
from testbed.records.run import Run
from testbed.report import fences
from testbed.report.ledger_figures import ledger
from testbed.report.style import LIMIT, PAGE, drawing, limits, log_distance, save, separation, styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Of more runs a legend within the axes would hide what they show.
LEGEND_INSIDE = 3


def compare(runs: Mapping[str, Run], folder: Path) -> list[Path]:
    """Draw `panels`, where pairs drew near `ledger`, and where an aircraft flew `aircraft`; the PNG files."""
    folder.mkdir(parents=True, exist_ok=True)
    with drawing():
        figures = {"panels": panels(runs)}
        flown = {name: run for name, run in runs.items() if "roll_rad" in run.vehicles}
        if flown:
            figures["aircraft"] = aircraft(flown, styles(runs))
        if (drawn := ledger(runs)) is not None:
            figures["ledger"] = drawn
        files = []
        for name, figure in figures.items():
            files.append(save(figure, folder, name)[0])
    return files


def one(run: Run, vehicle: int = 1) -> Any:
    """The rows of one vehicle."""
    return run.vehicles[run.vehicles.vehicle == vehicle]


def limits_of(scenario: Mapping[str, Any], vehicle: int) -> dict[str, float]:
    """The [limits] of a vehicle, from 1: what its own table says, else the scenario's."""
    own = scenario["vehicle"][vehicle - 1] if scenario.get("vehicle") else {}
    return dict(scenario["limits"]) | own.get("limits", {})


def panels(runs: Mapping[str, Run]) -> Figure:
    """Speed and turn rate of vehicle 1 (achieved, and commanded thin), smallest distance, paths."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(PAGE, 5.4), layout="constrained")
    (speed, turn), (distance, path) = axes
    scenario = next(iter(runs.values())).manifest["scenario"]
    box = limits_of(scenario, 1)
    looks = styles(runs)
    for name, run in runs.items():
        rows, look = one(run), looks[name]
        thin = look | {"linewidth": 0.6, "alpha": 0.7, "linestyle": "-"}
        speed.plot(rows.t_s, rows.v_command_mps, **thin)
        speed.plot(rows.t_s, rows.v_mps, label=name, **look)
        turn.plot(rows.t_s, np.degrees(rows.omega_command_radps), **thin)
        turn.plot(rows.t_s, np.degrees(rows.omega_radps), label=name, **look)
        if len(run.pairs):
            smallest = run.pairs.groupby("t_s").distance_m.min()
            distance.plot(smallest.index, smallest, label=_with_least(name, run), **look)
        for vehicle in sorted(run.vehicles.vehicle.unique()):
            rows = one(run, vehicle)
            path.plot(rows.x_m, rows.y_m, **look, label=name if vehicle == 1 else None, alpha=0.85)
            path.plot(rows.x_m.iloc[0], rows.y_m.iloc[0], marker="o", ms=3, **look)
    fences.draw(path, scenario)
    limits(speed, box["v_min_mps"], box["v_max_mps"])
    limits(turn, -box["omega_max_degps"], box["omega_max_degps"])
    separation(distance, scenario["d_safe_m"])
    log_distance(distance)
    speed.set(xlabel="time [s]", ylabel="ground speed [m/s]", title="Vehicle 1: speed (thin: commanded)")
    turn.set(xlabel="time [s]", ylabel="turn rate [deg/s]", title="Vehicle 1: turn rate (thin: commanded)")
    distance.set(xlabel="time [s]", ylabel="distance [m]", title="Smallest distance of any pair")
    flat = scenario["vehicles"] <= 2 and not scenario.get("fence")
    path.set(
        xlabel="east [m]",
        ylabel="north [m]",
        title="Paths (dot: start" + ("; north stretched)" if flat else ")"),
    )
    path.set_aspect("auto" if flat else "equal", adjustable="datalim")
    legends(figure, list(axes.flat), distance)
    return figure


def legends(figure: Figure, axes: Sequence[Axes], telling: Axes) -> None:
    """A legend in each of `axes`; of many runs one below all, with the labels of `telling`."""
    handles, labels = telling.get_legend_handles_labels()
    if not handles:
        handles, labels = axes[0].get_legend_handles_labels()
    if len(labels) <= LEGEND_INSIDE:
        for a in axes:
            if a.get_legend_handles_labels()[0]:
                a.legend(loc="best")
        return
    longest = max(map(len, labels))
    columns = max(1, min(4, 100 // (longest + 8)))
    lines = -(-len(labels) // columns)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + 0.16 * lines)
    figure.legend(handles, labels, loc="outside lower left", ncols=columns, handlelength=3.5)


def _with_least(name: str, run: Run) -> str:
    """A label with the least distance that was judged: at every step, not only at the recorded ones."""
    least = nearest_approach(run).value
    return name if least is None else f"{name}, least {least:.2f} m"


def lead(run: Run) -> int:
    """The vehicle worth a closer look: the first of the pair that came closest."""
    return int(next(iter(nearest_approach(run)["vehicles"]), 1))


def aircraft(runs: Mapping[str, Run], looks: Mapping[str, dict[str, Any]]) -> Figure:
    """Of each aircraft run a vehicle of the closest pair: bank, sideslip, achieved minus commanded.

    looks  of each run, as in the other figures of the page
    """
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(5, 1, figsize=(PAGE, 5.8), sharex=True, layout="constrained")
    for name, run in runs.items():
        rows, look = one(run, lead(run)), looks[name]
        series = [
            *(np.degrees(rows.get(c, np.full(len(rows), np.nan))) for c in ("roll_rad", "beta_rad")),
            rows.v_mps - rows.v_command_mps,
            np.degrees(rows.omega_radps - rows.omega_command_radps),
            rows.zeta_mps - rows.zeta_command_mps,
        ]
        closest = nearest_approach(run)["t_s"]
        for a, y in zip(axes, series, strict=True):
            a.plot(rows.t_s, y, label=f"{name}, vehicle {lead(run)}", **look)
            if closest is not None:
                a.axvline(closest, **LIMIT)
    labels = ("bank [deg]", "sideslip [deg]", "v error [m/s]", "omega error\n[deg/s]", "zeta error [m/s]")
    for a, label in zip(axes, labels, strict=True):
        a.set_ylabel(label)
        a.axhline(0.0, color="0.6", linewidth=0.6)
    figure.align_ylabels(axes)
    axes[0].set_title("Attitude, and tracking errors (achieved minus commanded); dotted: least distance")
    axes[-1].set_xlabel("time [s]")
    legends(figure, [axes[0]], axes[0])
    return figure
