"""The pictures of docs/guide/idea.md, flown and drawn.

python docs/idea_figures.py docs/guide/figures
"""

from __future__ import annotations

import sys
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from filters.barriers.closed_form import TurnBarrier
from filters.model import Array, Command, State, step
from testbed.records.run import Run
from testbed.report.style import BLUE, GREEN, LIMIT, PAGE, VERMILION, drawing, save
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

# Two vehicles on nearly opposite courses, and the paper's manoeuvre and Ds.
POSES = State(np.array([-40.0, 40.0]), np.array([-8.0, 8.0]), np.radians([5.0, 185.0]), np.array([0.0, 0.0]))
V_MPS, OMEGA_RADPS, DS_M = 16.0, radians(11.7), 5.0
SETTINGS = ["lookahead_m=10", "filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]
CASES = {
    "unicycle": ["plant=unicycle"],
    "X8": ["plant=jsbsim"],
    "X8, remedy": ["plant=jsbsim", "predict_lags=true", "ds_buffer_m=0.5"],
}
LOOKS: dict[str, dict[str, Any]] = {
    "unicycle": {"color": BLUE, "linestyle": "-"},
    "X8": {"color": VERMILION, "linestyle": "--"},
    "X8, remedy": {"color": GREEN, "linestyle": "-."},
}


def evading(dt: float = 0.02) -> tuple[Array, Array, float]:
    """Times (n,) s, positions (n, 2, 2) m of POSES flying gamma through a whole turn, and their h [m]."""
    gamma = Command(np.full(2, V_MPS), np.full(2, OMEGA_RADPS), np.zeros(2))
    times = np.arange(0.0, 2 * np.pi / OMEGA_RADPS, dt)
    track, now = [], POSES
    for _ in times:
        track.append(np.stack([now.x, now.y], axis=-1))
        now = step(now, gamma, dt)
    barrier = TurnBarrier(V_MPS, OMEGA_RADPS, DS_M, delta=0.0)
    return times, np.array(track), float(barrier.values(POSES).h[0])


def draw_h(folder: Path) -> list[Path]:
    """idea-h: the circles of the evading manoeuvre, and the distance along it, whose least minus Ds is h."""
    times, track, h = evading()
    distance = np.linalg.norm(track[:, 0] - track[:, 1], axis=-1)
    k = int(np.argmin(distance))
    with drawing() as plt:
        figure, (plan, along) = plt.subplots(1, 2, figsize=(PAGE, 3.3), layout="constrained")
        for vehicle, (colour, dash) in enumerate(((BLUE, "-"), (VERMILION, "--"))):
            x, y = track[:, vehicle].T
            plan.plot(x, y, color=colour, linestyle=dash, label=f"vehicle {vehicle + 1}, turning for ever")
            course = POSES.theta[vehicle]
            plan.annotate(
                "",
                (x[0] + 28 * np.cos(course), y[0] + 28 * np.sin(course)),
                (x[0], y[0]),
                arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 0.8},
            )
            plan.plot(x[0], y[0], "o", color=colour, markersize=4)
        plan.plot(*track[k].T, color="black", marker=".", label=f"nearest: {distance[k]:.1f} m = h + Ds")
        plan.set(aspect="equal", xlabel="east [m]", ylabel="north [m]")
        figure.legend(loc="outside lower center", ncol=3, frameon=False)
        along.plot(times, distance, color="black", linestyle="-")
        along.plot(times[k], distance[k], "o", color="black", markersize=4)
        along.axhline(DS_M, **LIMIT)
        along.text(0.1, DS_M, f"Ds = {DS_M:g} m", va="bottom", fontsize=7)
        arrow = {"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0}
        along.annotate("", (times[k], distance[k]), (times[k], DS_M), arrowprops=arrow)
        along.text(times[k] + 0.15, (distance[k] + DS_M) / 2, f"h = {h:.1f} m", va="center")
        along.set(xlabel="time along the manoeuvre [s]", ylabel="distance [m]", xlim=(0, 5), ylim=(0, 60))
        return save(figure, folder, "idea-h")


def flights() -> dict[str, Run]:
    """The head-on encounter of each of CASES."""
    return {name: run(load("paper-2-turn", SETTINGS + case)) for name, case in CASES.items()}


def draw_mismatch(
    flown: dict[str, Run], folder: Path, window: tuple[float, float] = (6.0, 10.0)
) -> list[Path]:
    """idea-mismatch: the turn asked for and flown, the distance, and h, over the encounter."""
    with drawing() as plt:
        figure, (turn, apart, barrier) = plt.subplots(1, 3, figsize=(PAGE, 2.7), layout="constrained")
        first = flown["X8"].vehicles.query("vehicle == 1")
        degrees = np.degrees(first[["omega_command_radps", "omega_radps"]])
        turn.step(first.t_s, degrees.omega_command_radps, where="post", color="black", label="asked for")
        turn.plot(first.t_s, degrees.omega_radps, label="flown (X8)", **LOOKS["X8"])
        turn.set(ylabel="turn rate [deg/s]")
        turn.legend(loc="lower left")
        for name, found in flown.items():
            apart.plot(found.pairs.t_s, found.pairs.distance_m, label=name, **LOOKS[name])
            barrier.plot(found.pairs.t_s, found.pairs.h_m, label=name, **LOOKS[name])
        apart.axhline(DS_M, **LIMIT)
        apart.text(window[0], DS_M, " Ds", va="bottom", fontsize=7)
        apart.set(ylabel="distance [m]", ylim=(0, 40))
        barrier.axhline(0.0, **LIMIT)
        barrier.set(ylabel="h [m]", ylim=(-1, 12))
        figure.legend(*barrier.get_legend_handles_labels(), loc="outside lower center", ncol=3, frameon=False)
        for axes in (turn, apart, barrier):
            axes.set(xlabel="time [s]", xlim=window)
        return save(figure, folder, "idea-mismatch")


def main(folder: Path) -> None:
    """Write the pictures, as PNG alone, and print the numbers that the page quotes."""
    flown = flights()
    for file in draw_h(folder) + draw_mismatch(flown, folder):
        if file.suffix != ".png":
            file.unlink()
    for name, found in flown.items():
        separation, safe = found.guarantee("separation"), found.guarantee("safe-set")
        print(f"{name}: least distance {separation['value']:.2f} m, least h {safe['value']:.2f} m")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
