"""The picture of docs/guide/guidance.md: twenty unicycles that swap places by three kinds of guidance.

python docs/guidance_figures.py docs/guide/figures
"""

from __future__ import annotations

import sys
from pathlib import Path

from testbed.report.style import BLUE, GREEN, LIMIT, PAGE, VERMILION, drawing, save
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

COARSE = ["rates.filter_dt_s=0.05", "rates.record_dt_s=0.1", "manoeuvre_instants=0", "duration_s=26"]
KINDS = {
    "straight": (["guidance.lookahead_m=10"], VERMILION),
    "layers": (["guidance.kind=layers"], BLUE),
    "roundabout": (["guidance.kind=roundabout"], GREEN),
}


def main(folder: Path) -> list[Path]:
    """guidance: paths around the ring, heights in layers, least h of all three over time."""
    flown = {name: run(load("paper-20-turn", [*COARSE, *more])) for name, (more, _) in KINDS.items()}
    with drawing() as plt:
        figure, (plan, up, along) = plt.subplots(1, 3, figsize=(PAGE, 2.5), layout="constrained")
        for _, path in flown["roundabout"].vehicles.groupby("vehicle"):
            plan.plot(path.x_m, path.y_m, color=GREEN, lw=0.7)
        plan.set_aspect("equal")
        plan.set(xlabel="east [m]", ylabel="north [m]", title="Around the ring")
        for _, path in flown["layers"].vehicles.groupby("vehicle"):
            up.plot(path.t_s, path.z_m, color=BLUE, lw=0.7)
        up.set(xlabel="time [s]", ylabel="height [m]", title="In layers")
        for name, (_, colour) in KINDS.items():
            least = flown[name].pairs.groupby("t_s").h_m.min()
            along.plot(least.index, least, color=colour, label=name)
        along.axhline(0.0, **LIMIT)
        along.set(xlabel="time [s]", ylabel="least h [m]", ylim=(-2, 60), title="Least h of 190 pairs")
        along.legend()
        return save(figure, folder, "guidance")


if __name__ == "__main__":
    for file in main(Path(sys.argv[1])):
        print(file)
