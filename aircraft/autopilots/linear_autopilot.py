"""The autopilot's equations evaluated and differentiated here, instead of in JSBSim."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.equations.catalogue import of_airframe, values_of
from aircraft.equations.language import PERIOD

Array = NDArray[np.float64]


# The commands that an autopilot is given, as its equations name them.
COMMANDS = ("v_cmd_mps", "omega_cmd_radps", "zeta_cmd_mps")


def loops(airframe: Airframe) -> dict[str, str]:
    """Plant inputs that the autopilot drives and that have a probe: name -> JSBSim property."""
    mine = of_airframe(airframe)
    outputs = {e.name: e.output for channel in mine.channels for e in channel.equations if e.output}
    named = [i.removesuffix("_probe") for i in mine.inputs if i.endswith("_probe")]
    return {name: str(outputs.get(f"{name}_norm") or outputs[f"servo_{name}"]) for name in named}


@dataclass(frozen=True)
class LinearAutopilot:
    """memory' = a memory + b used + e probe + f asked; sent = c memory + d used + g asked + probe.

    `asked` is COMMANDS, `sent` the plant inputs; names are those of `memory`.
    """

    names: tuple[str, ...]
    a: Array
    b: Array
    e: Array
    f: Array
    c: Array
    d: Array
    g: Array


def _interp(x: Any, *knots: Any) -> Any:
    """Straight lines between the knots x0, y0, x1, y1, ... and the end values beyond."""
    xs, ys = knots[::2], knots[1::2]
    y = ys[0]
    for x0, y0, x1, y1 in zip(xs, ys, xs[1:], ys[1:], strict=False):
        y = y + (y1 - y0) * np.clip((x - x0) / (x1 - x0), 0.0, 1.0)
    return y


_CALLS: dict[str, Any] = {
    "min": lambda *a: np.minimum.reduce(np.broadcast_arrays(*a)),
    "max": lambda *a: np.maximum.reduce(np.broadcast_arrays(*a)),
    "clip": lambda x, low, high: np.maximum(low, np.minimum(x, high)),
    "where": np.where,
    "interp": _interp,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan": np.arctan,
    "normal": lambda: 0.0,
}


def evaluate(airframe: Airframe, values: Mapping[str, Any], frame: int | None = None) -> dict[str, Any]:
    """One period of the autopilot's equations, here instead of in JSBSim; values may be arrays.

    values  every name the equations use or assign, `dt` and the channels' `period` in seconds; returns them
            after the period.
    frame   number of the period: only channels that are due run, each with the period of its own; None runs
            all with `period`
    """
    now: dict[str, Any] = {**values_of(airframe), **values}
    now.setdefault(PERIOD, now.get("dt"))
    for channel in of_airframe(airframe).channels:
        if frame is not None:
            every = channel.periods(now["dt"])
            if frame % every:
                continue
            now[PERIOD] = every * now["dt"]
        # A channel is on or off as a whole; perturbations do not switch it.
        if channel.condition is None or np.all(now[channel.condition] != 0):
            for e in channel.equations:
                now[e.name] = eval(_compiled(e.formula), {"__builtins__": {}, **_CALLS}, now)
    return now


@cache
def _compiled(formula: str) -> Any:
    return compile(ast.parse(formula, mode="eval"), "<autopilot.eq>", "eval")


def linearise(
    airframe: Airframe,
    memory: Mapping[str, float],
    dt: float,
    names: tuple[str, ...],
    frames: Sequence[int | None] = (None,),
) -> list[LinearAutopilot]:
    """The equations' derivatives around `memory`, by central differences, all columns in one evaluation.

    frames  one linearisation for each, with a common memory; see `evaluate`
    """
    assigned, used = of_airframe(airframe).assigned(), list(of_airframe(airframe).uses)
    probes = [f"{name}_probe" for name in names]
    columns = [*assigned, *used, *probes, *COMMANDS]
    outputs = [*assigned, *(f"{name}_norm" for name in names)]
    centre = np.array([memory[n] for n in columns])
    steps = 1e-6 * np.maximum(np.abs(centre), 1e-2)
    if "dt" in used:
        steps[len(assigned) + used.index("dt")] = 0.0
    shifts = np.concatenate([np.diag(steps), -np.diag(steps)], axis=1)
    values: dict[str, Any] = {**memory, **dict(zip(columns, centre[:, None] + shifts, strict=True))}
    values |= {"dt": dt, PERIOD: dt}
    n, s, u = len(columns), len(assigned), len(assigned) + len(used)
    p = u + len(probes)
    found = []
    for frame in frames:
        after = evaluate(airframe, values, frame)
        spread = np.array([np.broadcast_to(after[o], 2 * n) for o in outputs])
        found.append((spread[:, :n] - spread[:, n:]) / (2 * np.where(steps == 0, 1.0, steps)))
    # Only what is read before it is assigned is memory; what a frame merely holds is not read in it.
    moving = found if len(found) == 1 else [_without_holding(jacobian, s) for jacobian in found]
    kept = np.flatnonzero(np.any([np.any(jacobian[:, :s] != 0, axis=0) for jacobian in moving], axis=0))
    return [
        LinearAutopilot(
            tuple(assigned[k] for k in kept),
            jacobian[np.ix_(kept, kept)],
            jacobian[kept, s:u],
            jacobian[kept, u:p],
            jacobian[kept, p:],
            jacobian[s:][:, kept],
            jacobian[s:, s:u],
            jacobian[s:, p:],
        )
        for jacobian in found
    ]


def _without_holding(jacobian: Array, assigned: int) -> Array:
    """The derivatives without the ones of assigned names that keep their value."""
    held = np.all(np.abs(jacobian - np.eye(*jacobian.shape)) < 1e-12, axis=1)
    held[assigned:] = False
    return np.where(held[:, None], 0.0, jacobian)
