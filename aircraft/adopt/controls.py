"""Finds an aircraft's controls: surfaces, signs, travels, sharing, and the lags of actuators and thrust."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.rig import DT_S, Held, Rig
from aircraft.airframes.schema import RECORDED_ANGLES
from aircraft.airframes.setup import is_property
from aircraft.jsbsim.engines import run_held
from aircraft.jsbsim.geodesy import G_MPS2

Array = NDArray[np.float64]

STAGE = "controls"
NOMINAL_RAD = 0.35  # travel of a surface whose position the model does not give
# The command's acceleration in `Rig.read`, and the effect [rad/s^2 at full command] that counts as none.
AXES = {"elevator": 4, "aileron": 3, "rudder": 5}
_LEAST_RADPS2 = {"elevator": 0.02, "aileron": 0.03, "rudder": 0.005}
_STEP = 0.1  # of full command
_ANSWER_PERIODS = 240
_UNSETTLED = 0.05  # of an answer, that may still change over its last quarter
_MOVES_RAD = 1e-3


@dataclass(frozen=True)
class Control:
    """One command: what it moves and how quickly.

    travel      rad, of the surface at full command; signed so that elevator down, aileron right wing down and
                the rudder's nose-left moment are positive, as the autopilot has them
    lag         s, until 63 % of a step's acceleration
    surfaces    properties of positions [rad] that follow
    """

    name: str
    travel: float
    lag: float
    surfaces: tuple[str, ...]
    measured: bool  # whether the travel is the model's, not nominal


@dataclass(frozen=True)
class Controls:
    """All commands; there is no rudder where it does nothing."""

    elevator: Control
    aileron: Control
    rudder: Control | None
    shared: bool  # elevator and aileron move the same surfaces: elevons, a V-tail with roll
    notes: tuple[str, ...]

    def surfaces(self) -> dict[str, str]:
        """Telemetry name -> property, of every surface that moves."""
        paths = [p for c in (self.elevator, self.aileron, self.rudder) if c is not None for p in c.surfaces]
        return {_telemetry_name(path): path for path in dict.fromkeys(paths)}


def find_controls(rig: Rig, held: Held) -> Controls:
    """Move every command in a steady flight that is held. Raises AdoptionError at "controls"."""
    positions = _positions(rig)
    notes: list[str] = []
    found: dict[str, Control | None] = {}
    for name, axis in AXES.items():
        slope = _slope(held, name, axis)
        if abs(slope) < _LEAST_RADPS2[name]:
            found[name] = None
            continue
        moved, travel = _moved(rig, held, name, positions)
        if not moved:
            notes.append(f"no surface position follows the {name}: a travel of {NOMINAL_RAD} rad is assumed")
        size = travel if moved else NOMINAL_RAD
        wanted = 1.0 if name == "aileron" else -1.0
        lag = _lag(held, name, axis, notes)
        found[name] = Control(name, float(wanted * np.sign(slope) * size), lag, tuple(moved), bool(moved))
    elevator, aileron = found["elevator"], found["aileron"]
    for name in ("elevator", "aileron"):
        if found[name] is None:
            what = "pitches" if name == "elevator" else "rolls"
            raise AdoptionError(STAGE, f"nothing {what} it: fcs/{name}-cmd-norm has no effect")
    assert elevator is not None and aileron is not None
    shared = bool(set(elevator.surfaces) & set(aileron.surfaces))
    if found["rudder"] is None:
        notes.append("it has no rudder that yaws it: turns are flown with aileron alone")
    if shared:
        notes.append("elevator and aileron share surfaces")
    return Controls(elevator, aileron, found["rudder"], shared, tuple(notes))


def has_rudder(rig: Rig) -> bool:
    """Whether fcs/rudder-cmd-norm yaws the aircraft, in flight that need not be steady."""
    speed = float(np.sqrt(2 * rig.mass * G_MPS2 / (rig.density * rig.wing_area * 0.6)))
    commands = dict.fromkeys(AXES, 0.0) | {"throttle": rig.airframe.engines.idle}
    attitude, velocity = np.array([0.0, 0.05, 0.0]), speed * np.array([np.cos(0.05), 0.0, np.sin(0.05)])
    held = Held(rig, attitude, velocity, commands, [])
    return abs(_slope(held, "rudder", AXES["rudder"])) >= _LEAST_RADPS2["rudder"]


def _slope(held: Held, name: str, axis: int) -> float:
    """Angular acceleration by a command, per full command [rad/s^2]."""
    at = held.commands[name]
    low, high = max(at - _STEP, -1.0), min(at + _STEP, 1.0)
    change = held.measure(commands={name: high})[axis] - held.measure(commands={name: low})[axis]
    if not np.isfinite(change):
        raise AdoptionError(STAGE, f"its accelerations are not finite when the {name} moves")
    return float(change / (high - low))


def _positions(rig: Rig) -> list[str]:
    """Properties of the model that say a surface's position in rad."""
    listed = str(rig.fdm.executive.query_property_catalog("pos-rad"))
    # A property with properties below it, as an actuator's, is listed by those alone.
    found = {m[0] for m in re.finditer(r"(?m)^\S*?pos-rad(?=[\s/])", listed + "\n")}
    return sorted(p for p in found if is_property(p) and not p.split("/")[-1].startswith("mag-"))


