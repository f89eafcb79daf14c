"""The aircraft and its autopilot as one linear discrete-time system around level flight.

Built from parts, none of them a recording of the whole: JSBSim's accelerations differentiated at rest, its
integration scheme and order of evaluation, actuators from a step, and the autopilot's equations
differentiated as text. `margins` measures the same loops in flight; a test compares the two.

Two things are simplified, both far above the crossovers: channels that run every few periods count as running
in each, and forces due to the angle of attack's rate, which JSBSim feeds back a period late, act at once.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframe import Airframe
from aircraft.autopilots.equations import EQUATIONS, Equations, parse, property_name
from aircraft.jsbsim.fdm import Fdm, FdmError, Start
from aircraft.jsbsim.geodesy import Origin

Array = NDArray[np.float64]

# The airframe's state: velocity north, east, down [m/s], roll, pitch, yaw [rad], body rates [rad/s].
STATES = ("north", "east", "down", "roll", "pitch", "yaw", "p", "q", "r")
_STEPS = np.array([1e-3] * 3 + [1e-5] * 3 + [1e-4] * 3)
_COMMAND_STEP = 1e-4  # of full deflection
# Frames by which a property is old when the autopilot, which runs right after the propagation, reads it.
_FRESH = ("velocities/v-", "velocities/h-dot", "velocities/p-", "velocities/q-", "velocities/r-", "attitude/")
_FRESH_BUT_NOT = ("velocities/vt", "velocities/vg", "velocities/p-aero", "velocities/q-aero")
_TWICE_OLD = ("accelerations/N",)


@dataclass(frozen=True)
class Point:
    """Level flight, and the derivatives of the airframe there.

    trim     values of STATES
    a, b     d(STATES)/dt by STATES (9, 9) and by the actuated commands (9, M)
    c, d     properties the autopilot uses (U) by STATES (U, 9) and by the commands (U, M)
    memory   the autopilot's values, name -> value
    """

    trim: Array
    a: Array
    b: Array
    c: Array
    d: Array
    memory: dict[str, float]


@dataclass(frozen=True)
class Model:
    """x[k+1] = a x[k] + b probe[k], total[k] = c x[k] + probe[k], every dt seconds; all loops closed.

    `total` is what the autopilot sends to the plant inputs `loops`, the probe included. `point` is the
    airframe alone, in continuous time.
    """

    a: Array
    b: Array
    c: Array
    dt: float
    loops: tuple[str, ...]
    point: Point

    def loop(self, name: str) -> tuple[Array, Array, Array]:
        """(a, b, c) of the loop broken at plant input `name`, negative feedback, the others closed.

        The closed loop is S = 1 / (1 + L) from probe to total, so L = 1 / S - 1.
        """
        k = self.loops.index(name)
        b, c = self.b[:, k : k + 1], self.c[k : k + 1]
        return self.a - b @ c, b, -c


@cache
def _all_equations() -> Equations:
    return parse(EQUATIONS.read_text())


def equations(airframe: Airframe) -> Equations:
    """The autopilot's, those that this airframe has."""
    return _all_equations().of(airframe.gain_values())


def loops(airframe: Airframe) -> dict[str, str]:
    """Plant inputs that the autopilot drives and that have a probe: name -> JSBSim property."""
    mine = equations(airframe)
    outputs = {e.name: e.output for channel in mine.channels for e in channel.equations if e.output}
    named = [i.removesuffix("_probe") for i in mine.inputs if i.endswith("_probe")]
    return {name: str(outputs[f"{name}_norm"]) for name in named}


