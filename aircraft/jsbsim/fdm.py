"""One JSBSim aircraft in SI and east-north-up.

`Fdm` keeps the order of calls that JSBSim needs; loading is in `loading`, starting in `initialisation`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe, property_name
from aircraft.equations.catalogue import values_of
from aircraft.jsbsim import initialisation, loading, steady
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.geodesy import M_PER_FT, Origin
from aircraft.jsbsim.properties import ENGINE_STATES, INTEGRALS, NODES, TELEMETRY, setup_values
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.steady import Trim

Array = NDArray[np.float64]

_MILSPEC = 3.0  # JSBSim's number for that turbulence
_EULER = 1.0  # JSBSim's number for the rectangular Euler integrator


class Fdm:
    """One aircraft with its autopilot.

    JSBSim keeps the dt it was loaded with and cannot load twice or restore a state: a new run is a new Fdm.
    Call `start` once, then `command` and `run`; nothing sets position, attitude or rates after `start`.
    Raises  FdmError when the model is missing, malformed, lacks a property or cannot be trimmed.
    """

    def __init__(self, airframe: Airframe, dt: float, origin: Origin) -> None:
        self.airframe = airframe
        self.origin = origin
        self._integrator = 0.0  # the one to return to after the first period
        self.executive = loading.load(airframe, dt)  # JSBSim itself
        manager = self.executive.get_property_manager()
        n = self.nodes = {name: self.node(path) for name, path in NODES.items()}
        if all(manager.get_node(path) is not None for path in INTEGRALS.values()):
            n |= {name: self.node(path) for name, path in INTEGRALS.items()}  # the start settles it by them
        for name, path in airframe.surfaces.items():
            if manager.get_node(path) is None:
                toml = str(airframe.folder / "airframe.toml")
                raise FdmError(f"{toml}: surfaces.{name}: the model has no property {path}", toml)
        self.channels = Channels.of(airframe)
        self._readings = tuple(self.node(path).get_double_value for path in self.channels.paths)
        for name, value in values_of(airframe).items():
            self.node(property_name(name)).set_double_value(value)
        self._position = tuple(n[k].get_double_value for k in ("x", "y", "z", "altitude"))
        self._motion = tuple(n[k].get_double_value for k in ("u", "v", "w", "climb", "omega"))
        self._command = tuple(n[k].set_double_value for k in ("v_command", "omega_command", "zeta_command"))
        self._upset = n["alpha"].get_double_value, n["roll"].get_double_value
        self._wind: tuple[float, float, float] | None = None  # as last blown
        manager = self.executive.get_property_manager()
        for path, value in setup_values(airframe.setup).items():
            self.node(path).set_double_value(value)
        numbers = ["", *(f"[{k}]" for k in range(1, airframe.engines.count))]
        engines = [f"propulsion/engine{number}" for number in numbers]
        kept = (manager.get_node(f"{engine}/{name}") for engine in engines for name in ENGINE_STATES)
        self.engine_states = [node for node in kept if node is not None]
        self.forgets: bool | None = None  # whether engines lose their state at dt = 0; unknown yet
        self.spools: list[tuple[loading.Node, float]] = []  # states to write after the first period

    def node(self, path: str) -> loading.Node:
        """The property's node. Raises FdmError rather than create one that nothing reads."""
        found = self.executive.get_property_manager().get_node(path)
        if found is None:
            raise FdmError(f"{self.airframe.folder / self.airframe.model}.xml has no property {path}")
        return found

    def read(self, path: str) -> float:
        """A property's value in JSBSim's own unit, for tests and tools; not for the flight loop."""
        return float(self.node(path).get_double_value())

    # -- before the flight

    def trim(self, start: Start, omega: float = 0.0, near: Trim | None = None) -> Trim:
        """Steady flight as `steady.trim` finds it; raises FdmError if there is none."""
        return steady.trim(self, start, omega, near)

    def start(self, start: Start, near: Trim | None = None) -> Trim:
        """Begin the flight: trimmed, in the start's wind, the autopilot settled and on. Raises FdmError."""
        return initialisation.start(self, start, near)

    def run_ic(self) -> None:
        """Initialise, actuators taking their commands at once."""
        self.executive.set_trim_status(True)
        try:
            self.executive.run_ic()
        except RuntimeError as error:  # a property that a function needs does not exist, say
            raise self._broken(error) from None
        self.executive.set_trim_status(False)

    def _broken(self, error: RuntimeError) -> FdmError:
        """What JSBSim says of a model that it cannot evaluate."""
        loading.keep_for_ever(self.executive)
        said = " ".join(str(error).replace("\\n", " ").split())
        return FdmError(f"{self.airframe.folder / self.airframe.model}.xml: {said}")

    def evaluate(self) -> None:
        """Evaluate all models without moving (suspended, dt is 0); actuators take their commands at once."""
        self.executive.set_trim_status(True)
        self.executive.suspend_integration()
        self.executive.run()
        self.executive.resume_integration()
        self.executive.set_trim_status(False)

    def forget_acceleration(self) -> None:
        """Let the first period of `run` integrate by Euler: it has no acceleration of a period before."""
        self._integrator = self.nodes["velocity_integrator"].get_double_value()
        self.nodes["velocity_integrator"].set_double_value(_EULER)

    # -- flying

    def command(self, v: float, omega: float, zeta: float) -> None:
        """Hand the autopilot ground speed [m/s], course rate [rad/s] and climb rate [m/s]; NaN is refused."""
        if not (math.isfinite(v) and math.isfinite(omega) and math.isfinite(zeta)):
            raise ValueError(f"command must be finite, got v {v}, omega {omega}, zeta {zeta}")
        set_v, set_omega, set_zeta = self._command
        set_v(v)
        set_omega(omega)
        set_zeta(zeta)

    def blow(self, wind: tuple[float, float, float]) -> None:
        """Set the wind [m/s, east, north, up]."""
        n = self.nodes
        n["wind_east"].set_double_value(wind[0] / M_PER_FT)
        n["wind_north"].set_double_value(wind[1] / M_PER_FT)
        n["wind_down"].set_double_value(-wind[2] / M_PER_FT)
        self._wind = wind

    def seed(self, seed: int) -> None:
        """Start the random numbers of this instance, of its sensors and its turbulence, from a seed."""
        self.node("simulation/randomseed").set_double_value(seed)

    def turbulence(self, wind_at_20ft: float, severity: int, seed: int) -> None:
        """JSBSim's own gusts from now on, on top of any wind: MIL-F-8785C, of this aircraft alone.

        wind_at_20ft  m/s, which decides below 1000 ft above ground
        severity      JSBSim's index, which decides above 2000 ft: 3 light, 4 moderate, 6 severe
        seed          of this instance's random numbers
        """
        self.seed(seed)
        milspec = "atmosphere/turbulence/milspec/"
        self.node(milspec + "windspeed_at_20ft_AGL-fps").set_double_value(wind_at_20ft / M_PER_FT)
        self.node(milspec + "severity").set_double_value(severity)
        self.node("atmosphere/turb-type").set_double_value(_MILSPEC)

    def run(self, wind: tuple[float, float, float], n: int) -> list[float]:
        """Fly n periods in `wind` [m/s, east, north, up]; returns a row for `positions` after each.

        The rows are one list of numbers: of lists or tuples Python would search for garbage every few steps.
        """
        if wind != self._wind:
            if not all(map(math.isfinite, wind)):
                raise ValueError(f"wind must be finite, got {wind}")
            self.blow(wind)
        step = self.executive.run
        x, y, z, altitude = self._position
        rows: list[float] = []
        try:
            if self._integrator and n:
                step()
                rows += x(), y(), z(), altitude()
                self.nodes["velocity_integrator"].set_double_value(self._integrator)
                self._integrator = 0.0
                for node, value in self.spools:
                    node.set_double_value(value)
                n -= 1
            for _ in range(n):
                step()
                rows += x(), y(), z(), altitude()
        except RuntimeError as error:
            raise self._broken(error) from None
        return rows

    def position(self) -> tuple[float, ...]:
        """A row for `positions`: where the aircraft is."""
        return tuple(get() for get in self._position)

    def motion(self) -> tuple[float, ...]:
        """A row for `motions`: how the aircraft moves."""
        u, v, w, climb, omega = self._motion
        return u(), v(), w(), climb(), omega()

    def upset(self) -> tuple[float, float]:
        """Angle of attack and bank [rad]."""
        alpha, roll = self._upset
        return alpha(), roll()

    def readings(self) -> list[float]:
        """The channels in JSBSim's units: a row for `telemetry`."""
        return [get() for get in self._readings]

    def telemetry(self) -> dict[str, float]:
        """The channels of `TELEMETRY` and the airframe's surfaces, SI."""
        return {name: float(x[0]) for name, x in telemetry(self.readings(), self.channels).items()}


@dataclass(frozen=True, eq=False)
class Channels:
    """The channels of an airframe's telemetry.

    names, paths    of each channel, and its property
    factor, offset  (C,) what makes it SI
    """

    names: tuple[str, ...]
    paths: tuple[str, ...]
    factor: Array
    offset: Array

    @classmethod
    def of(cls, airframe: Airframe) -> Channels:
        """Those of `TELEMETRY`, and the airframe's surfaces."""
        told = TELEMETRY | {name: (path, 1.0, 0.0) for name, path in airframe.surfaces.items()}
        paths, factor, offset = zip(*told.values(), strict=True)
        return cls(tuple(told), paths, np.array(factor), np.array(offset))


def telemetry(readings: Sequence[float] | Array, channels: Channels) -> dict[str, Array]:
    """`Fdm.telemetry` of N vehicles with these channels, (N,) each; `readings` one vehicle after another."""
    rows = np.array(readings).reshape(-1, channels.factor.size)
    now = dict(zip(channels.names, (rows * channels.factor + channels.offset).T.copy(), strict=True))
    heading = now["heading_rad"]
    heading -= 2 * np.pi * np.rint(heading / (2 * np.pi))
    return now
