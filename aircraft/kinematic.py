"""KinematicFleet: the unicycles that the guarantee is proved on, and the same with identified lags.

The plain unicycle flies its command exactly, over the ground, whatever the wind. With lags the commands are
tracked as an autopilot would: ground speed, course rate and climb rate lag, and a change of wind carries the
vehicle at once, until the channels have corrected it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from filters.model import Array, Command, State, step


@dataclass(frozen=True)
class Lag:
    """One channel: first-order lag [s] after a pure delay [s], the rate bounded [1/s]."""

    time_constant_s: float = 0.0
    delay_s: float = 0.0
    rate_min: float = -math.inf
    rate_max: float = math.inf

    def __post_init__(self) -> None:
        if not (self.time_constant_s >= 0 and self.delay_s >= 0 and self.rate_min < 0 < self.rate_max):
            raise ValueError(f"a lag needs times >= 0 and rate_min < 0 < rate_max, got {self}")


def _triples(lags: Sequence[Lag] | Sequence[Sequence[Lag]], vehicles: int) -> list[list[Lag]]:
    """Per vehicle the lags of v, omega and zeta."""
    each = [list(entry) for entry in lags if not isinstance(entry, Lag)]
    shared = [entry for entry in lags if isinstance(entry, Lag)]
    if shared:
        each = [shared] * vehicles
    for triple in each:
        if len(triple) != 3:
            raise ValueError(f"lags are for v, omega and zeta: three, got {len(triple)}")
    if len(each) == 1:
        each = each * vehicles
    if len(each) != vehicles:
        raise ValueError(f"{vehicles} vehicles need one or {vehicles} triples of lags, got {len(each)}")
    return each


class _Channels:
    """The lags of N vehicles as arrays (N, 3), and the commands still under way to them."""

    def __init__(self, lags: list[list[Lag]], dt: float) -> None:
        def each(value: Callable[[Lag], float]) -> Array:
            return np.array([[value(lag) for lag in triple] for triple in lags])

        # Exact for a constant target; a pure rate limit when there is no lag.
        self._share = each(lambda lag: -math.expm1(-dt / lag.time_constant_s) if lag.time_constant_s else 1.0)
        self._most = each(lambda lag: lag.rate_max * dt)
        self._least = each(lambda lag: lag.rate_min * dt)
        self._delay = each(lambda lag: round(lag.delay_s / dt)).astype(int)
        self._which = np.ogrid[: len(lags), :3]

    def reset(self, rates: Array) -> None:
        """All were told `rates` (N, 3) for ever."""
        self._told = np.repeat(rates[None], self._delay.max() + 1, axis=0)
        self._now = 0

    def advance(self, rates: Array, asked: Array) -> Array:
        """The rates (N, 3) one period later, when `asked` is what they are told now."""
        self._now = (self._now + 1) % len(self._told)
        self._told[self._now] = asked
        heard = self._told[(self._now - self._delay) % len(self._told), *self._which]
        move: Array = np.clip((heard - rates) * self._share, self._least, self._most)
        return rates + move


class KinematicFleet:
    """N unicycles; a Plant (see `aircraft.plant`).

    vehicles     N
    dt           period [s]
    lags         one triple (v, omega, zeta) per vehicle, or one for all; None tracks commands perfectly, the
                 exact arc
    """

    def __init__(
        self,
        vehicles: int,
        dt: float = 0.005,
        lags: Sequence[Lag] | Sequence[Sequence[Lag]] | None = None,
    ) -> None:
        if vehicles < 1:
            raise ValueError("a fleet needs at least one vehicle")
        if not dt > 0:
            raise ValueError(f"the period must be positive, got {dt} s")
        self.dt = dt
        self._vehicles = vehicles
        self._channels = None if lags is None else _Channels(_triples(lags, vehicles), dt)

    def reset(
        self,
        state: State,
        rng: np.random.Generator,
        wind: Array | Sequence[float] = (0.0, 0.0, 0.0),
        speed: Array | float = 20.0,
    ) -> None:
        """Start at `state` (N,), straight and level. `rng` is not used.

        wind   m/s, (3,) or (N, 3)
        speed  ground speed [m/s], one or (N,); without lags the first command replaces it
        """
        if len(state) != self._vehicles:
            raise ValueError(f"{self._vehicles} vehicles cannot start at {len(state)} poses")
        if not np.all(state.isfinite()):
            raise ValueError(f"the start must be finite, got {state}")
        self._state = State.of(state.array().copy())
        self._rates = np.zeros((self._vehicles, 3))
        self._rates[:, 0] = speed
        self._wind = np.array(np.broadcast_to(np.asarray(wind, dtype=float), (self._vehicles, 3)))
        if self._channels:
            self._channels.reset(self._rates)

    def step(self, command: Command, wind: Array, n: int) -> Array:
        """Fly `command` (N,) for n periods in `wind` (N, 3); returns positions (n, N, 3). NaN is refused."""
        wind = np.broadcast_to(np.asarray(wind, dtype=float), (self._vehicles, 3))
        if not (np.all(command.isfinite()) and np.all(np.isfinite(wind))):
            raise ValueError(f"command and wind must be finite, got {command} in {wind}")
        asked = np.broadcast_to(command.array(), (self._vehicles, 3))
        track = np.empty((n, self._vehicles, 3))
        if self._channels:
            self._carry(wind)
        for k in range(n):
            if self._channels:
                before, self._rates = self._rates, self._channels.advance(self._rates, asked)
                flown = Command.of(0.5 * (before + self._rates))  # the mean rates flown over the period
            else:
                self._rates = asked.copy()
                flown = Command.of(asked)
            self._state = step(self._state, flown, self.dt)
            track[k] = self._state.array()[:, [0, 1, 3]]
        return track

    def _carry(self, wind: Array) -> None:
        """A change of wind adds to the ground velocity; speed, course and climb rate follow from the sum."""
        change = wind - self._wind
        self._wind = wind.copy()
        v, theta = self._rates[:, 0], self._state.theta
        east, north = v * np.cos(theta) + change[:, 0], v * np.sin(theta) + change[:, 1]
        turned = np.remainder(np.arctan2(north, east) - theta + np.pi, 2 * np.pi) - np.pi
        blown = np.any(change != 0, axis=1)
        self._rates[:, 0] = np.where(blown, np.hypot(east, north), v)
        self._rates[:, 2] += change[:, 2]
        self._state = State(
            self._state.x, self._state.y, np.where(blown, theta + turned, theta), self._state.z
        )

    def state(self) -> State:
        """Poses (N,)."""
        return self._state

    def achieved(self) -> Command:
        """Ground speed, course rate and climb rate (N,)."""
        return Command.of(self._rates.copy())

    def telemetry(self) -> dict[str, Array]:
        """Nothing: a unicycle has no attitude."""
        return {}

    def faults(self) -> list[str]:
        """A unicycle has none."""
        return [""] * self._vehicles

    def close(self) -> None:
        """Do nothing: a unicycle holds nothing to release."""
