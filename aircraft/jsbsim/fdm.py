"""One JSBSim aircraft in SI and east-north-up: the only import of jsbsim, the only place with feet.

What JSBSim lets pass in silence is an exception here; `Fdm` keeps the order of calls it needs.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence

import jsbsim
import numpy as np
from numpy.typing import NDArray

from aircraft.airframe import Airframe
from aircraft.autopilots.equations import property_name
from aircraft.check.property_names import resolve
from aircraft.jsbsim import initialisation
from aircraft.jsbsim.geodesy import M_PER_FT, Origin, enu_axes, motions, positions
from aircraft.jsbsim.initialisation import FdmError, Start, Trim
from aircraft.jsbsim.properties import NODES, TELEMETRY

Array = NDArray[np.float64]

__all__ = ["M_PER_FT", "TELEMETRY", "Fdm", "FdmError", "Start", "Trim", "motions", "positions", "telemetry"]

_MILSPEC = 3.0  # JSBSim's number for that turbulence
_EULER = 1.0  # JSBSim's number for the rectangular Euler integrator


class _Quiet(jsbsim.FGLogger):
    """Drops JSBSim's banner and notes and keeps its errors for our own messages."""

    def __init__(self) -> None:
        super().__init__()
        self.errors: list[str] = []
        self._level = jsbsim.LogLevel.INFO

    def set_level(self, level: jsbsim.LogLevel) -> None:
        self._level = level

    def message(self, message: str) -> None:
        if self._level.value >= jsbsim.LogLevel.ERROR.value:
            self.errors.append(message.strip())

    def file_location(self, filename: str, line: int) -> None: ...

    def format(self, format: jsbsim.LogFormat) -> None: ...

    def flush(self) -> None: ...


