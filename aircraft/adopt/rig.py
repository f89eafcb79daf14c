"""A model on a test rig: held, its accelerations measured at any attitude, rates and commands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.datasheets.datasheet import KG_PER_SLUG
from aircraft.jsbsim.engines import is_captive, run_held, settle, spools
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import M_PER_FT, Origin
from aircraft.jsbsim.rest import ACCELERATIONS, Start, place, rotation, write_ic
from aircraft.jsbsim.steady import Trim

Array = NDArray[np.float64]

DT_S = 0.005

_PERIODS = 60  # that a held aircraft runs before it is measured: its flight control answers in 0.3 s
COMMANDS = ("elevator", "aileron", "rudder", "throttle")


class Rig:
    """One instance of a model.

    Accelerations are (6,): forward, right, down [m/s^2], roll, pitch, yaw [rad/s^2], body axes.
    Raises  FdmError where the model cannot be loaded or its engines do not run
    """

    def __init__(self, airframe: Airframe) -> None:
        self.airframe = airframe
        self.fdm = Fdm(airframe, DT_S, Origin())
        place(self.fdm, Start(0.0, 0.0, 0.0, 0.0, airframe.speeds.start_mps))

    def trim(self, v: float, near: Trim | None = None, omega: float = 0.0, zeta: float = 0.0) -> Trim:
        """Steady flight at v [m/s] in still air. Raises FdmError, which says what is missing."""
        return self.fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v, zeta), omega, near)

    def at(self, trim: Trim) -> Held:
        """Take the flight of a trim as the one that is held; its engines are settled."""
        fdm = self.fdm
        attitude = np.array([trim.roll, trim.pitch, trim.yaw])
        path = np.array([np.cos(trim.alpha) * np.cos(trim.beta), np.sin(trim.beta)])
        body = trim.airspeed * np.array([path[0], path[1], np.sin(trim.alpha) * np.cos(trim.beta)])
        commands = {name: float(getattr(trim, name)) for name in COMMANDS}
        self.place(attitude, body, np.zeros(3), commands)
        settle(fdm)
        return Held(self, attitude, body, commands, spools(fdm))

    def place(self, attitude: Array, velocity: Array, rates: Array, commands: Mapping[str, float]) -> None:
        """Initialise at an attitude [rad], velocity [m/s] and rates [rad/s] in body axes."""
        fdm = self.fdm
        fdm.nodes["on"].set_double_value(0.0)
        for name, value in commands.items():
            fdm.nodes[name].set_double_value(value)
        write_ic(fdm, attitude, velocity, rates)
        fdm.run_ic()

    def read(self) -> Array:
        """The accelerations now."""
        values = [self.fdm.nodes[name].get_double_value() for name in ACCELERATIONS]
        return np.array([*(M_PER_FT * x for x in values[:3]), *values[3:]])

    def aerodynamic(self) -> Array:
        """Aerodynamic force over mass along body axes (3,) [m/s^2]."""
        mass = self.fdm.read("inertia/mass-slugs")
        return np.array([self.fdm.read(f"forces/fb{axis}-aero-lbs") for axis in "xyz"]) * M_PER_FT / mass

    @property
    def mass(self) -> float:
        """kg, fuel included."""
        return self.fdm.read("inertia/mass-slugs") * KG_PER_SLUG

    @property
    def wing_area(self) -> float:
        """m^2."""
        return self.fdm.read("metrics/Sw-sqft") * M_PER_FT**2

    @property
    def density(self) -> float:
        """kg/m^3."""
        return self.fdm.read("atmosphere/rho-slugs_ft3") * KG_PER_SLUG / M_PER_FT**3


class Held:
    """A steady flight, from which attitude, velocity, rates and commands are varied one at a time."""

    def __init__(
        self,
        rig: Rig,
        attitude: Array,
        velocity: Array,
        commands: dict[str, float],
        kept: list[tuple[Any, float]],
    ) -> None:
        self.rig, self.attitude, self.velocity, self.commands = rig, attitude, velocity, commands
        self._kept = kept
        self.speed = float(np.linalg.norm(velocity))
        self.along = velocity / self.speed  # the path, in body axes

    def measure(
        self,
        attitude: Array | None = None,
        velocity: Array | None = None,
        rates: Array | None = None,
        periods: int = _PERIODS,
        steady: bool = False,
        commands: Mapping[str, float] | None = None,
    ) -> Array:
        """Accelerations (6,) with what is given changed, after `periods` of a captive run.

        steady  wait until engines and flight control are steady instead
        """
        fdm = self.rig.fdm
        self.rig.place(
            self.attitude if attitude is None else attitude,
            self.velocity if velocity is None else velocity,
            np.zeros(3) if rates is None else rates,
            {**self.commands, **(commands or {})},
        )
        if steady and is_captive(fdm):
            settle(fdm)
        else:
            if self._kept:
                run_held(fdm, 1)
                for node, value in self._kept:
                    node.set_double_value(value)
            run_held(fdm, periods)
        return self.rig.read()

    def answer(self, command: str, step: float, channel: int, periods: int) -> Array:
        """Acceleration number `channel` (periods + 1,) after a step of a command, actuators as they are."""
        fdm = self.rig.fdm
        self.measure()
        values = [self.rig.read()[channel]]
        fdm.nodes[command].set_double_value(self.commands[command] + step)
        for _ in range(periods):
            run_held(fdm, 1, at_once=False)
            values.append(self.rig.read()[channel])
        return np.array(values)

    def turned(self, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Array:
        """The attitude changed by angles [rad]."""
        return self.attitude + np.array([roll, pitch, yaw])

    def relative(self, alpha: float = 0.0, beta: float = 0.0, speed: float = 0.0) -> Array:
        """The velocity in body axes with angle of attack, sideslip [rad] and speed [m/s] changed."""
        u, v, w = self.velocity
        a = np.arctan2(w, u) + alpha
        b = np.arcsin(v / self.speed) + beta
        size = self.speed + speed
        return size * np.array([np.cos(a) * np.cos(b), np.sin(b), np.sin(a) * np.cos(b)])

    @property
    def gravity(self) -> Array:
        """Downwards in body axes, unit length."""
        down: Array = rotation(*self.attitude).T @ np.array([0.0, 0.0, 1.0])
        return down
