"""Starts a flight: steady flight found on the model itself, with the autopilot settled in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.rest import ACCELERATIONS, Instance, Start, initialise, place

G_MPS2 = 9.80665


@dataclass(frozen=True)
class Trim:
    """Steady flight: attitude, angles to the air [rad], commands [-1, 1] and [0, 1], airspeed [m/s]."""

    roll: float
    pitch: float
    yaw: float  # JSBSim's: clockwise from north
    alpha: float
    beta: float
    elevator: float
    aileron: float
    throttle: float
    airspeed: float
    rudder: float = 0.0


def trim(fdm: Instance, start: Start, omega: float = 0.0) -> Trim:
    """Steady flight at the start's place and air-relative velocity, turning at `omega` [rad/s].

    With a rudder it is free of sideslip, without one the sideslip is what it is. Leaves JSBSim initialised
    there without wind and the commands set. Raises FdmError if there is no such flight.
    """
    from scipy.optimize import root

    n, name = fdm.nodes, fdm.airframe.name
    air, _ = place(fdm, start)
    speed = float(np.linalg.norm(air))
    if not speed > 0:
        raise FdmError(f"{name} cannot fly at airspeed {speed:g} m/s")
    heading, climb = math.atan2(air[1], air[0]), math.asin(-air[2] / speed)
    n["on"].set_double_value(0.0)
    rudder = fdm.airframe.has_rudder
    inputs = ("elevator", "aileron", "throttle", "rudder") if rudder else ("elevator", "aileron", "throttle")
    balance = (*ACCELERATIONS, "beta") if rudder else ACCELERATIONS

    def residuals(unknown: Sequence[Any]) -> list[float]:
        roll, above, aside, *commands = unknown
        for node, value in zip(inputs, commands, strict=True):
            n[node].set_double_value(value)
        initialise(fdm, (roll, climb + above, heading + aside), air, -omega)
        return [n[k].get_double_value() for k in balance]

    bank = -math.atan(speed * omega / G_MPS2)
    guess = [bank, 0.05 / math.cos(bank), 0.0, 0.0, 0.0, 0.4, 0.0]
    x = root(residuals, guess[: len(balance)], tol=1e-13).x
    missed = max(map(abs, residuals(x)))
    roll, above, aside, elevator, aileron, throttle = map(float, x[:6])
    within = all(abs(c) <= 1 for c in (elevator, aileron, *x[6:])) and 0 <= throttle <= 1
    if not (missed < 1e-6 and within):
        raise FdmError(
            f"{name} cannot fly steadily at ground speed {start.v:g} m/s, climb "
            f"{start.zeta:g} m/s, turn {omega:g} rad/s, wind {start.wind} m/s; at airspeed {speed:.2f} "
            f"m/s the nearest is elevator {elevator:.2f}, throttle {throttle:.2f}, off by {missed:.1e}"
        )
    alpha, beta = n["alpha"].get_double_value(), n["beta"].get_double_value()
    steered = float(x[6]) if rudder else 0.0
    return Trim(
        roll, climb + above, heading + aside, alpha, beta, elevator, aileron, throttle, speed, steered
    )


def start(fdm: Instance, at: Start) -> Trim:
    """Trim, take the start's place, velocity and wind, settle the autopilot's states and switch it on."""
    n = fdm.nodes
    found = trim(fdm, at)
    _, ground = place(fdm, at, correct=True)
    initialise(fdm, (found.roll, found.pitch, found.yaw), ground, 0.0)
    fdm.blow(at.wind)
    fdm.command(at.v, 0.0, at.zeta)
    # Initialising knew no wind: evaluate everything again without moving, and keep the old acceleration,
    # which Adams-Bashforth would take, out of the first period.
    fdm.evaluate()
    fdm.forget_acceleration()
    n["on"].set_double_value(1.0)
    for _ in range(2):  # elevator and throttle depend a little on each other's integrator
        _settle(fdm, "aileron_wanted", found.aileron, "turn_integral")
        _settle(fdm, "elevator_wanted", found.elevator, "climb_integral")
        _settle(fdm, "throttle_wanted", found.throttle, "speed_integral")
    for _ in range(3):
        fdm.evaluate()
    return found


def _settle(fdm: Instance, wanted: str, target: float, integral: str) -> None:
    """Choose an integrator's state so that the autopilot's output is `target`, by secants."""
    n = fdm.nodes

    def miss(value: float) -> float:
        n[integral].set_double_value(value)
        for _ in range(4):  # what the surfaces do to the side force comes back one evaluation later
            fdm.evaluate()
        return n[wanted].get_double_value() - target

    a, b = 0.0, 0.05
    miss_a, miss_b = miss(a), miss(b)
    for _ in range(8):
        if abs(miss_b) < 1e-12 or miss_b == miss_a:
            break
        a, miss_a, b = b, miss_b, b - miss_b * (b - a) / (miss_b - miss_a)
        miss_b = miss(b)
