"""Defines a flight log as commands and responses of (v, omega, zeta) on one even time grid."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from filters.model import Array

CHANNELS = ("v", "omega", "zeta")
UNITS = ("m/s", "rad/s", "m/s")
GRID_S = 0.01
LONGEST_GAP_S = 1.0
"""Nothing is known at instants further than this from the nearest row of a signal."""
LONGEST_LOG_S = 36_000.0
RATE_SPAN_S = 0.2


class LogError(ValueError):
    """What is wrong with a flight log, in one line and without its name."""


@dataclass(frozen=True, eq=False)
class FlightLog:
    """A flight on the grid t = t0, t0 + GRID_S, ...; NaN where nothing is known.

    source, kind  the file's name; "ardupilot", "px4" or "csv"
    sha256        of the file
    t             (n,)    s, as in the log
    command       (n, 3)  ground speed [m/s], course rate [rad/s] and climb rate [m/s] asked for
    v, zeta       (n,)    m/s, ground speed and climb rate flown
    course        (n,)    rad, counter-clockwise from east, counting turns
    wind          (n, 2)  m/s, east and north: the air's motion over the ground
    notes         what had to be assumed, one line each
    """

    source: str
    kind: str
    sha256: str
    t: Array
    command: Array
    v: Array
    course: Array
    zeta: Array
    wind: Array
    notes: tuple[str, ...] = ()

    @cached_property
    def omega(self) -> Array:
        """The course rate flown (n,) rad/s: the mean over 0.2 s about each instant."""
        return mean_rate(self.course)

    @property
    def response(self) -> Array:
        """v, omega and zeta flown, (n, 3)."""
        return np.stack([self.v, self.omega, self.zeta], axis=-1)

    @property
    def known(self) -> np.ndarray:
        """(n,) where command and response are all known."""
        flown = np.isfinite(self.v) & np.isfinite(self.course) & np.isfinite(self.zeta)
        return np.asarray(flown & np.isfinite(self.command).all(axis=1))


@dataclass(frozen=True, eq=False)
class Signal:
    """Rows of one quantity: times (k,) s, increasing, and values (k,)."""

    t: Array
    x: Array

    @classmethod
    def of(cls, name: str, t: Array, x: Array) -> Signal:
        """The rows with finite values in order of time; of several at one time the last one counts.

        Raises  LogError naming the signal if fewer than two are left
        """
        t, x = np.asarray(t, dtype=float), np.asarray(x, dtype=float)
        kept = np.isfinite(t) & np.isfinite(x)
        t, x = t[kept], x[kept]
        order = np.argsort(t, kind="stable")
        t, x = t[order], x[order]
        last = np.append(np.diff(t) > 0, True) if t.size else np.zeros(0, dtype=bool)
        t, x = t[last], x[last]
        if t.size < 2:
            raise LogError(f"{name} has {t.size} usable row{'' if t.size == 1 else 's'}; two are needed")
        return cls(t, x)

    def linear(self, grid: Array) -> Array:
        """Values on the grid, in straight lines between rows: for what changes steadily."""
        return self._known(grid, np.interp(grid, self.t, self.x))

    def held(self, grid: Array) -> Array:
        """Values on the grid, each row valid until the next: for commands logged when they were given."""
        at = np.searchsorted(self.t, grid + 1e-9, side="right") - 1
        return self._known(grid, self.x[np.clip(at, 0, None)])

    def nearest(self, grid: Array) -> Array:
        """Values of the nearest row: for commands sampled at the logger's own rate.

        A step between two rows is then placed midway, which is right on average.
        """
        middle = 0.5 * (self.t[1:] + self.t[:-1])
        return self._known(grid, self.x[np.searchsorted(middle, grid, side="right")])

    def _known(self, grid: Array, values: Array) -> Array:
        after = np.clip(np.searchsorted(self.t, grid), 0, self.t.size - 1)
        before = np.clip(after - 1, 0, None)
        gap = np.minimum(np.abs(grid - self.t[before]), np.abs(grid - self.t[after]))
        inside = (grid >= self.t[0] - 1e-9) & (grid <= self.t[-1] + 1e-9)
        return np.where(inside & (gap <= LONGEST_GAP_S), values, np.nan)


def grid_of(*signals: Signal) -> Array:
    """The grid over the time that all signals cover. Raises LogError if they do not overlap."""
    begin, end = max(s.t[0] for s in signals), min(s.t[-1] for s in signals)
    if not end - begin >= 1.0:
        raise LogError("commands and responses do not overlap in time for a second")
    if end - begin > LONGEST_LOG_S:
        raise LogError(f"the log covers {end - begin:.0f} s; at most {LONGEST_LOG_S:.0f} s are read")
    return np.asarray(begin + GRID_S * np.arange(int((end - begin) / GRID_S) + 1))


def wrapped(t: Array, course: Array) -> Signal:
    """Courses [rad] as a signal that counts turns."""
    known = Signal.of("course", t, course)
    return Signal(known.t, np.unwrap(known.x))


def speed_over_ground(airspeed: Array, climb: Array, course: Array, wind: Array) -> Array:
    """Ground speed (n,) m/s of an aircraft with a true airspeed that keeps its course in the wind.

    Where the wind across is as strong as the airspeed, the course cannot be kept: NaN.
    """
    level2 = airspeed**2 - climb**2
    along = wind[:, 0] * np.cos(course) + wind[:, 1] * np.sin(course)
    across = wind[:, 1] * np.cos(course) - wind[:, 0] * np.sin(course)
    left = level2 - across**2
    return np.where(left >= 0, along + np.sqrt(np.maximum(left, 0.0)), np.nan)


def mean_rate(course: Array) -> Array:
    """Mean rates (..., n) rad/s over 0.2 s about each instant of courses (..., n); NaN at both ends."""
    half = round(RATE_SPAN_S / GRID_S / 2)
    rate = np.full(course.shape, np.nan)
    rate[..., half:-half] = (course[..., 2 * half :] - course[..., : -2 * half]) / (2 * half * GRID_S)
    return rate


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    found = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            found.update(block)
    return found.hexdigest()
