"""Integrates command channels in closed form: first order after a pure delay, the rate of change bounded.

A channel of time constant T that is told a constant g moves at its largest rate until it is within T times
that rate of g, then decays towards g.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from filters.constraints import Indices
from filters.model import Array

# No aircraft's channel changes faster: stands in for an unlimited rate, and for no lag at all.
_FASTEST, _QUICKEST_S = 1e9, 1e-9
# exp of more than this is near what a float can hold.
_LARGEST_POWER = 600.0


class Lag(Protocol):
    """How one channel follows its command (see `aircraft.kinematic.Lag`)."""

    @property
    def time_constant_s(self) -> float: ...
    @property
    def delay_s(self) -> float: ...
    @property
    def rate_min(self) -> float: ...
    @property
    def rate_max(self) -> float: ...


@dataclass(frozen=True, eq=False)
class Channels:
    """The channels of N vehicles, arrays (N, 3) over (v, omega, zeta).

    constant    s, time constants
    delay       s
    fall, rise  largest rates of change downwards and upwards, both positive, unit per second
    """

    constant: Array
    delay: Array
    fall: Array
    rise: Array

    @classmethod
    def of(cls, lags: Sequence[Sequence[Lag]], vehicles: int) -> Channels:
        """From one triple of lags for all vehicles, or one for each.

        Raises  ValueError for another number of lags, or a number that is no time or rate
        """
        if len(lags) not in (1, vehicles) or any(len(triple) != 3 for triple in lags):
            raise ValueError(f"{vehicles} vehicles need one or {vehicles} triples of lags, got {len(lags)}")

        def each(name: str) -> Array:
            found = np.array([[float(getattr(lag, name)) for lag in triple] for triple in lags])
            return np.broadcast_to(found, (vehicles, 3)).copy()

        constant, delay, falls, rises = (
            each(name) for name in ("time_constant_s", "delay_s", "rate_min", "rate_max")
        )
        for name, values in (("time constant", constant), ("delay", delay)):
            if not np.all(np.isfinite(values) & (values >= 0)):
                raise ValueError(f"a {name} must be finite and not negative, got {values.tolist()} s")
        if not (np.all(falls < 0) and np.all(rises > 0)):
            raise ValueError("a channel needs rate_min < 0 < rate_max")
        return cls(
            np.maximum(constant, _QUICKEST_S),
            delay,
            np.minimum(-falls, _FASTEST),
            np.minimum(rises, _FASTEST),
        )

    def slewed(self, slew: Array) -> Channels:
        """Those of commands that never change faster than `slew` (3,), unit per second; inf: as they are.

        A lag of T lets a ramp through as it is, T later. So the time constant becomes delay, and the ramp the
        largest rate; what that leaves out are the ramp's corners, slew T^2 of the integral at most.
        Raises  ValueError for a slew that is not positive, or faster than a channel of the vehicles
        """
        if not np.all(slew > 0):
            raise ValueError(f"commands change by more than 0 a second, got {slew.tolist()}")
        some = np.isfinite(slew)
        most = np.minimum(self.fall, self.rise).min(axis=0)
        if np.any(some & (slew > most)):
            raise ValueError(
                f"commands that change by {slew[some].tolist()} a second are faster than the channels, which"
                f" change by {most[some].tolist()}"
            )
        return Channels(
            np.where(some, _QUICKEST_S, self.constant),
            self.delay + np.where(some, self.constant, 0.0),
            np.where(some, slew, self.fall),
            np.where(some, slew, self.rise),
        )

    def of_some(self, vehicles: Indices) -> Channels:
        """Those of some vehicles alone."""
        v = vehicles
        return Channels(self.constant[v], self.delay[v], self.fall[v], self.rise[v])

    def towards(self, y: Array, goal: Array) -> Motion:
        """The motion (..., N, 3) of channels at y that are told `goal` from now on."""
        return Motion(y, goal, self.constant, np.where(goal > y, self.rise, -self.fall))


class Motion:
    """Channels (...,) that move from `y` towards constant goals; `rate` is signed, the largest on the way."""

    def __init__(self, y: Array, goal: Array, constant: Array, rate: Array) -> None:
        self._y, self._goal, self._constant, self._rate = y, goal, constant, rate
        gap = goal - y
        # How long the rate is at its bound, and what is left of the gap then.
        self.bounded = np.maximum(gap / rate - constant, 0.0)
        self._left = gap - rate * self.bounded

    def value(self, t: Array | float) -> Array:
        """The channels' values after t [s]."""
        early = np.minimum(t, self.bounded)
        decay = 1.0 - np.exp((early - t) / self._constant)
        return np.asarray(self._y + self._rate * early + self._left * decay)

    def integral(self, t: Array, decay: Array | None = None) -> Array:
        """Their integrals over t [s]; t (..., M) against channels (...,).

        decay  exp(-t / time constant) of t (M,) or (channels, M), where it is known already
        """
        y, goal, rate = self._y[..., None], self._goal[..., None], self._rate[..., None]
        bounded, left = self.bounded[..., None], (self._left * self._constant)[..., None]
        early = np.minimum(t, bounded)
        late = t - early
        gone = self._gone(late, decay)
        total: Array = rate * early
        total *= 0.5
        total += y
        total *= early
        late *= goal
        total += late
        gone *= left
        total += gone
        return total

    def _gone(self, late: Array, decay: Array | None) -> Array:
        """exp(-late / time constant) - 1 of times `late` since the rate was at its bound."""
        grown = self.bounded / self._constant
        if decay is not None and grown.max(initial=0.0) < _LARGEST_POWER:
            # Before that time the product is above 1.
            gone: Array = decay * np.exp(grown)[..., None]
            np.minimum(gone, 1.0, out=gone)
        else:
            gone = np.exp(late / -self._constant[..., None])
        gone -= 1.0
        return gone
