"""JsbsimFleet: N JSBSim aircraft, each its own airframe, behind the Plant seam."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.airframes.sensors import sensors_of
from aircraft.jsbsim.fdm import Fdm, telemetry
from aircraft.jsbsim.geodesy import M_PER_FT, Origin, motion, positions
from aircraft.jsbsim.rest import Start
from filters.model import Array, Command, State

NOT_FINITE = "state not finite"
_GROUND_CONTACT_M = 0.3  # below this the belly skids touch
# Loss of control. The autopilot keeps alpha below alpha_max; at twice that both our wings are past the stall
# (X8 0.40 of 0.27 rad, Rascal 0.34 of 0.23). A gust's moment of it is no stall, and no command banks so far.
_STALL_SHARE, _STALL_S, _UPSET_RAD = 2.0, 0.1, math.radians(100.0)


class JsbsimFleet:
    """N aircraft about one shared origin, started trimmed; a Plant (see `aircraft.plant`).

    airframes    one per vehicle
    dt           FDM and autopilot period [s]
    origin       where x = y = z = 0 is
    turbulence   JSBSim's own: wind at 20 ft [m/s] and severity, as in `Fdm.turbulence`; None flies without
    A vehicle that meets a fault stays where it was last well, and the others fly on.
    """

    def __init__(
        self,
        airframes: Sequence[Airframe],
        dt: float = 0.005,
        origin: Origin | None = None,
        turbulence: tuple[float, int] | None = None,
    ) -> None:
        if not airframes:
            raise ValueError("a fleet needs at least one airframe")
        if not dt > 0:
            raise ValueError(f"the FDM period must be positive, got {dt} s")
        self.airframes = list(airframes)
        self.dt = dt
        self.origin = origin or Origin()
        self._turbulence = turbulence
        self.vehicles: list[Fdm] = []  # empty until reset

    def reset(
        self,
        state: State,
        rng: np.random.Generator,
        wind: Array | Sequence[float] = (0.0, 0.0, 0.0),
        speed: Array | float = 20.0,
    ) -> None:
        """Fresh aircraft at `state` (N,), trimmed; `rng` seeds JSBSim's turbulence.

        wind   m/s, (3,) or (N, 3): what the trim, and so the crab angle, is for
        speed  ground speed [m/s], one or (N,)
        Raises  RuntimeError if there is no steady flight at that speed in that wind.
        """
        if len(state) != len(self.airframes):
            raise ValueError(f"{len(self.airframes)} airframes cannot start at {len(state)} poses")
        if not np.all(state.isfinite()):
            raise ValueError(f"the start must be finite, got {state}")
        n = len(state)
        speeds = np.broadcast_to(np.asarray(speed, dtype=float), (n,))
        winds = np.broadcast_to(np.asarray(wind, dtype=float), (n, 3))
        self.vehicles = [Fdm(airframe, self.dt, self.origin) for airframe in self.airframes]
        for vehicle, x, y, theta, z, v, air in zip(
            self.vehicles,
            *state.array().T.tolist(),
            speeds.tolist(),
            winds.tolist(),
            strict=True,
        ):
            vehicle.start(Start(x, y, z, theta, v, wind=tuple(air)))
            if self._turbulence:
                vehicle.turbulence(*self._turbulence, seed=int(rng.integers(1, 2**31)))
            elif sensors_of(vehicle.airframe.sensors).noisy:
                vehicle.seed(int(rng.integers(1, 2**31)))
        self._faults = [""] * n
        self._alike = len({f.channels for f in self.vehicles}) == 1  # the same channels
        most = [a.gain_values().get("envelope_alpha_max_rad", math.inf) for a in self.airframes]
        self._stall, self._stalled_s = [_STALL_SHARE * alpha for alpha in most], [0.0] * n
        self._axes = self.origin.axes.tolist()
        # course [rad], ground speed [m/s], course rate [rad/s] and climb rate [m/s] of each
        self._moves = [(theta, 0.0, 0.0, 0.0) for theta in state.theta.tolist()]
        self._winds: list[list[float]] = []
        # Readings for the telemetry, if taken already; whether telemetry was asked for at this instant.
        self._readings: list[float] = []
        self._telling = False
        for i in range(n):
            self._moves[i] = self._motion(i)
        self._take(positions([x for f in self.vehicles for x in f.position()], self.origin))

    def step(self, command: Command, wind: Array, n: int) -> Array:
        """Fly `command` (N,) for n periods in `wind` (N, 3); returns positions (n, N, 3). NaN is refused."""
        asked, winds = self._asked(command, wind)
        flying = [not fault for fault in self._faults]
        rows: list[float] = []
        # Telemetry asked for last time is mostly asked for again: reading it now takes a third of what it
        # takes later, when the aircraft has left the processor's cache.
        telling, self._readings, self._telling = self._telling and self._alike, [], False
        for i, vehicle in enumerate(self.vehicles):
            if flying[i]:
                vehicle.command(*asked[i])
                east, north, up = winds[i]
                flown = vehicle.run((east, north, up), n)
                rows += flown
                self._arrive(i, flown, n * self.dt)
            if telling:
                self._readings += vehicle.readings()
        track = positions(rows, self.origin).reshape(-1, n, 3).swapaxes(0, 1)
        if not all(flying):
            moved, track = track, np.tile(self._position, (n, 1, 1))
            track[:, flying] = moved
        for i, fault in enumerate(self._faults):
            if flying[i] and fault == NOT_FINITE:
                known = np.isfinite(track[:, i]).all(axis=1)
                track[~known, i] = track[known, i][-1] if known.any() else self._position[i]
        self._take(track[-1].copy())
        return track

    def _asked(
        self, command: Command, wind: Array
    ) -> tuple[list[tuple[float, float, float]], list[list[float]]]:
        """Commands and winds as plain numbers, one a vehicle; raises ValueError if one is not finite."""
        n = len(self.vehicles)
        if command.shape != (n,):
            command = Command.of(np.broadcast_to(command.array(), (n, 3)))
        if getattr(wind, "shape", ()) != (n, 3):
            wind = np.broadcast_to(wind, (n, 3))
        asked = list(zip(command.v.tolist(), command.omega.tolist(), command.zeta.tolist(), strict=True))
        winds = wind.tolist()
        fine = math.isfinite(sum(map(sum, asked)))
        if winds != self._winds:
            fine = fine and math.isfinite(sum(map(sum, winds)))
        if not fine:
            raise ValueError(f"command and wind must be finite, got {command} in {wind}")
        self._winds = winds
        return asked, winds

    def _arrive(self, i: int, flown: list[float], period: float) -> None:
        """Take in where vehicle i has flown in `period` [s], how it moves, and whether it met a fault.

        A vehicle that has met a fault keeps the course it had and is at rest.
        flown  rows of `Fdm.run`
        """
        moves = self._motion(i)
        if math.isfinite(sum(flown) + sum(moves)):
            fault = self._lost(i, flown[-1] * M_PER_FT - self.origin.ground_m, period)
        else:
            fault = NOT_FINITE
        if fault:
            self._faults[i], moves = fault, (self._moves[i][0], 0.0, 0.0, 0.0)
        self._moves[i] = moves

    def _lost(self, i: int, height: float, period: float) -> str:
        """The fault that vehicle i met, `height` [m] above ground, over `period` [s]; "" for none."""
        if height < _GROUND_CONTACT_M:
            return "hit the ground"
        alpha, roll = self.vehicles[i].upset()
        if abs(roll) > _UPSET_RAD:
            return "upset"
        self._stalled_s[i] = self._stalled_s[i] + period if alpha > self._stall[i] else 0.0
        return "stalled" if self._stalled_s[i] > _STALL_S else ""

    def _motion(self, i: int) -> tuple[float, float, float, float]:
        """Course of vehicle i, counting turns, and its rates."""
        course, v, omega, zeta = motion(self.vehicles[i].motion(), self._axes)
        before = self._moves[i][0]
        turned = course - before
        if math.isfinite(turned):
            course = before + (turned - 2 * math.pi * round(turned / (2 * math.pi)))
        return course, v, omega, zeta

    def _take(self, position: Array) -> None:
        """Be at `position` (N, 3) m, with the courses and rates that the vehicles have."""
        self._position = position
        now = np.array(self._moves)
        position.flags.writeable = now.flags.writeable = False  # handed out more than once
        self._state = State(position[:, 0], position[:, 1], now[:, 0], position[:, 2])
        self._achieved = Command.of(now[:, 1:])

    def state(self) -> State:
        """Poses (N,): course and east-north-up position, the truth."""
        return self._state

    def achieved(self) -> Command:
        """Ground speed, course rate and climb rate (N,); the course rate as the autopilot measures it.

        That is the true rate through a first-order low-pass of gain turn.filter_s, 20 ms on our airframes:
        what an instrument on board gives, and what the identified lags are of. Steps of an autopilot are
        scored on the true rate (`aircraft.autopilots.tuning.Flight.omega`).
        """
        return self._achieved

    def telemetry(self) -> dict[str, Array]:
        """The channels of `properties.TELEMETRY` and all surfaces, (N,); NaN where there is none."""
        self._telling = True
        if self._alike:
            self._readings = self._readings or [x for f in self.vehicles for x in f.readings()]
            return telemetry(self._readings, self.vehicles[0])
        rows = [f.telemetry() for f in self.vehicles]
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}

    def faults(self) -> list[str]:
        """Per vehicle "", "state not finite", "hit the ground", "stalled" (alpha) or "upset" (bank)."""
        return list(self._faults)

    def close(self) -> None:
        """Release the aircraft."""
        self.vehicles = []

    def __len__(self) -> int:
        return len(self.airframes)
