"""Defines an encounter: several aircraft, where each of them flies, whatever file it came from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import cos, sin

import numpy as np

from filters.model import Array

# How much longer a flight that evades is than the straight one, for the run to see it arrive.
_DETOUR = 1.5


@dataclass(frozen=True, eq=False)
class Aircraft:
    """One aircraft of an encounter, from its begin on.

    name    as the file has it
    rows    (R, 4) t [s] from 0, x, y, z [m]: the recorded track; one row where only the start is known
    course  rad, counter-clockwise from east, at the start
    speed   m/s, over the ground, at the start
    climb   m/s, at the start
    legs    (L, 4) x, y, z [m] and the speed [m/s] on the way there, flown after the start; None for none
    goal    (3,) m, flown to; None where it follows its track or legs, or keeps its course
    """

    name: str
    rows: Array
    course: float
    speed: float
    climb: float = 0.0
    legs: Array | None = None
    goal: Array | None = None

    @property
    def tracked(self) -> bool:
        """Whether a track of it is known."""
        return len(self.rows) > 1

    @property
    def start(self) -> Array:
        """x, y, z [m]"""
        return np.asarray(self.rows[0, 1:])

    @property
    def velocity(self) -> Array:
        """East, north, up [m/s] at the start."""
        return np.array([self.speed * cos(self.course), self.speed * sin(self.course), self.climb])

    def scaled(self, k: float) -> Aircraft:
        """Speeds times k, times times k, lengths times k^2: the same turns at the same bank."""
        return replace(
            self,
            rows=self.rows * [k, k * k, k * k, k * k],
            speed=self.speed * k,
            climb=self.climb * k,
            legs=None if self.legs is None else self.legs * [k * k, k * k, k * k, k],
            goal=None if self.goal is None else self.goal * (k * k),
        )


@dataclass(frozen=True, eq=False)
class Encounter:
    """Aircraft that meet. Positions are east-north-up about the first one's start.

    name      a file name's letters
    aircraft  two or more; the first is the own vehicle
    source    the file it is from, or what made it
    notes     what reading it left out or assumed, a sentence each
    end       s, when it is over, where the file says it
    """

    name: str
    aircraft: tuple[Aircraft, ...]
    source: str
    notes: tuple[str, ...] = field(default=())
    end: float | None = None

    def scaled(self, k: float) -> Encounter:
        """As `Aircraft.scaled`."""
        end = None if self.end is None else self.end * k
        return replace(self, aircraft=tuple(a.scaled(k) for a in self.aircraft), end=end)

    @property
    def duration(self) -> float:
        """s.

        What the file says; the own track's end; 1.5 times the longest legs or way to a goal; or twice the
        time of the closest approach of straight flights, from 60 to 600 s.
        """
        own = self.aircraft[0]
        if self.end is not None:
            return self.end
        if own.tracked:
            return float(own.rows[-1, 0])
        if lasting := [_legs_last(a) for a in self.aircraft if a.legs is not None or a.goal is not None]:
            return _DETOUR * max(lasting)
        nearest = max(_closest(own, other) for other in self.aircraft[1:])
        return float(np.clip(2.0 * nearest, 60.0, 600.0))


def _legs_last(a: Aircraft) -> float:
    """s, for how long an aircraft flies to the end of its legs, or to its goal."""
    if a.legs is None:
        assert a.goal is not None
        return float(np.linalg.norm(a.goal - a.start)) / a.speed
    places = np.vstack([a.start, a.legs[:, :3]])
    lengths = np.linalg.norm(np.diff(places[:, :2], axis=0), axis=1)
    return float(np.sum(lengths / a.legs[:, 3]))


def _closest(own: Aircraft, other: Aircraft) -> float:
    """s, when two aircraft that keep their courses are closest; 0 where that is past."""
    apart, moving = other.start - own.start, other.velocity - own.velocity
    square = float(moving @ moving)
    return max(0.0, -float(apart @ moving) / square) if square > 0 else 0.0
