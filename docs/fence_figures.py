"""The pictures of docs/guide/fences.md, flown and drawn, and the numbers that the page quotes.

python docs/fence_figures.py docs/guide/figures
"""

from __future__ import annotations

import sys
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from filters.barriers.class_k import cubic
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.fences.fences import Fence, Fences
from filters.barriers.fences.polygon import Polygon
from filters.barriers.fences.shapes import Area
from filters.cbf.collision import CollisionFilter
from filters.cbf.fence_constraints import FenceConstraints
from filters.model import Command, Limits, State, View, step
from filters.qp.single import Status
from testbed.components import catalogue
from testbed.components.fences import fences
from testbed.report.fences import draw
from testbed.report.style import BLUE, GREEN, LIMIT, PAGE, VERMILION, drawing, save
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

# A pose in the built-in field, between its mast and its fence.
POSE = State(np.array([208.0]), np.array([-139.0]), np.radians([60.0]), np.array([0.0]))
FLOWN: dict[str, tuple[list[str], dict[str, Any]]] = {
    "unicycle": ([], {"color": BLUE, "linestyle": "-"}),
    "X8": (["plant=jsbsim"], {"color": VERMILION, "linestyle": "--"}),
    "X8, predicted lags": (
        ["plant=jsbsim", "remedy.predict_lags=true"],
        {"color": GREEN, "linestyle": "-."},
    ),
}
V_MPS, OMEGA_RADPS, DS_M = 16.0, radians(11.7), 5.0
LIMITS = Limits(15.0, 25.0, radians(13), 3.9)


def draw_h(folder: Path) -> list[Path]:
    """fences-h: the circle of the evading manoeuvre, and the clearance along it, whose least is h."""
    s = load("fenced-field")
    made = fences(s, catalogue.barrier(s))
    assert made is not None
    alone = Fences(
        [Fence(f.shape, np.array([0]), f.name) for f in made.fences[:2]], made.gamma[np.array([0])]
    )
    times = np.linspace(0.0, 2 * np.pi / OMEGA_RADPS, 600)
    there = [step(POSE, alone.gamma, float(t)) for t in times]
    track = np.array([[p.x[0], p.y[0]] for p in there])
    clearance = np.array([alone.clearance(p.position) for p in there])
    h = alone.values(POSE)
    with drawing() as plt:
        figure, (plan, along) = plt.subplots(1, 2, figsize=(PAGE, 3.0), layout="constrained")
        draw(plan, s.model_dump(mode="json"))
        plan.plot(*track.T, color=BLUE, label="turning for ever")
        plan.plot(*track[0], "o", color="black", ms=4, label="now")
        for k, colour in enumerate((BLUE, VERMILION)):
            name = alone.fences[k].name
            along.plot(times, clearance[:, k], color=colour, label=name)
            along.axhline(h[k], **(LIMIT | {"color": colour}))
            worst = int(np.argmin(clearance[:, k]))
            plan.plot(*track[worst], "x", color=colour, ms=7, label=f"nearest {name}: h = {h[k]:.1f} m")
        plan.set_aspect("equal")
        plan.set(xlabel="east [m]", ylabel="north [m]")
        plan.legend(loc="center left")
        along.set(xlabel="time of the turn [s]", ylabel="clearance [m]", ylim=(0, None))
        along.set_title("Clearance along the turn; dotted: h")
        along.legend(loc="center left")
        return save(figure, folder, "fences-h")


def draw_flown(folder: Path) -> list[Path]:
    """fences-flown: the built-in field flown, with the mast close up."""
    s = load("fenced-field").model_dump(mode="json")
    with drawing() as plt:
        figure, (plan, near) = plt.subplots(1, 2, figsize=(PAGE, 3.2), layout="constrained")
        for name, (asked, look) in FLOWN.items():
            made = run(load("fenced-field", [*asked, "checks.manoeuvre_instants=0"]))
            kept = made.guarantee("fence-clearance")
            print(f"{name}: least clearance {kept['value']:.2f} m, fence {kept['detail']['fence']}")
            for axes in (plan, near):
                for v in (1, 2):
                    rows = made.vehicles[made.vehicles.vehicle == v]
                    axes.plot(rows.x_m, rows.y_m, **look, label=name if v == 1 else None)
        for axes in (plan, near):
            draw(axes, s)
            axes.set_aspect("equal")
            axes.set(xlabel="east [m]", ylabel="north [m]")
        mast = s["fence"][1]
        near.add_patch(plt.Circle(mast["centre_m"], mast["radius_m"] + mast["margin_m"], fill=False, **LIMIT))
        near.set(xlim=(0, 75), ylim=(-205, -130), title="The mast and its margin (dotted)")
        plan.set_title("Paths")
        plan.legend(loc="lower left")
        return save(figure, folder, "fences-flown")


def unsolved(omega: float, count: int = 200) -> int:
    """Of `count` states, how often the QP has no solution if the fence's barrier turns at omega.

    Two vehicles fly towards the northern fence of a square and are as near to it and to each other as the
    barriers allow; the pair's barrier turns left.
    """
    gamma = Command(np.full(2, V_MPS), np.full(2, omega), np.zeros(2))
    square = Polygon([[-300, -300], [300, -300], [300, 300], [-300, 300]])
    fence = Fences([Fence(Area(square, inside=True), np.arange(2))], gamma)
    turn, alpha = TurnBarrier(V_MPS, OMEGA_RADPS, DS_M, smoothing=30.0), cubic(0.1)
    choose = CollisionFilter(turn, alpha, also=[FenceConstraints(fence, alpha)])
    rng, found, r = np.random.default_rng(1), 0, V_MPS / omega
    wanted = Command(np.full(2, 20.0), 0.0, 0.0)
    for _ in range(count):
        courses = rng.uniform(0.2, 2.9, 2)
        y = 300.0 - abs(r) - r * np.cos(courses) - 0.01
        x = np.linspace(0.0, 250.0, 2000)
        h = np.array([turn.values(State(np.array([0.0, b]), y, courses, np.zeros(2))).h[0] for b in x])
        nearest = x[int(np.argmin(np.where(h >= 0, h, np.inf)))]
        state = State(np.array([0.0, nearest]), y, courses, np.zeros(2))
        assert fence.values(state).min() >= 0
        status = choose(View(state, wanted), wanted, LIMITS).status
        found += bool((status != Status.SOLVED).any())
    return found


def main(folder: Path) -> None:
    """Write the pictures, as PNG alone, and print the numbers that the page quotes."""
    for file in draw_h(folder) + draw_flown(folder):
        if file.suffix != ".png":
            file.unlink()
    for name, omega in (("left, as the pair's", OMEGA_RADPS), ("right", -OMEGA_RADPS)):
        print(f"the fence's barrier turns {name}: {unsolved(omega)} of 200 states without a solution")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
