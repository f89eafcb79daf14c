"""The shared origin of a fleet: east-north-up coordinates on the WGS 84 ellipsoid.

x and y are measured in the plane that is level at the origin, z is the difference of geodetic heights.
Velocities are rotated into the same plane, so d(x, y)/dt is the velocity's east and north part exactly,
however far away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

M_PER_FT = 0.3048
G_MPS2 = 9.80665  # standard gravity

_A_M = 6378137.0
_B_M = 6356752.3142
_E2 = 1.0 - (_B_M / _A_M) ** 2


def enu_axes(latitude: float, longitude: float) -> Array:
    """East, north and up [rows] at a geodetic latitude and longitude [rad], in Earth-fixed axes."""
    sp, cp, sl, cl = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
    return np.array([[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])


def ecef(latitude: float, longitude: float, altitude: float) -> Array:
    """Earth-centred, Earth-fixed position [m] of a geodetic latitude, longitude [rad] and altitude [m]."""
    normal = _A_M / math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)
    ring = (normal + altitude) * math.cos(latitude)
    up = (normal * (1.0 - _E2) + altitude) * math.sin(latitude)
    return np.array([ring * math.cos(longitude), ring * math.sin(longitude), up])


def geodetic(position: Array) -> tuple[float, float, float]:
    """Latitude, longitude [rad] and altitude [m] of an ECEF position [m]; to rounding near the ground."""
    x, y, z = (float(c) for c in position)
    ring = math.hypot(x, y)
    latitude = math.atan2(z, ring * (1.0 - _E2))
    for _ in range(6):
        normal = _A_M / math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)
        latitude = math.atan2(z + _E2 * normal * math.sin(latitude), ring)
    normal = _A_M / math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)
    # Along the normal, which stays exact at every latitude, unlike ring / cos.
    s, c = math.sin(latitude), math.cos(latitude)
    altitude = ring * c + (z + _E2 * normal * s) * s - normal
    return latitude, math.atan2(y, x), altitude


@dataclass(frozen=True)
class Origin:
    """Where x = y = z = 0 is: geodetic position, and the ground's height [m], flat everywhere."""

    latitude_deg: float = 40.0
    longitude_deg: float = -105.0
    altitude_m: float = 300.0
    ground_m: float = 0.0

    @cached_property
    def axes(self) -> Array:
        """East, north and up at the origin [rows], in Earth-fixed axes."""
        return enu_axes(math.radians(self.latitude_deg), math.radians(self.longitude_deg))

    @cached_property
    def position(self) -> Array:
        """The origin itself, ECEF [m]."""
        return ecef(math.radians(self.latitude_deg), math.radians(self.longitude_deg), self.altitude_m)

    def geodetic(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Latitude, longitude [rad] and altitude [m] of an east-north-up position [m]."""
        up = z
        for _ in range(
            4
        ):  # the plane leaves the ellipsoid by r^2 / 2R: one or two corrections reach rounding
            point = self.position + np.array([x, y, up]) @ self.axes
            latitude, longitude, altitude = geodetic(point)
            up += self.altitude_m + z - altitude
        return latitude, longitude, self.altitude_m + z

    def enu(self, position: Array, altitude: Array) -> Array:
        """East-north-up positions (..., 3) of ECEF positions (..., 3) and geodetic altitudes (...), in m."""
        out: Array = (position - self.position) @ self.axes.T
        out[..., 2] = altitude - self.altitude_m
        return out


def positions(rows: Sequence[float] | Sequence[Sequence[float]] | Array, origin: Origin) -> Array:
    """Rows of `Fdm.run` or `Fdm.position`, four numbers each, flat or row by row, as east-north-up
    positions [m], (rows, 3)."""
    metres = np.array(rows, dtype=float).reshape(-1, 4)
    metres *= M_PER_FT
    return origin.enu(metres[:, :3], metres[:, 3])


def motion(row: Sequence[float], axes: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """A row of `Fdm.motion` as course [rad, in (-pi, pi]], ground speed [m/s], course rate [rad/s] and climb
    rate [m/s].

    axes  of the origin, as plain numbers: for a few vehicles numpy takes longer than for this
    """
    u, v, w, climb, omega = row
    (xe, ye, ze), (xn, yn, zn) = axes[0], axes[1]
    u, v, w = u * M_PER_FT, v * M_PER_FT, w * M_PER_FT
    east, north = xe * u + ye * v + ze * w, xn * u + yn * v + zn * w
    return math.atan2(north, east), math.hypot(east, north), omega, climb * M_PER_FT


def motions(rows: Sequence[Sequence[float]] | Array, origin: Origin) -> tuple[Array, Array]:
    """Rows of `Fdm.motion`, (N, 5), as `motion` gives them: course (N,), and the rates (N, 3)."""
    axes = origin.axes.tolist()
    found = np.array([motion(row, axes) for row in np.asarray(rows).tolist()])
    return found[:, 0], found[:, 1:]