def _moved(rig: Rig, held: Held, name: str, positions: list[str]) -> tuple[list[str], float]:
    """The positions that follow a command, and how far from -1 to 1, halved [rad]."""
    nodes = [rig.fdm.node(p) for p in positions]
    ends = []
    for command in (-1.0, 1.0):
        held.measure(commands={name: command}, periods=120)
        ends.append(np.array([n.get_double_value() for n in nodes]))
    if not nodes:
        return [], 0.0
    change = np.abs(ends[1] - ends[0]) / 2
    moved = [p for p, c in zip(positions, change, strict=True) if _MOVES_RAD < c < np.pi / 2]
    return moved, float(max((c for c in change if _MOVES_RAD < c < np.pi / 2), default=0.0))


def _lag(held: Held, name: str, axis: int, notes: list[str]) -> float:
    at = held.commands[name]
    step = _STEP if at < 0.5 else -_STEP
    answer = held.answer(name, step, axis, _ANSWER_PERIODS)
    change = answer - answer[0]
    if abs(change[-1]) < 1e-9:
        return DT_S
    if abs(change[-1] - change[-_ANSWER_PERIODS // 4]) > _UNSETTLED * np.abs(change).max():
        notes.append(
            f"the model's own flight control still moves {name} after {_ANSWER_PERIODS * DT_S:.1f} s"
        )
    share = change / (change[np.argmax(np.abs(change))] or 1.0)
    return max(float(np.argmax(share >= 0.632)) * DT_S, DT_S)


def thrust_lag(held: Held, step: float = 0.3) -> float:
    """Time [s] until 63 % of what a step of the throttle adds along the path."""
    engines = held.rig.airframe.engines
    at = held.commands["throttle"]
    step = step if at + step <= engines.full else -step
    held.measure()
    fdm = held.rig.fdm
    values = [float(held.rig.read()[:3] @ held.along)]
    fdm.nodes["throttle"].set_double_value(float(np.clip(at + step, engines.idle, engines.full)))
    for _ in range(600):
        run_held(fdm, 4, at_once=False)
        values.append(float(held.rig.read()[:3] @ held.along))
    change = np.array(values) - values[0]
    if abs(change[-1]) < 1e-6:
        return 0.1
    share = change / change[-1]
    return max(float(np.argmax(share >= 0.632)) * 4 * DT_S, 4 * DT_S)


def _telemetry_name(path: str) -> str:
    """fcs/left-aileron-pos-rad as left_aileron_rad."""
    words = path.split("/")[-1].removesuffix("-pos-rad").lower()
    name = "".join(c if c.isalnum() else "_" for c in words).strip("_") + "_rad"
    return f"surface_{name}" if name in RECORDED_ANGLES or not name[0].isalpha() else name
