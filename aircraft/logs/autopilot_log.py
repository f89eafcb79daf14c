"""Turns what ArduPilot's and PX4's logs hold into commands and responses of (v, omega, zeta).

Both log the lateral command as a bank or a lateral acceleration, and the speed command as airspeed. With
ground speed Vg, heading psi and course chi the course rate asked for is a cos(chi - psi) / Vg, and the ground
speed asked for follows from the wind triangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aircraft.logs.record import FlightLog, Signal, digest, grid_of, speed_over_ground, wrapped

G_MPS2 = 9.80665
# Below walking speed a course means nothing.
_SLOWEST_MPS = 3.0


@dataclass(frozen=True, eq=False)
class Logged:
    """Signals of an autopilot's log, SI; angles counter-clockwise from east, lateral to the left.

    lateral_mps2  asked for
    airspeed_mps  asked for, true airspeed
    climb_mps     asked for
    east, north, up  m/s, velocity over the ground
    heading       rad, counting turns; None takes the course
    wind          m/s, east and north; None is calm
    """

    lateral_mps2: Signal
    airspeed_mps: Signal
    climb_mps: Signal
    east: Signal
    north: Signal
    up: Signal
    heading: Signal | None = None
    wind: tuple[Signal, Signal] | None = None


def flight(path: Path, kind: str, logged: Logged, notes: list[str]) -> FlightLog:
    """The flight that signals of an autopilot's log describe. Raises LogError."""
    asked = (logged.lateral_mps2, logged.airspeed_mps, logged.climb_mps)
    grid = grid_of(*asked, logged.east, logged.north, logged.up)
    lateral, airspeed, climb = (s.nearest(grid) for s in asked)
    east, north, up = (s.linear(grid) for s in (logged.east, logged.north, logged.up))
    # The course between rows: velocities may turn far from one row to the next, so interpolate the angle.
    n = np.interp(logged.east.t, logged.north.t, logged.north.x)
    course = wrapped(logged.east.t, np.arctan2(n, logged.east.x)).linear(grid)
    v = np.hypot(east, north)
    if logged.wind is None:
        wind = np.zeros((grid.size, 2))
        notes.append("no wind in the log: taken as calm, so airspeeds asked for are ground speeds")
    else:
        # Estimates of the wind come seldom and change slowly.
        wind = np.stack([np.interp(grid, s.t, s.x) for s in logged.wind], axis=-1)
    if logged.heading is None:
        notes.append("no heading in the log: taken as the course")
    crab = 0.0 if logged.heading is None else course - logged.heading.linear(grid)
    slow = ~(v > _SLOWEST_MPS)
    omega = lateral * np.cos(crab) / np.where(slow, np.nan, v)
    asked_v = speed_over_ground(airspeed, climb, course, wind)
    command = np.stack([asked_v, omega, climb], axis=-1)
    return FlightLog(
        path.name,
        kind,
        digest(path),
        grid,
        command,
        v,
        np.where(slow, np.nan, course),
        up,
        wind,
        tuple(notes),
    )
