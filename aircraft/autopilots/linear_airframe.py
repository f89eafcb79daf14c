"""Linearises the airframe and its actuators around level flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe, property_name
from aircraft.equations.catalogue import of_airframe
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start, hold, rotation

Array = NDArray[np.float64]

# The airframe's state: velocity north, east, down [m/s], roll, pitch, yaw [rad], body rates [rad/s].
STATES = ("north", "east", "down", "roll", "pitch", "yaw", "p", "q", "r")
_STEPS = np.array([1e-3] * 3 + [1e-5] * 3 + [1e-4] * 3)
_COMMAND_STEP = 1e-4  # of full deflection


class NotFirstOrderError(FdmError):
    """A surface follows its command by more than a first-order lag."""


@dataclass(frozen=True)
class Point:
    """Level flight, and the derivatives of the airframe there.

    trim     values of STATES
    a, b     d(STATES)/dt by STATES (9, 9) and by the actuated commands (9, M)
    c, d     properties the autopilot uses (U) by STATES (U, 9) and by the commands (U, M)
    memory   the autopilot's values, name -> value
    engine_lag  whether engines have a lag of their own, which is left out: they count as settled
    """

    trim: Array
    a: Array
    b: Array
    c: Array
    d: Array
    memory: dict[str, float]
    engine_lag: bool = False


def derivative(fdm: Fdm, x: Array, commands: Mapping[str, float]) -> Array:
    """d(STATES)/dt at `x` with the actuators at `commands` (property -> value), in still air."""
    turn, rates = rotation(*x[3:6]), x[6:]
    body = turn.T @ x[:3]
    accelerations = hold(fdm, body, x[3:6], rates, commands)
    roll, pitch = x[3:5]
    p, q, r = rates
    yaw_rate = (q * np.sin(roll) + r * np.cos(roll)) / np.cos(pitch)
    euler = [p + yaw_rate * np.sin(pitch), q * np.cos(roll) - r * np.sin(roll), yaw_rate]
    return np.concatenate([turn @ (accelerations[:3] + np.cross(rates, body)), euler, accelerations[3:]])


def differentiate(airframe: Airframe, v: float, dt: float, names: Mapping[str, str]) -> Point:
    fdm = Fdm(airframe, dt, Origin())
    trim = fdm.start(Start(0.0, 0.0, 0.0, 0.0, v))
    mine = of_airframe(airframe)
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
    return Point(
        x, states[:9], inputs[:9], states[9:], inputs[9:], memory, engine_lag=bool(fdm.engine_states)
    )


def actuator(airframe: Airframe, v: float, dt: float, path: str) -> tuple[float, float]:
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
        raise NotFirstOrderError(f"{airframe.name}: no surface named in airframe.toml follows {path}")
    # x moves by g (1 - p) p^k after the part g direct that passes in the first period
    poles = np.where(np.abs(moves[:, 1]) > 1e-12, moves[:, 2] / np.where(moves[:, 1] == 0, 1, moves[:, 1]), 0)
    pole = float(poles[0])
    later = moves[:, 1:2] * pole ** np.arange(moves.shape[1] - 1)
    if np.abs(moves[:, 1:] - later).max() > 1e-3 * _COMMAND_STEP * np.abs(moves).max() / _COMMAND_STEP:
        raise NotFirstOrderError(
            f"{airframe.name}: what follows {path} is no first-order lag; the linear model needs one"
        )
    whole = moves[0, 0] + moves[0, 1] / (1 - pole)
    return pole, float(moves[0, 0] / whole)