def linear_model(airframe: Airframe, v: float, dt: float = 0.005) -> Model:
    """The aircraft in level flight at ground speed v [m/s] in still air.

    Raises  FdmError where it cannot fly level, or where an actuator is no first-order lag.
    """
    names = loops(airframe)
    point = _differentiate(airframe, v, dt, names)
    poles, direct = np.array([_actuator(airframe, v, dt, path) for path in names.values()]).T
    autopilot = _autopilot(airframe, point.memory, dt, tuple(names))
    advance = _Advance(point, autopilot, list(equations(airframe).uses.values()), poles, direct, dt)
    n, m = advance.size, len(names)
    columns, totals = zip(*(advance(z, np.zeros(m)) for z in np.eye(n)), strict=True)
    inputs, _ = zip(*(advance(np.zeros(n), u) for u in np.eye(m)), strict=True)
    return Model(np.array(columns).T, np.array(inputs).T, np.array(totals).T, dt, tuple(names), point)


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Body to north-east-down (3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    return np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def derivative(fdm: Fdm, x: Array, commands: Mapping[str, float]) -> Array:
    """d(STATES)/dt at `x` with the actuators at `commands` (property -> value), in still air."""
    turn, rates = rotation(*x[3:6]), x[6:]
    body = turn.T @ x[:3]
    accelerations = fdm.hold(body, x[3:6], rates, commands)
    roll, pitch = x[3:5]
    p, q, r = rates
    yaw_rate = (q * np.sin(roll) + r * np.cos(roll)) / np.cos(pitch)
    euler = [p + yaw_rate * np.sin(pitch), q * np.cos(roll) - r * np.sin(roll), yaw_rate]
    return np.concatenate([turn @ (accelerations[:3] + np.cross(rates, body)), euler, accelerations[3:]])


def _differentiate(airframe: Airframe, v: float, dt: float, names: Mapping[str, str]) -> Point:
    fdm = Fdm(airframe, dt, Origin())
    trim = fdm.start(Start(0.0, 0.0, 0.0, 0.0, v))
    mine = equations(airframe)
    used = list(mine.uses.values())
    memory = {n: fdm.read(property_name(n)) for n in [*mine.assigned(), *mine.inputs]}
    memory |= {n: fdm.read(path) for n, path in mine.uses.items()}
    commands = {path: fdm.read(path) for path in names.values()}
    x = np.array([0.0, v, 0.0, trim.roll, trim.pitch, trim.yaw, 0.0, 0.0, 0.0])

    def both(state: Array, at: Mapping[str, float]) -> Array:
        rates = derivative(fdm, state, at)
        return np.concatenate([rates, [fdm.read(path) for path in used]])

    by_state = [
        (both(x + step, commands) - both(x - step, commands)) / (2 * step.max()) for step in np.diag(_STEPS)
    ]
    by_command = [
        (
            both(x, {**commands, path: commands[path] + _COMMAND_STEP})
            - both(x, {**commands, path: commands[path] - _COMMAND_STEP})
        )
        / (2 * _COMMAND_STEP)
        for path in names.values()
    ]
    states, inputs = np.array(by_state).T, np.array(by_command).T
    return Point(x, states[:9], inputs[:9], states[9:], inputs[9:], memory)


def _actuator(airframe: Airframe, v: float, dt: float, path: str) -> tuple[float, float]:
    """The first-order lag from a command to the surfaces that follow it: pole, share that passes at once."""
    fdm = Fdm(airframe, dt, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, v))
    fdm.node("ap/on").set_double_value(0.0)
    command = fdm.node(path)
    watched = [fdm.node(p) for p in (*airframe.surfaces.values(), "fcs/throttle-pos-norm")]
    rows = [[n.get_double_value() for n in watched]]
    command.set_double_value(command.get_double_value() + _COMMAND_STEP)
    for _ in range(6):
        fdm.run((0.0, 0.0, 0.0), 1)
        rows.append([n.get_double_value() for n in watched])
    moves = np.diff(rows, axis=0).T
    moves = moves[np.abs(moves).max(axis=1) > 1e-3 * _COMMAND_STEP]
    if not len(moves):
        raise FdmError(f"{airframe.name}: no surface named in airframe.toml follows {path}")
    # x moves by g (1 - p) p^k after the part g direct that passes in the first period
    poles = np.where(np.abs(moves[:, 1]) > 1e-12, moves[:, 2] / np.where(moves[:, 1] == 0, 1, moves[:, 1]), 0)
    pole = float(poles[0])
    later = moves[:, 1:2] * pole ** np.arange(moves.shape[1] - 1)
    if np.abs(moves[:, 1:] - later).max() > 1e-3 * _COMMAND_STEP * np.abs(moves).max() / _COMMAND_STEP:
        raise FdmError(
            f"{airframe.name}: what follows {path} is no first-order lag; the linear model needs one"
        )
    whole = moves[0, 0] + moves[0, 1] / (1 - pole)
    return pole, float(moves[0, 0] / whole)


@dataclass(frozen=True)
class _Autopilot:
    """memory' = a memory + b used + e probe; command = c memory + d used + probe."""

    a: Array
    b: Array
    e: Array
    c: Array
    d: Array


_CALLS: dict[str, Any] = {
    "min": lambda *a: np.minimum.reduce(np.broadcast_arrays(*a)),
    "max": lambda *a: np.maximum.reduce(np.broadcast_arrays(*a)),
    "clip": lambda x, low, high: np.maximum(low, np.minimum(x, high)),
    "where": np.where,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan": np.arctan,
}