def _keep_for_ever(fdm: jsbsim.FGFDMExec) -> None:
    """Never delete an instance whose model did not load: its destructor may abort the process."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(fdm))


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
        self._fdm = self._load(dt)
        manager = self._fdm.get_property_manager()
        try:
            resolve(airframe, lambda path: manager.get_node(path) is not None)
        except FdmError:
            _keep_for_ever(self._fdm)
            raise
        n = self.nodes = {name: self.node(path) for name, path in NODES.items()}
        surfaces = {name: (path, 1.0, 0.0) for name, path in airframe.surfaces.items()}
        telemetry = TELEMETRY | surfaces
        self.channels = tuple(telemetry)
        self._readings = tuple(self.node(path).get_double_value for path, _, _ in telemetry.values())
        self.units = np.array([[k, offset] for _, k, offset in telemetry.values()])
        for name, value in airframe.gain_values().items():
            self.node(property_name(name)).set_double_value(value)
        self._position = tuple(n[k].get_double_value for k in ("x", "y", "z", "altitude"))
        self._motion = tuple(n[k].get_double_value for k in ("u", "v", "w", "climb", "omega"))
        self._command = tuple(n[k].set_double_value for k in ("v_command", "omega_command", "zeta_command"))
        self._upset = n["alpha"].get_double_value, n["roll"].get_double_value
        self._wind: tuple[float, float, float] | None = None  # as last blown

    # -- loading

    def _load(self, dt: float) -> jsbsim.FGFDMExec:
        """A JSBSim instance with this airframe's model; engine and systems come from the folder too."""
        folder, model = self.airframe.folder, self.airframe.model
        log = _Quiet()
        jsbsim.set_logger(log)
        fdm = jsbsim.FGFDMExec(None)
        fdm.set_debug_level(0)
        fdm.set_dt(dt)
        where = folder / f"{model}.xml"
        try:
            loaded = fdm.load_model_with_paths(
                model, str(folder), str(folder / "engine"), str(folder / "systems"), False
            )
        except RuntimeError as e:
            _keep_for_ever(fdm)
            raise FdmError(f"{where}: {e} {' '.join(log.errors)}") from None
        if not loaded:
            _keep_for_ever(fdm)
            raise FdmError(f"{where} or a file that it names is missing: {' '.join(log.errors)}")
        return fdm

    def node(self, path: str) -> jsbsim.FGPropertyNode:
        """The property's node. Raises FdmError rather than create one that nothing reads."""
        found = self._fdm.get_property_manager().get_node(path)
        if found is None:
            raise FdmError(f"{self.airframe.folder / self.airframe.model}.xml has no property {path}")
        return found

    def read(self, path: str) -> float:
        """A property's value in JSBSim's own unit, for tests and tools; not for the flight loop."""
        return float(self.node(path).get_double_value())

    # -- starting; how is in `aircraft.jsbsim.initialisation`

    def trim(self, start: Start, omega: float = 0.0) -> Trim:
        """Steady flight as `initialisation.trim` finds it; raises FdmError if there is none."""
        return initialisation.trim(self, start, omega)

    def start(self, start: Start) -> Trim:
        """Begin the flight: trimmed, in the start's wind, the autopilot settled and on. Raises FdmError."""
        return initialisation.start(self, start)

    def place(self, start: Start, correct: bool = False) -> tuple[Array, Array]:
        """Write the start's place; returns air-relative and ground velocity [m/s], north-east-down.

        correct  take the error of the initialisation before this one off the height: JSBSim's initial
                 altitude is not exactly geodetic, 1.6 mm low at 300 m
        """
        latitude, longitude, altitude = self.origin.geodetic(start.x, start.y, start.z)
        n = self.nodes
        low = altitude / M_PER_FT - n["altitude"].get_double_value() if correct else 0.0
        n["ground_ic"].set_double_value(self.origin.ground_m / M_PER_FT)
        n["latitude_ic"].set_double_value(latitude)
        n["longitude_ic"].set_double_value(longitude)
        n["altitude_ic"].set_double_value(altitude / M_PER_FT + low)
        # Course and speed are in the origin's plane: find the level velocity here whose projection they are.
        to_origin = self.origin.axes[:2] @ enu_axes(latitude, longitude).T
        course = np.array([math.cos(start.theta), math.sin(start.theta)])
        east, north = np.linalg.solve(to_origin[:, :2], start.v * course - to_origin[:, 2] * start.zeta)
        ground = np.array([north, east, -start.zeta])
        wind_east, wind_north, wind_up = start.wind
        return ground - np.array([wind_north, wind_east, -wind_up]), ground

    def initialise(self, attitude: tuple[float, float, float], velocity: Array, yaw_rate: float) -> None:
        """Initialise at roll, pitch, yaw [rad], velocity over the ground [m/s, north-east-down] and the yaw
        rate of a steady turn [rad/s, clockwise]."""
        n = self.nodes
        (sr, sp, sy), (cr, cp, cy) = np.sin(attitude), np.cos(attitude)
        u, v, w = (
            np.array(
                [
                    [cp * cy, cp * sy, -sp],
                    [sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp],
                    [cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp],
                ]
            )
            @ velocity
            / M_PER_FT
        )
        rates = {"p_ic": -sp * yaw_rate, "q_ic": sr * cp * yaw_rate, "r_ic": cr * cp * yaw_rate}
        angles = dict(zip(("roll_ic", "pitch_ic", "yaw_ic"), attitude, strict=True))
        for name, value in (angles | {"u_ic": u, "v_ic": v, "w_ic": w} | rates).items():
            n[name].set_double_value(float(value))
        self._run_ic()

    def _run_ic(self) -> None:
        """Initialise, actuators taking their commands at once."""
        self._fdm.set_trim_status(True)
        try:
            self._fdm.run_ic()
        except RuntimeError as error:  # a property that a function needs does not exist, say
            raise self._broken(error) from None
        self._fdm.set_trim_status(False)

    def _broken(self, error: RuntimeError) -> FdmError:
        """What JSBSim says of a model that it cannot evaluate."""
        _keep_for_ever(self._fdm)
        said = " ".join(str(error).replace("\\n", " ").split())
        return FdmError(f"{self.airframe.folder / self.airframe.model}.xml: {said}")

    def evaluate(self) -> None:
        """Evaluate all models without moving (suspended, dt is 0); actuators take their commands at once."""
        self._fdm.set_trim_status(True)
        self._fdm.suspend_integration()
        self._fdm.run()
        self._fdm.resume_integration()
        self._fdm.set_trim_status(False)

    def forget_acceleration(self) -> None:
        """Let the first period of `run` integrate by Euler: it has no acceleration of a period before."""
        self._integrator = self.nodes["velocity_integrator"].get_double_value()
        self.nodes["velocity_integrator"].set_double_value(_EULER)

    def hold(
        self,
        velocity: Sequence[float] | Array,
        attitude: Sequence[float] | Array,
        rates: Sequence[float] | Array,
        commands: Mapping[str, float],
    ) -> Array:
        """Evaluate all models without moving, in still air, the autopilot off: for tools, not for flight.

        velocity  body axes, relative to the air [m/s];  attitude  roll, pitch, yaw [rad]
        rates     p, q, r [rad/s];  commands  property -> value, taken by the actuators at once
        Returns   the derivatives of velocity and rates along body axes, (6,) [m/s^2, rad/s^2]
        """
        n = self.nodes
        n["on"].set_double_value(0.0)
        for path, value in commands.items():
            self.node(path).set_double_value(value)
        values = [*attitude, *(x / M_PER_FT for x in velocity), *rates]
        names = ["roll_ic", "pitch_ic", "yaw_ic", "u_ic", "v_ic", "w_ic", "p_ic", "q_ic", "r_ic"]
        for name, value in zip(names, values, strict=True):
            n[name].set_double_value(float(value))
        self._run_ic()
        for _ in range(3):  # forces that depend on accelerations come back one evaluation later
            self.evaluate()
        read = [n[k].get_double_value() for k in ("udot", "vdot", "wdot", "pdot", "qdot", "rdot")]
        return np.array([*(M_PER_FT * x for x in read[:3]), *read[3:]])

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

    def turbulence(self, wind_at_20ft: float, severity: int, seed: int) -> None:
        """JSBSim's own gusts from now on, on top of any wind: MIL-F-8785C, of this aircraft alone.

        wind_at_20ft  m/s, which decides below 1000 ft above ground
        severity      JSBSim's index, which decides above 2000 ft: 3 light, 4 moderate, 6 severe
        seed          of this instance's random numbers
        """
        self.node("simulation/randomseed").set_double_value(seed)
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
        step = self._fdm.run
        x, y, z, altitude = self._position
        rows: list[float] = []
        try:
            if self._integrator and n:
                step()
                rows += x(), y(), z(), altitude()
                self.nodes["velocity_integrator"].set_double_value(self._integrator)
                self._integrator = 0.0
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
        return {name: float(x[0]) for name, x in telemetry(self.readings(), self).items()}


def telemetry(readings: Sequence[float], like: Fdm) -> dict[str, Array]:
    """`Fdm.telemetry` of N vehicles with the channels of one, (N,) each; `readings` one after another."""
    factor, offset = like.units.T
    rows = np.array(readings).reshape(-1, factor.size)
    now = dict(zip(like.channels, (rows * factor + offset).T.copy(), strict=True))
    heading = now["heading_rad"]
    heading -= 2 * np.pi * np.rint(heading / (2 * np.pi))
    return now
