"""One JSBSim aircraft in SI and east-north-up: the only import of jsbsim, the only place with feet.

What JSBSim lets pass in silence is an exception here; see `Fdm` for the order of calls it needs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import jsbsim
import numpy as np
from numpy.typing import NDArray

from aircraft.airframe import Airframe
from aircraft.autopilot import property_name
from aircraft.earth import M_PER_FT, Origin, enu_axes

Array = NDArray[np.float64]

# What the wrapper reads and writes in every airframe, by the name it has here.
_NODES = {
    "latitude_ic": "ic/lat-geod-rad",
    "longitude_ic": "ic/long-gc-rad",
    "altitude_ic": "ic/h-sl-ft",
    "ground_ic": "ic/terrain-elevation-ft",
    "roll_ic": "ic/phi-rad",
    "pitch_ic": "ic/theta-rad",
    "yaw_ic": "ic/psi-true-rad",
    "u_ic": "ic/u-fps",
    "v_ic": "ic/v-fps",
    "w_ic": "ic/w-fps",
    "x": "position/ecef-x-ft",
    "y": "position/ecef-y-ft",
    "z": "position/ecef-z-ft",
    "altitude": "position/geod-alt-ft",
    "above_ground": "position/h-agl-ft",
    "u": "velocities/ecef-x-fps",
    "v": "velocities/ecef-y-fps",
    "w": "velocities/ecef-z-fps",
    "climb": "velocities/h-dot-fps",
    "wind_east": "atmosphere/wind-east-fps",
    "wind_north": "atmosphere/wind-north-fps",
    "wind_down": "atmosphere/wind-down-fps",
    "udot": "accelerations/udot-ft_sec2",
    "wdot": "accelerations/wdot-ft_sec2",
    "qdot": "accelerations/qdot-rad_sec2",
    "elevator": "fcs/elevator-cmd-norm",
    "aileron": "fcs/aileron-cmd-norm",
    "throttle": "fcs/throttle-cmd-norm",
    "on": "ap/on",
    "v_command": "ap/v-cmd-mps",
    "omega_command": "ap/omega-cmd-radps",
    "zeta_command": "ap/zeta-cmd-mps",
    "omega": "ap/omega-radps",
    "elevator_wanted": "ap/elevator-norm",
    "throttle_wanted": "ap/throttle-wanted",
    "climb_integral": "ap/climb-integral-mps2",
    "speed_integral": "ap/speed-integral-mps2",
}

# Telemetry: name with unit -> property and the factor to SI.
TELEMETRY = {
    "roll_rad": ("attitude/phi-rad", 1.0),
    "pitch_rad": ("attitude/theta-rad", 1.0),
    "alpha_rad": ("aero/alpha-rad", 1.0),
    "beta_rad": ("aero/beta-rad", 1.0),
    "airspeed_mps": ("velocities/vt-fps", M_PER_FT),
    "load_factor": ("accelerations/Nz", 1.0),
    "throttle": ("fcs/throttle-pos-norm", 1.0),
    "elevator_rad": ("fcs/elevator-pos-rad", 1.0),
    "aileron_rad": ("fcs/aileron-pos-rad", 1.0),
    "limited_v": ("ap/limited-v", 1.0),
    "limited_omega": ("ap/limited-omega", 1.0),
    "limited_zeta": ("ap/limited-zeta", 1.0),
}


class FdmError(RuntimeError):
    """JSBSim could not load, start or fly an airframe."""


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


@dataclass(frozen=True)
class Start:
    """Where an aircraft begins: ENU position [m], course [rad], ground speed and climb rate [m/s], wind [m/s ENU]."""

    x: float
    y: float
    z: float
    theta: float
    v: float
    zeta: float = 0.0
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Fdm:
    """One aircraft with its autopilot, trimmed at `start` and flying from then on.

    JSBSim keeps the dt it was loaded with and cannot load twice or restore a state: a new run is a new Fdm.
    Nothing here sets position, attitude or rates after construction; `run` takes commands and wind.
    Raises  FdmError when the model is missing, malformed, lacks a property or cannot be trimmed at `start`.
    """

    def __init__(self, airframe: Airframe, dt: float, origin: Origin, start: Start) -> None:
        self.airframe = airframe
        self.origin = origin
        self._fdm = self._load(dt)
        self._nodes = {name: self.node(path) for name, path in _NODES.items()}
        self._telemetry = {name: (self.node(path), k) for name, (path, k) in TELEMETRY.items()}
        for name, value in airframe.gain_values().items():
            self.node(property_name(name)).set_double_value(value)
        self._start(start)
        n = self._nodes
        self._track = [n[k].get_double_value for k in ("x", "y", "z", "altitude")]
        self._theta = start.theta
        self._theta = self._unwrapped_course()

    # -- loading

    def _load(self, dt: float) -> jsbsim.FGFDMExec:
        """A JSBSim instance with this airframe's model, its aircraft, engine and systems all from the folder."""
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
            raise FdmError(f"{where}: {e} {' '.join(log.errors)}") from None
        if not loaded:
            raise FdmError(
                f"{where} or a file it names is missing: {' '.join(log.errors) or 'no more is known'}"
            )
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

    # -- starting

    def _place(self, start: Start) -> tuple[float, Array, Array]:
        """Write the start's place; returns the heading [rad, clockwise from north], the air-relative and the
        ground velocity [m/s, north-east-down at the aircraft]."""
        latitude, longitude, altitude = self.origin.geodetic(start.x, start.y, start.z)
        n = self._nodes
        n["ground_ic"].set_double_value(self.origin.ground_m / M_PER_FT)
        n["latitude_ic"].set_double_value(latitude)
        n["longitude_ic"].set_double_value(longitude)
        n["altitude_ic"].set_double_value(altitude / M_PER_FT)
        to_local = enu_axes(latitude, longitude) @ self.origin.axes.T
        ground = to_local @ np.array([start.v * math.cos(start.theta), start.v * math.sin(start.theta), 0.0])
        ground[2] = start.zeta
        air = ground - np.asarray(start.wind)
        ned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        return math.atan2(air[0], air[1]), ned @ air, ned @ ground

    def _initial(self, heading: float, pitch: float, velocity: Array) -> None:
        """Run JSBSim's initialisation, wings level, at a velocity [m/s, north-east-down over the ground]."""
        n = self._nodes
        sh, ch, sp, cp = math.sin(heading), math.cos(heading), math.sin(pitch), math.cos(pitch)
        body = np.array([[cp * ch, cp * sh, -sp], [-sh, ch, 0.0], [sp * ch, sp * sh, cp]]) @ velocity
        n["roll_ic"].set_double_value(0.0)
        n["pitch_ic"].set_double_value(pitch)
        n["yaw_ic"].set_double_value(heading)
        for name, value in zip(("u_ic", "v_ic", "w_ic"), body, strict=True):
            n[name].set_double_value(value / M_PER_FT)
        self._fdm.set_trim_status(True)  # actuators take their commands at once
        self._fdm.run_ic()
        self._fdm.set_trim_status(False)

    def _start(self, start: Start) -> None:
        """Trim in still air at the air-relative velocity, then start at the ground velocity in the wind."""
        n = self._nodes
        heading, air, ground = self._place(start)
        pitch = self._trim(heading, air, start)
        # JSBSim's initial altitude is not exactly geodetic: 1.6 mm low at 300 m.
        low = self.origin.altitude_m + start.z - n["altitude"].get_double_value() * M_PER_FT
        n["altitude_ic"].set_double_value(n["altitude_ic"].get_double_value() + low / M_PER_FT)
        self._initial(heading, pitch, ground)
        self._wind(start.wind)
        n["v_command"].set_double_value(start.v)
        n["omega_command"].set_double_value(0.0)
        n["zeta_command"].set_double_value(start.zeta)
        # run_ic knew no wind: evaluate everything again without moving until no history holds its forces.
        for _ in range(5):
            self._still()
        elevator, throttle = (n[k].get_double_value() for k in ("elevator", "throttle"))
        n["on"].set_double_value(1.0)
        self._settle("elevator_wanted", elevator, "climb_integral")
        self._settle("throttle_wanted", throttle, "speed_integral")
        self._still()

    def _trim(self, heading: float, air: Array, start: Start) -> float:
        """Find pitch, elevator and throttle for unaccelerated flight; leaves the commands set, returns pitch [rad]."""
        from scipy.optimize import root

        n = self._nodes
        speed = float(np.linalg.norm(air))
        climb = math.asin(-air[2] / speed) if speed > 0 else 0.0

        def residuals(unknown: Array) -> list[float]:
            alpha, elevator, throttle = unknown
            n["elevator"].set_double_value(elevator)
            n["throttle"].set_double_value(throttle)
            self._initial(heading, climb + alpha, air)
            return [n[k].get_double_value() for k in ("udot", "wdot", "qdot")]

        n["on"].set_double_value(0.0)
        n["aileron"].set_double_value(0.0)
        found = root(residuals, [0.05, 0.0, 0.4], tol=1e-13)
        alpha, elevator, throttle = found.x
        if max(map(abs, residuals(found.x))) > 1e-6 or not (abs(elevator) <= 1 and 0 <= throttle <= 1):
            raise FdmError(
                f"{self.airframe.name} cannot fly steadily at ground speed {start.v:g} m/s, climb {start.zeta:g} m/s "
                f"in wind {start.wind} m/s (airspeed {speed:.2f} m/s): alpha {math.degrees(alpha):.1f} deg, "
                f"elevator {elevator:.2f}, throttle {throttle:.2f}; start within its envelope"
            )
        return climb + float(alpha)

    def _still(self) -> None:
        """Evaluate all models without moving: suspended, JSBSim's dt is 0."""
        self._fdm.suspend_integration()
        self._fdm.run()
        self._fdm.resume_integration()

    def _settle(self, wanted: str, target: float, integral: str) -> None:
        """Choose an integrator's state so that the autopilot's output is `target` (secant; the map is monotone)."""
        n = self._nodes

        def miss(value: float) -> float:
            n[integral].set_double_value(value)
            self._still()
            return n[wanted].get_double_value() - target

        a, b = 0.0, 0.05
        miss_a, miss_b = miss(a), miss(b)
        for _ in range(8):
            if abs(miss_b) < 1e-12 or miss_b == miss_a:
                break
            a, miss_a, b = b, miss_b, b - miss_b * (b - a) / (miss_b - miss_a)
            miss_b = miss(b)

    # -- flying

    def command(self, v: float, omega: float, zeta: float) -> None:
        """Hand the autopilot ground speed [m/s], course rate [rad/s] and climb rate [m/s]; NaN is refused."""
        if not (math.isfinite(v) and math.isfinite(omega) and math.isfinite(zeta)):
            raise ValueError(f"command must be finite, got v {v}, omega {omega}, zeta {zeta}")
        n = self._nodes
        n["v_command"].set_double_value(v)
        n["omega_command"].set_double_value(omega)
        n["zeta_command"].set_double_value(zeta)

    def _wind(self, wind: tuple[float, float, float]) -> None:
        n = self._nodes
        n["wind_east"].set_double_value(wind[0] / M_PER_FT)
        n["wind_north"].set_double_value(wind[1] / M_PER_FT)
        n["wind_down"].set_double_value(-wind[2] / M_PER_FT)

    def run(self, wind: tuple[float, float, float], n: int) -> Array:
        """Fly n periods in `wind` [m/s, east, north, up]; returns the positions after each, (n, 3) m."""
        if not all(map(math.isfinite, wind)):
            raise ValueError(f"wind must be finite, got {wind}")
        self._wind(wind)
        step = self._fdm.run
        x, y, z, altitude = self._track
        rows = []
        for _ in range(n):
            step()
            rows.append((x(), y(), z(), altitude()))
        self._theta = self._unwrapped_course()
        return self.origin.enu(np.array(rows))

    def _velocity(self) -> Array:
        """East and north ground velocity in the origin's plane, and climb rate [m/s]."""
        n = self._nodes
        earth = np.array([n[k].get_double_value() for k in ("u", "v", "w")]) * M_PER_FT
        east, north, _ = self.origin.axes @ earth
        return np.array([east, north, n["climb"].get_double_value() * M_PER_FT])

    def _unwrapped_course(self) -> float:
        """The course, within half a turn of the last: it counts turns."""
        east, north, _ = self._velocity()
        course = math.atan2(north, east)
        return self._theta + math.remainder(course - self._theta, 2 * math.pi) if course == course else course

    def pose(self) -> tuple[float, float, float, float]:
        """x, y [m], course [rad], z [m]."""
        x, y, z = self.origin.enu(np.array([get() for get in self._track]))
        return float(x), float(y), self._theta, float(z)

    def rates(self) -> tuple[float, float, float]:
        """Ground speed [m/s], course rate [rad/s], climb rate [m/s]."""
        east, north, climb = self._velocity()
        return math.hypot(east, north), self._nodes["omega"].get_double_value(), float(climb)

    def height_above_ground(self) -> float:
        """Metres over the terrain."""
        return self._nodes["above_ground"].get_double_value() * M_PER_FT

    def telemetry(self) -> dict[str, float]:
        """The channels of `TELEMETRY`, SI."""
        return {name: node.get_double_value() * k for name, (node, k) in self._telemetry.items()}