def evaluate(airframe: Airframe, values: Mapping[str, Any]) -> dict[str, Any]:
    """One period of the autopilot's equations, here instead of in JSBSim; values may be arrays.

    values  every name the equations use or assign, `dt` in seconds; returns them after the period.
    """
    now: dict[str, Any] = {**airframe.gain_values(), **values}
    for channel in equations(airframe).channels:
        # A channel is on or off as a whole; perturbations do not switch it.
        if channel.condition is None or np.all(now[channel.condition] != 0):
            for e in channel.equations:
                now[e.name] = eval(_compiled(e.formula), {"__builtins__": {}, **_CALLS}, now)
    return now


@cache
def _compiled(formula: str) -> Any:
    return compile(ast.parse(formula, mode="eval"), "<autopilot.eq>", "eval")


def _autopilot(
    airframe: Airframe, memory: Mapping[str, float], dt: float, names: tuple[str, ...]
) -> _Autopilot:
    """The equations' derivatives around `memory`, by central differences, all columns in one evaluation."""
    assigned, used = equations(airframe).assigned(), list(equations(airframe).uses)
    probes = [f"{name}_probe" for name in names]
    columns = [*assigned, *used, *probes]
    centre = np.array([memory[n] for n in columns])
    steps = 1e-6 * np.maximum(np.abs(centre), 1e-2)
    steps[len(assigned) + used.index("dt")] = 0.0
    shifts = np.concatenate([np.diag(steps), -np.diag(steps)], axis=1)
    values: dict[str, Any] = {**memory, **dict(zip(columns, centre[:, None] + shifts, strict=True)), "dt": dt}
    after = evaluate(airframe, values)
    n = len(columns)
    outputs = [*assigned, *(f"{name}_norm" for name in names)]
    spread = np.array([np.broadcast_to(after[o], 2 * n) for o in outputs])
    jacobian = (spread[:, :n] - spread[:, n:]) / (2 * np.where(steps == 0, 1.0, steps))
    s, u = len(assigned), len(assigned) + len(used)
    # Only what is read before it is assigned is memory.
    kept = np.flatnonzero(np.any(jacobian[:, :s] != 0, axis=0))
    return _Autopilot(
        jacobian[np.ix_(kept, kept)],
        jacobian[kept, s:u],
        jacobian[kept, u:],
        jacobian[s:][:, kept],
        jacobian[s:, s:u],
    )


class _Advance:
    """One period of everything, linear, in JSBSim's order: propagate, autopilot, actuators, forces.

    z  STATES, their derivatives, the last velocity derivatives (Adams-Bashforth), surfaces, the autopilot's
       memory, the actuators' memory, properties that are two frames old
    """

    def __init__(
        self, point: Point, autopilot: _Autopilot, used: list[str], poles: Array, direct: Array, dt: float
    ) -> None:
        self._point, self._autopilot, self._dt = point, autopilot, dt
        self._poles, self._direct = poles, direct
        fresh = [p.startswith(_FRESH) and not p.startswith(_FRESH_BUT_NOT) for p in used]
        self._fresh, self._old = np.array(fresh), np.array([p.startswith(_TWICE_OLD) for p in used])
        m = len(poles)
        self._ends = np.cumsum([9, 9, 3, m, len(autopilot.a), m, int(self._old.sum())])
        self.size = int(self._ends[-1])

    def __call__(self, z: Array, probe: Array) -> tuple[Array, Array]:
        """The next z, and what is sent to the plant inputs."""
        x, rate, last, surface, memory, lag, old = np.split(z, self._ends[:-1])
        p, ap = self._point, self._autopilot
        move = rate.copy()
        move[:3] = 1.5 * rate[:3] - 0.5 * last
        after = x + self._dt * move
        seen = p.c @ x + p.d @ surface
        used = np.where(self._fresh, p.c @ after, seen)
        used[self._old] = old
        total = ap.c @ memory + ap.d @ used + probe
        # First-order lag, share `direct` at once: y = direct u + memory.
        moved = self._direct * total + lag
        lagging = self._poles * moved + (1 - self._poles - self._direct) * total
        parts = [after, p.a @ after + p.b @ moved, rate[:3], moved]
        parts += [ap.a @ memory + ap.b @ used + ap.e @ probe, lagging, seen[self._old]]
        return np.concatenate(parts), total
