"""Measures how deep and for how long pairs are inside a cylinder about each other, between samples too.

A cylinder is lost while the horizontal distance is below its radius and the difference of heights below its
half height. Between two samples the offset of a pair moves along a straight line, but for a bend of known
size; on the line all is in closed form.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from filters.model import Array
from testbed.encounters.units import FT
from testbed.errors import UserError, short


@dataclass(frozen=True)
class Cylinder:
    """A volume about a vehicle that others keep out of.

    radius_m  horizontally;  half_height_m  above and below
    """

    radius_m: float
    half_height_m: float

    def __str__(self) -> str:
        return f"{self.radius_m:.4g} m x {self.half_height_m:.4g} m"


# Between two small unmanned aircraft: 50 ft by 15 ft, the analogue of the NMAC of crewed aircraft. Weinert,
# Alvarez, Owen & Zintak 2022, J. Air Transportation (preprint: doi 10.20944/preprints202011.0503.v1).
SMALL_NMAC = Cylinder(50 * FT, 15 * FT)
# Ours: NMAC scaled as well clear is to NMAC for a small unmanned and a crewed aircraft, 4 and 2.5 times.
SMALL_WELL_CLEAR = Cylinder(200 * FT, 37.5 * FT)
# Of crewed aircraft: 500 ft by 100 ft, as for TCAS; also of a small unmanned and a crewed one.
CREWED_NMAC = Cylinder(500 * FT, 100 * FT)
# Of a small unmanned aircraft and a crewed one: 2000 ft by 250 ft (Weinert, Campbell, Vela, Schuldt & Kurucar
# 2018, J. Air Transportation 26(3), doi 10.2514/1.D0091).
CREWED_WELL_CLEAR = Cylinder(2000 * FT, 250 * FT)


def read(text: str, option: str) -> Cylinder:
    """A cylinder as a person writes it: "30x10" in metres, "500x100ft" in feet.

    Raises UserError naming `option`
    """
    match = re.fullmatch(r"\s*([\d.]+)\s*(?:m|ft)?\s*x\s*([\d.]+)\s*(m|ft)?\s*", text)
    try:
        if match is None:
            raise ValueError
        radius, height = (float(part) * (FT if match[3] == "ft" else 1.0) for part in (match[1], match[2]))
        if not (0 < radius <= 1e6 and 0 < height <= 1e6):
            raise ValueError
    except ValueError:
        raise UserError(
            f"{option} {short(text)!r}: give radius x half height, as 30x10 (metres) or 500x100ft (feet)"
        ) from None
    return Cylinder(radius, height)


def nearest(offset: Array, move: Array, cylinder: Cylinder) -> tuple[Array, Array]:
    """How near pairs come to the middle of the cylinder on straight lines, (M,), and where on them, 0 to 1.

    offset  (3, M) m at the begin;  move  (3, M) m, what is added to it until the end
    The measure is max(horizontal / radius, vertical / half height): below 1 is inside. It is convex along
    the line, so it is least at an end, where one of the two is least, or where they are equal.
    """
    across = offset[:2] / cylinder.radius_m, move[:2] / cylinder.radius_m
    up = offset[2] / cylinder.half_height_m, move[2] / cylinder.half_height_m
    # (a + b s + c s^2) is the square of the horizontal part less that of the vertical one.
    square, along = (across[1] ** 2).sum(axis=0), (across[0] * across[1]).sum(axis=0)
    a = (across[0] ** 2).sum(axis=0) - up[0] ** 2
    b = 2.0 * (along - up[0] * up[1])
    c = square - up[1] ** 2
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = np.sqrt(b * b - 4.0 * a * c)
        both = -0.5 * (b + np.where(b < 0.0, -1.0, 1.0) * root)
        places = np.stack(
            [np.zeros_like(a), np.ones_like(a), -along / square, -up[0] / up[1], both / c, a / both]
        )
    places = np.where(np.isfinite(places), np.clip(places, 0.0, 1.0), 0.0)
    horizontal = np.hypot(*(across[0][:, None] + places * across[1][:, None]))
    measure = np.maximum(horizontal, np.abs(up[0] + places * up[1]))
    best = measure.argmin(axis=0)[None]
    return np.take_along_axis(measure, best, 0)[0], np.take_along_axis(places, best, 0)[0]


def inside(offset: Array, move: Array, cylinder: Cylinder) -> tuple[Array, Array]:
    """From where to where on straight lines, 0 to 1, pairs are inside the cylinder, (M,) each.

    Both are equal where they are nowhere inside. offset, move as in `nearest`.
    """
    a = (offset[:2] ** 2).sum(axis=0) - cylinder.radius_m**2
    b = (offset[:2] * move[:2]).sum(axis=0)
    c = (move[:2] ** 2).sum(axis=0)
    low, high = _between(a, b, c)
    height, climb = offset[2], move[2]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        first, last = (
            (side * np.sign(climb) * cylinder.half_height_m - height) / climb for side in (-1.0, 1.0)
        )
    level = climb == 0.0
    never = level & ~(np.abs(height) < cylinder.half_height_m)
    low = np.maximum(np.maximum(low, np.where(level, 0.0, first)), 0.0)
    high = np.minimum(np.minimum(high, np.where(level, 1.0, last)), 1.0)
    out = never | ~(low < high)
    return np.where(out, 0.0, low), np.where(out, 0.0, high)


def _between(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Where a + 2 b s + c s^2 < 0; low = 1 and high = 0 where nowhere. c >= 0."""
    room = b * b - a * c
    still = c == 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = np.sqrt(np.maximum(room, 0.0))
        low, high = (-b - root) / c, (-b + root) / c
    low, high = np.where(still, 0.0, low), np.where(still, 1.0, high)
    nowhere = np.where(still, ~(a < 0.0), ~(room > 0.0))
    return np.where(nowhere, 1.0, low), np.where(nowhere, 0.0, high)
