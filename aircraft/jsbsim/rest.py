"""Places an aircraft without flying it: initial conditions, and its accelerations at a given state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.engines import settle
from aircraft.jsbsim.geodesy import M_PER_FT, Origin, enu_axes

Array = NDArray[np.float64]

ACCELERATIONS = ("udot", "vdot", "wdot", "pdot", "qdot", "rdot")  # names in `properties.NODES`


@dataclass(frozen=True)
class Start:
    """Where an aircraft begins: position [m], course [rad], ground speed, climb rate and wind [m/s], ENU."""

    x: float
    y: float
    z: float
    theta: float
    v: float
    zeta: float = 0.0
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Instance(Protocol):
    """The part of `aircraft.jsbsim.fdm.Fdm` that is used before the flight."""

    airframe: Airframe
    origin: Origin
    nodes: dict[str, Any]  # by the names in `properties.NODES`

    executive: Any  # JSBSim itself
    engine_states: list[Any]  # what an engine keeps from period to period; none for most electric ones
    forgets: bool | None  # whether engines lose that at dt = 0
    spools: list[tuple[Any, float]]  # states that are written after the first period flown

    def node(self, path: str) -> Any: ...

    def run_ic(self) -> None: ...

    def evaluate(self) -> None: ...

    def forget_acceleration(self) -> None: ...

    def command(self, v: float, omega: float, zeta: float) -> None: ...

    def blow(self, wind: tuple[float, float, float]) -> None: ...


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Body axes to north-east-down (3, 3), angles in rad.

    Written out: scipy's Rotation takes 22 us instead of 4 us, the trim calls this some hundred times, and
    another rounding of the start is a visibly different flight in turbulence. A test compares the two.
    """
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    return np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def place(fdm: Instance, start: Start, correct: bool = False) -> tuple[Array, Array]:
    """Write the start's place; returns air-relative and ground velocity [m/s], north-east-down.

    correct  take the error of the initialisation before this one off the height: JSBSim's initial
             altitude is not exactly geodetic, 1.6 mm low at 300 m
    """
    latitude, longitude, altitude = fdm.origin.geodetic(start.x, start.y, start.z)
    n = fdm.nodes
    low = altitude / M_PER_FT - n["altitude"].get_double_value() if correct else 0.0
    n["ground_ic"].set_double_value(fdm.origin.ground_m / M_PER_FT)
    n["latitude_ic"].set_double_value(latitude)
    n["longitude_ic"].set_double_value(longitude)
    n["altitude_ic"].set_double_value(altitude / M_PER_FT + low)
    # Course and speed are in the origin's plane: find the level velocity here whose projection they are.
    to_origin = fdm.origin.axes[:2] @ enu_axes(latitude, longitude).T
    course = np.array([math.cos(start.theta), math.sin(start.theta)])
    east, north = np.linalg.solve(to_origin[:, :2], start.v * course - to_origin[:, 2] * start.zeta)
    ground = np.array([north, east, -start.zeta])
    wind_east, wind_north, wind_up = start.wind
    return ground - np.array([wind_north, wind_east, -wind_up]), ground


def initialise(fdm: Instance, attitude: tuple[float, float, float], velocity: Array, yaw_rate: float) -> None:
    """Initialise at roll, pitch, yaw [rad], velocity over the ground [m/s, north-east-down] and the yaw rate
    of a steady turn [rad/s, clockwise]."""
    turn = np.ascontiguousarray(rotation(*attitude).T)
    rates = turn @ np.array([0.0, 0.0, yaw_rate])
    write_ic(fdm, attitude, turn @ velocity, rates)
    fdm.run_ic()


def hold(
    fdm: Instance,
    velocity: Sequence[float] | Array,
    attitude: Sequence[float] | Array,
    rates: Sequence[float] | Array,
    commands: Mapping[str, float],
) -> Array:
    """Evaluate all models without moving, in still air, the autopilot off.

    velocity  body axes, relative to the air [m/s];  attitude  roll, pitch, yaw [rad]
    rates     p, q, r [rad/s];  commands  property -> value, taken by the actuators at once
    Returns   the derivatives of velocity and rates along body axes, (6,) [m/s^2, rad/s^2]
    """
    fdm.nodes["on"].set_double_value(0.0)
    for path, value in commands.items():
        fdm.node(path).set_double_value(value)
    write_ic(fdm, attitude, velocity, rates)
    fdm.run_ic()
    settle(fdm)
    # Forces that depend on accelerations come back one evaluation later; a captive run has had its share.
    for _ in range(0 if fdm.forgets else 3):
        fdm.evaluate()
    read = [fdm.nodes[k].get_double_value() for k in ACCELERATIONS]
    return np.array([*(M_PER_FT * x for x in read[:3]), *read[3:]])


def write_ic(
    fdm: Instance,
    attitude: Sequence[float] | Array,
    velocity: Sequence[float] | Array,
    rates: Sequence[float] | Array,
) -> None:
    """Initial conditions: roll, pitch, yaw [rad], velocity and rates along body axes [m/s, rad/s]."""
    names = ("roll_ic", "pitch_ic", "yaw_ic", "u_ic", "v_ic", "w_ic", "p_ic", "q_ic", "r_ic")
    values = [*attitude, *(x / M_PER_FT for x in velocity), *rates]
    for name, value in zip(names, values, strict=True):
        fdm.nodes[name].set_double_value(float(value))
