"""JsbsimFleet: N JSBSim aircraft, each its own airframe, behind the Plant seam."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aircraft.airframe import Airframe
from aircraft.earth import Origin
from aircraft.fdm import Fdm, Start, motions, positions
from filters.unicycle import Array, Command, State

_GROUND_CONTACT_M = 0.3  # below this the belly skids touch
# Loss of control. The autopilot keeps alpha below alpha_max; at twice that both our wings are past the stall
# (X8 0.40 of 0.27 rad, Rascal 0.34 of 0.23). A gust's moment of it is no stall, and no command banks so far.
_STALL_SHARE, _STALL_S, _UPSET_RAD = 2.0, 0.1, math.radians(100.0)


class JsbsimFleet:
    """N aircraft about one shared origin, started trimmed; a Plant (see `aircraft.plant`).

    airframes    one per vehicle
    dt           FDM and autopilot period [s]
    start_speed  ground speed at t = 0 [m/s], one or (N,)
    start_wind   wind at t = 0 [m/s], (3,) or (N, 3): what the trim, and so the crab angle, is for
    origin       where x = y = z = 0 is
    turbulence   JSBSim's own: wind at 20 ft [m/s] and severity, as in `Fdm.turbulence`; None flies without
    A vehicle that meets a fault stays where it was last well, and the others fly on.
    """

    def __init__(
        self,
        airframes: Sequence[Airframe],
        dt: float = 0.005,
        start_speed: float | Array = 20.0,
        start_wind: Array | Sequence[float] = (0.0, 0.0, 0.0),
        origin: Origin | None = None,
        turbulence: tuple[float, int] | None = None,
    ) -> None:
        if not airframes:
            raise ValueError("a fleet needs at least one airframe")
        if not dt > 0:
            raise ValueError(f"the FDM period must be positive, got {dt} s")
        n = len(airframes)
        self.airframes = list(airframes)
        self.dt = dt
        self.origin = origin or Origin()
        self._turbulence = turbulence
        self._start_speed = np.broadcast_to(np.asarray(start_speed, dtype=float), (n,))
        self._start_wind = np.broadcast_to(np.asarray(start_wind, dtype=float), (n, 3))
        self._vehicles: list[Fdm] = []

    def reset(self, state: State, rng: np.random.Generator) -> None:
        """Fresh aircraft at `state` (N,), trimmed at the start speed in its wind; `rng` seeds turbulence."""
        if len(state) != len(self.airframes):
            raise ValueError(f"{len(self.airframes)} airframes cannot start at {len(state)} poses")
        if not np.all(state.isfinite()):
            raise ValueError(f"the start must be finite, got {state}")
        self._vehicles = [Fdm(airframe, self.dt, self.origin) for airframe in self.airframes]
        for vehicle, x, y, theta, z, v, wind in zip(
            self._vehicles,
            *state.array().T.tolist(),
            self._start_speed.tolist(),
            self._start_wind.tolist(),
            strict=True,
        ):
            vehicle.start(Start(x, y, z, theta, v, wind=tuple(wind)))
            if self._turbulence:
                vehicle.turbulence(*self._turbulence, seed=int(rng.integers(1, 2**31)))
        self._faults = [""] * len(state)
        self._alike = len({tuple(f.telemetry()) for f in self._vehicles}) == 1  # the same channels
        most = [a.gain_values().get("envelope_alpha_max_rad", math.inf) for a in self.airframes]
        self._stall, self._stalled_s = [_STALL_SHARE * alpha for alpha in most], [0.0] * len(state)
        self._position = positions([f.position() for f in self._vehicles], self.origin)
        self._theta = state.theta.astype(float).copy()
        self._rates = np.zeros((len(state), 3))
        self._move([True] * len(state))

    def step(self, command: Command, wind: Array, n: int) -> Array:
        """Fly `command` (N,) for n periods in `wind` (N, 3); returns positions (n, N, 3). NaN is refused."""
        wind, asked = np.asarray(wind, dtype=float), command.array()
        if not (np.isfinite(asked).all() and np.isfinite(wind).all()):
            raise ValueError(f"command and wind must be finite, got {command} in {wind}")
        if wind.shape != self._position.shape:
            wind = np.broadcast_to(wind, self._position.shape)
        if asked.shape != self._position.shape:
            asked = np.broadcast_to(asked, self._position.shape)
        flying = [not fault for fault in self._faults]
        rows = []
        for vehicle, well, c, w in zip(self._vehicles, flying, asked.tolist(), wind.tolist(), strict=True):
            if well:
                vehicle.command(*c)
                rows.append(vehicle.run((w[0], w[1], w[2]), n))
        if all(flying):
            track = np.ascontiguousarray(positions(rows, self.origin).swapaxes(0, 1))
        else:
            track = np.tile(self._position, (n, 1, 1))
            if rows:
                track[:, flying] = positions(rows, self.origin).swapaxes(0, 1)
        self._end_flights(track, flying)
        self._position = track[-1].copy()
        return track

    def _end_flights(self, track: Array, flying: list[bool]) -> None:
        """Note new faults; a vehicle that has one stays at its last finite position, `track` says so too."""
        self._move(flying)
        period = len(track) * self.dt
        lost = [self._lost(i, period) if well else "" for i, well in enumerate(flying)]
        if not any(lost) and np.isfinite(track).all() and np.isfinite(self._rates).all():
            return
        finite: NDArray[np.bool_] = np.asarray(np.isfinite(track).all(axis=2))
        well = np.asarray(finite.all(axis=0) & np.isfinite(self._rates).all(axis=1))
        for i in np.flatnonzero(flying).tolist():
            if not well[i]:
                self._faults[i] = "not finite"
                unknown = ~finite[:, i]
                track[unknown, i] = track[~unknown, i][-1] if finite[:, i].any() else self._position[i]
            else:
                self._faults[i] = lost[i]
            if self._faults[i]:
                self._theta[i], self._rates[i] = self._last_theta[i], 0.0

    def _lost(self, i: int, period: float) -> str:
        """What has befallen vehicle i over the last `period` [s], "" for nothing."""
        vehicle = self._vehicles[i]
        if vehicle.height_above_ground() < _GROUND_CONTACT_M:
            return "ground"
        alpha, roll = vehicle.upset()
        if abs(roll) > _UPSET_RAD:
            return "upset"
        self._stalled_s[i] = self._stalled_s[i] + period if alpha > self._stall[i] else 0.0
        return "stall" if self._stalled_s[i] > _STALL_S else ""

    def _move(self, flying: list[bool]) -> None:
        """Take course, counting turns, and rates from the vehicles that fly."""
        self._last_theta = self._theta.copy()
        if not any(flying):
            return
        # All of them, nearly always: a slice is much cheaper than a mask.
        which = slice(None) if all(flying) else np.array(flying)
        rows = [f.motion() for f, well in zip(self._vehicles, flying, strict=True) if well]
        course, self._rates[which] = motions(rows, self.origin)
        turned = course - self._theta[which]
        self._theta[which] += turned - 2 * np.pi * np.rint(turned / (2 * np.pi))

    def state(self) -> State:
        """Poses (N,): course and east-north-up position, the truth."""
        now = np.empty((4, len(self._theta)))
        now[0], now[1], now[3] = self._position.T
        now[2] = self._theta
        return State.of(now.T)

    def achieved(self) -> Command:
        """Ground speed, course rate and climb rate (N,)."""
        return Command.of(self._rates.copy())

    def telemetry(self) -> dict[str, Array]:
        """The channels of `aircraft.properties.TELEMETRY` and all surfaces, (N,); NaN where there is none."""
        rows = [f.telemetry() for f in self._vehicles]
        if self._alike:
            return dict(zip(rows[0], np.array([list(row.values()) for row in rows]).T.copy(), strict=True))
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}

    def faults(self) -> list[str]:
        """Per vehicle "", "not finite", "ground", "stall" (alpha) or "upset" (bank)."""
        return list(self._faults)

    def __len__(self) -> int:
        return len(self.airframes)
