"""JsbsimFleet: N JSBSim aircraft, each its own airframe, behind the Plant seam."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aircraft.airframe import Airframe
from aircraft.earth import Origin
from aircraft.fdm import TELEMETRY, Fdm, Start
from filters.unicycle import Array, Command, State

_GROUND_CONTACT_M = 0.3  # below this the belly skids touch


class JsbsimFleet:
    """N aircraft about one shared origin, started trimmed; a Plant (see `aircraft.plant`).

    airframes    one per vehicle
    dt           FDM and autopilot period [s]
    start_speed  ground speed at t = 0 [m/s], one or (N,)
    start_wind   wind at t = 0 [m/s], (3,) or (N, 3): what the trim, and so the crab angle, is for
    origin       where x = y = z = 0 is
    A vehicle that meets a fault stays where it was last well, and the others fly on.
    """

    def __init__(
        self,
        airframes: Sequence[Airframe],
        dt: float = 0.005,
        start_speed: float | Array = 20.0,
        start_wind: Array | Sequence[float] = (0.0, 0.0, 0.0),
        origin: Origin | None = None,
    ) -> None:
        if not airframes:
            raise ValueError("a fleet needs at least one airframe")
        if not dt > 0:
            raise ValueError(f"the FDM period must be positive, got {dt} s")
        n = len(airframes)
        self.airframes = list(airframes)
        self.dt = dt
        self.origin = origin or Origin()
        self._start_speed = np.broadcast_to(np.asarray(start_speed, dtype=float), (n,))
        self._start_wind = np.broadcast_to(np.asarray(start_wind, dtype=float), (n, 3))
        self._vehicles: list[Fdm] = []

    def reset(self, state: State, rng: np.random.Generator) -> None:
        """Fresh aircraft at `state` (N,), trimmed at the start speed in the start wind. `rng` is not used."""
        if len(state) != len(self.airframes):
            raise ValueError(f"{len(self.airframes)} airframes cannot start at {len(state)} poses")
        if not np.all(state.isfinite()):
            raise ValueError(f"the start must be finite, got {state}")
        self._vehicles = [
            Fdm(
                airframe,
                self.dt,
                self.origin,
                Start(*(float(c) for c in pose[[0, 1, 3, 2]]), v=float(v), wind=tuple(map(float, wind))),
            )
            for airframe, pose, v, wind in zip(
                self.airframes, state.array(), self._start_speed, self._start_wind, strict=True
            )
        ]
        self._faults = [""] * len(state)
        self._pose = np.array([f.pose() for f in self._vehicles])
        self._rates = np.array([f.rates() for f in self._vehicles])

    def step(self, command: Command, wind: Array, n: int) -> Array:
        """Fly `command` (N,) for n periods in `wind` (N, 3); positions (n, N, 3) after each. NaN is refused."""
        wind = np.broadcast_to(np.asarray(wind, dtype=float), (len(self), 3))
        if not (np.all(command.isfinite()) and np.all(np.isfinite(wind))):
            raise ValueError(f"command and wind must be finite, got {command} in {wind}")
        track = np.empty((n, len(self), 3))
        commands = np.broadcast_to(command.array(), (len(self), 3)).tolist()
        for i, vehicle in enumerate(self._vehicles):
            if self._faults[i]:
                track[:, i] = self._pose[i, [0, 1, 3]]
                continue
            vehicle.command(*commands[i])
            track[:, i] = vehicle.run(tuple(wind[i].tolist()), n)
            self._note(i, vehicle, track[:, i])
        return track

    def _note(self, i: int, vehicle: Fdm, track: Array) -> None:
        """Take the vehicle's new pose and rates, or its fault and the last finite ones."""
        pose, rates = vehicle.pose(), vehicle.rates()
        if not np.all(np.isfinite([*pose, *rates])):
            self._faults[i] = "not finite"
            ends = ~np.all(np.isfinite(track), axis=1)
            track[ends] = self._pose[i, [0, 1, 3]] if ends.all() else track[~ends][-1]
            self._pose[i, [0, 1, 3]] = track[-1]
            self._rates[i] = 0.0
            return
        self._pose[i], self._rates[i] = pose, rates
        if vehicle.height_above_ground() < _GROUND_CONTACT_M:
            self._faults[i] = "ground"
            self._rates[i] = 0.0

    def state(self) -> State:
        """Poses (N,): course and east-north-up position, the truth."""
        return State.of(self._pose.copy())

    def achieved(self) -> Command:
        """Ground speed, course rate and climb rate (N,)."""
        return Command.of(self._rates.copy())

    def telemetry(self) -> dict[str, Array]:
        """The channels of `aircraft.fdm.TELEMETRY`, name -> (N,)."""
        rows = [f.telemetry() for f in self._vehicles]
        return {name: np.array([row[name] for row in rows]) for name in TELEMETRY}

    def faults(self) -> list[str]:
        """Per vehicle "" or "not finite" or "ground"."""
        return list(self._faults)

    def __len__(self) -> int:
        return len(self.airframes)
