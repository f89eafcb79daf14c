"""Writes the linear model of an aircraft and its autopilot for other programs: JSON and MATLAB's .mat.

Three kinds of state-space systems, each with names and units of its states, inputs and outputs:

- `bare_airframe`: the aircraft alone, continuous, from what the surfaces and the throttle do to its motion;
- `closed_loop`: airframe, actuators and autopilot with all loops closed, discrete, from the commands and from
  an addition to each plant input, to the motion and to what is sent to the plant inputs;
- `loop_NAME`: the loop transfer L broken at the plant input NAME, discrete, for negative feedback.

All are of deviations from level flight, whose values stand beside the names.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.autopilots.linear_airframe import STATES
from aircraft.autopilots.linear_autopilot import COMMANDS
from aircraft.autopilots.linear_model import Model, linear_model
from aircraft.equations.units import unit_of

Array = NDArray[np.float64]

FORMAT = "cbf-jsbsim-testbed linear model 1"
_MOTION = {"north": "m/s", "east": "m/s", "down": "m/s", "roll": "rad", "pitch": "rad", "yaw": "rad"}
_MOTION |= {"p": "rad/s", "q": "rad/s", "r": "rad/s"}
_NORM = "share of full deflection"
OUTPUTS = ("v_mps", "omega_radps", "zeta_mps")  # ground speed, course rate, climb rate


@dataclass(frozen=True)
class System:
    """x' = A x + B u (or x[k+1], if dt > 0), y = C x + D u, around the values `at` of level flight.

    dt  s; 0 for continuous time
    """

    a: Array
    b: Array
    c: Array
    d: Array
    dt: float
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: dict[str, str]  # of every name

    def as_dict(self) -> dict[str, Any]:
        """Matrices as arrays, names and units as lists in the order of rows and columns."""
        named = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        made: dict[str, Any] = {"A": self.a, "B": self.b, "C": self.c, "D": self.d, "dt": self.dt}
        for kind, names in named.items():
            made[kind] = list(names)
            made[kind.removesuffix("s") + "_units"] = [self.units[name] for name in names]
        return made


def systems(model: Model) -> dict[str, System]:
    """Every system of a linear model, by name."""
    point, m = model.point, len(model.loops)
    surfaces = tuple(f"{name}_moved" for name in model.loops)
    sent, added = (tuple(f"{name}_{what}" for name in model.loops) for what in ("norm", "probe"))
    units = {name: _unit(name) for name in (*model.states, *surfaces, *sent, *added, *COMMANDS, *OUTPUTS)}
    alone = System(point.a, point.b, np.eye(9), np.zeros((9, m)), 0.0, STATES, surfaces, STATES, units)
    n = len(model.a)
    closed = System(
        model.a,
        np.hstack([model.e, model.b]),
        np.vstack([_motion(n, float(point.trim[1])), model.c]),
        np.vstack([np.zeros((3, 3 + m)), np.hstack([model.f, np.eye(m)])]),
        model.dt,
        model.states,
        (*COMMANDS, *added),
        (*OUTPUTS, *sent),
        units,
    )
    found = {"bare_airframe": alone, "closed_loop": closed}
    for k, name in enumerate(model.loops):
        a, b, c = model.loop(name)
        found[f"loop_{name}"] = System(
            a, b, c, np.zeros((1, 1)), model.dt, model.states, (added[k],), (sent[k],), units
        )
    return found


def _motion(n: int, v: float) -> Array:
    """Rows that read ground speed, course rate and climb rate out of n states of eastward flight at v."""
    rows = np.zeros((3, n))
    rows[0, STATES.index("east")] = 1.0
    rows[1, 9 + STATES.index("north")] = 1.0 / v  # the rate of the velocity across the path
    rows[2, STATES.index("down")] = -1.0
    return rows


def _unit(name: str) -> str:
    core = name.removesuffix("_before").removesuffix("_rate")
    if core in _MOTION:
        rated = {"m/s": "m/s2", "rad": "rad/s", "rad/s": "rad/s2"}
        return rated[_MOTION[core]] if core != name else _MOTION[core]
    if core == "height":
        return "m"
    if name.endswith(("_moved", "_lag", "_probe")):
        return _NORM
    if "/" in name:
        return "load factor" if name.startswith("accelerations/N") else "as in JSBSim"
    return unit_of(name) or "not stated"


def exported(airframe: Airframe, v: float) -> dict[str, Any]:
    """What a file holds: about the aircraft, its level flight at v [m/s], and every system.

    Raises  FdmError where it cannot fly level, or a surface follows by more than a first-order lag
    """
    model = linear_model(airframe, v)
    point = model.point
    level = {name: float(x) for name, x in zip(STATES, point.trim, strict=True)}
    level |= {f"{name}_norm": float(point.memory[f"{name}_norm"]) for name in model.loops}
    level |= {name: float(point.memory[name]) for name in COMMANDS}
    about: dict[str, Any] = {
        "format": FORMAT,
        "aircraft": airframe.name,
        "autopilot": airframe.fit,
        "fingerprint": airframe.fingerprint(),
        "speed_mps": v,
        "level_flight": level,
    }
    if model.frames is not None:
        about["note"] = "channels that run every few periods count as running in each: see the guide"
    return about | {name: system.as_dict() for name, system in systems(model).items()}


def write(path: Path, content: dict[str, Any]) -> None:
    """A .json or a .mat file, by the ending. Equal contents give equal bytes. Raises OSError."""
    if path.suffix == ".json":
        text = json.dumps(content, indent=1, default=lambda x: x.tolist(), allow_nan=False)
        path.write_text(text + "\n", encoding="utf-8")
        return
    from scipy.io import savemat

    with path.open("wb") as file:
        savemat(file, _for_matlab(content), long_field_names=True, oned_as="column")
        # The header says when it was written: 116 bytes of text, of which MATLAB reads none.
        file.seek(0)
        file.write(f"MATLAB 5.0 MAT-file, {FORMAT}".ljust(116).encode("ascii"))


def _for_matlab(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _for_matlab(inner) for name, inner in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return np.array(value, dtype=object).reshape(-1, 1)  # a cell array
    return value
