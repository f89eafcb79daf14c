"""JsbsimFleet: N JSBSim aircraft, each its own airframe, behind the Plant seam."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.airframes.sensors import sensors_of
from aircraft.jsbsim.fdm import Channels, Fdm, telemetry
from aircraft.jsbsim.geodesy import Origin, positions
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.stepping.group import NOT_FINITE, Group
from aircraft.jsbsim.stepping.shares import Shares
from filters.model import Array, Command, State


class JsbsimFleet:
    """N aircraft about one shared origin, started trimmed; a Plant (see `aircraft.plant`).

    airframes    one per vehicle
    dt           FDM and autopilot period [s]
    origin       where x = y = z = 0 is
    turbulence   JSBSim's own: wind at 20 ft [m/s] and severity, as in `Fdm.turbulence`; None flies without
    workers      processes that load, trim and step the aircraft, this one among them: the same numbers, to
                 the last bit, for any
    A vehicle that meets a fault stays where it was last well, and the others fly on.
    """

    def __init__(
        self,
        airframes: Sequence[Airframe],
        dt: float = 0.005,
        origin: Origin | None = None,
        turbulence: tuple[float, int] | None = None,
        workers: int = 1,
    ) -> None:
        if not airframes:
            raise ValueError("a fleet needs at least one airframe")
        if not dt > 0:
            raise ValueError(f"the FDM period must be positive, got {dt} s")
        if workers < 1:
            raise ValueError(f"a fleet needs at least one worker, got {workers}")
        self.airframes = list(airframes)
        self.dt = dt
        self.origin = origin or Origin()
        self.workers = min(workers, len(self.airframes))
        self._turbulence = turbulence
        kinds = {id(airframe): Channels.of(airframe) for airframe in self.airframes}
        self._channels = [kinds[id(airframe)] for airframe in self.airframes]
        self._alike = len({channels.names for channels in kinds.values()}) == 1
        self._group = Group([], dt, self.origin, turbulence)  # this process's own, once there is a flight
        self._others: Shares | None = None  # those of worker processes

    @property
    def vehicles(self) -> list[Fdm]:
        """The aircraft that this process steps; empty until `reset`."""
        return self._group.vehicles

    @property
    def pids(self) -> list[int]:
        """Of the worker processes beside this one."""
        return [] if self._others is None else self._others.pids

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
        Raises  RuntimeError if there is no steady flight at that speed in that wind, or no worker starts.
        """
        if len(state) != len(self.airframes):
            raise ValueError(f"{len(self.airframes)} airframes cannot start at {len(state)} poses")
        if not np.all(state.isfinite()):
            raise ValueError(f"the start must be finite, got {state}")
        n = len(state)
        speeds = np.broadcast_to(np.asarray(speed, dtype=float), (n,)).tolist()
        winds = np.broadcast_to(np.asarray(wind, dtype=float), (n, 3)).tolist()
        poses = zip(*state.array().T.tolist(), strict=True)
        starts = [
            Start(x, y, z, theta, v, wind=tuple(air))
            for (x, y, theta, z), v, air in zip(poses, speeds, winds, strict=True)
        ]
        seeds = [
            int(rng.integers(1, 2**31)) if self._turbulence or sensors_of(a.sensors).noisy else None
            for a in self.airframes
        ]
        self.close()
        self._faults = [""] * n
        self._winds: list[list[float]] = []
        # Readings for the telemetry, if taken already; whether telemetry was asked for at this instant.
        self._readings: list[float] | Array = []
        self._telling = False
        own, flying = -(-n // self.workers), (self.dt, self.origin, self._turbulence)
        try:
            if self.workers > 1:
                counts = [len(channels.names) for channels in self._channels]
                told = self.airframes, starts, seeds, counts
                self._others = Shares(own, self.workers - 1, *told, *flying)
            self._group = Group(self.airframes[:own], *flying)
            self._group.start(starts[:own], seeds[:own])
            rows: list[float] | Array = self._group.position()
            if self._others is not None:
                self._others.wait()
                rows = self._others.beside(rows, 1, [True] * n)
        except BaseException:
            self.close()
            raise
        self._take(positions(rows, self.origin))

    def step(self, command: Command, wind: Array, n: int) -> Array:
        """Fly `command` (N,) for n periods in `wind` (N, 3); returns positions (n, N, 3). NaN is refused."""
        asked, winds = self._asked(command, wind)
        flying = [not fault for fault in self._faults]
        # Telemetry asked for last time is mostly asked for again.
        readings: list[float] | None = [] if self._telling and self._alike else None
        self._readings, self._telling = [], False
        if self._others is None:
            rows: list[float] | Array = self._group.step(asked, winds, n, readings)
            self._faults, self._readings = list(self._group.faults), readings or []
        else:
            self._others.step(asked, np.array(winds), n, readings is not None)
            rows = self._group.step(asked, winds, n, readings)
            self._others.wait()
            rows = self._others.beside(rows, n, flying)
            self._faults = self._group.faults + self._others.faults()
            if readings:
                self._readings = self._others.readings_beside(readings)
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
        n = len(self._faults)
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

    def _take(self, position: Array) -> None:
        """Be at `position` (N, 3) m, with the courses and rates that the vehicles have."""
        self._position = position
        now = np.array(self._group.moves)
        if self._others is not None:
            now = np.concatenate([now, self._others.moves()])
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
        if not len(self._readings):
            self._readings = self._group.readings()
            if self._others is not None:
                self._others.read()
                self._readings = self._others.readings_beside(self._readings)
        if self._alike:
            return telemetry(self._readings, self._channels[0])
        rows, start = [], 0
        for channels in self._channels:
            end = start + len(channels.names)
            rows.append(telemetry(self._readings[start:end], channels))
            start = end
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: np.array([row[name][0] if name in row else np.nan for row in rows]) for name in names}

    def faults(self) -> list[str]:
        """Per vehicle "", "state not finite", "hit the ground", "stalled" (alpha) or "upset" (bank)."""
        return list(self._faults)

    def close(self) -> None:
        """Release the aircraft, and end the worker processes."""
        self._group = Group([], self.dt, self.origin, self._turbulence)
        if self._others is not None:
            self._others.close()
            self._others = None

    def __len__(self) -> int:
        return len(self.airframes)
