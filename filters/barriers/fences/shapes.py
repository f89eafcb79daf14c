"""Defines the shapes of fences, and the clearance along a turn or a straight flight from each of them.

Planar vectors are complex numbers, east + 1j north. A vehicle that turns for ever flies a whole circle; h is
the smallest clearance on it, which depends on the circle's centre and radius alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from filters.barriers.fences.polygon import Complex, Polygon
from filters.model import Array

# Nearer to a point than this, the distance from it has no direction [m].
AT_POINT_M = 1e-9


class Pieces(NamedTuple):
    """h as the least of M smooth functions.

    h         (..., M) m, the functions; their least is h
    planar    (..., M) complex: gradient over the circle's centre, or over the nearest point flown through
    vertical  (M,) or a number: gradient over the height
    """

    h: Array
    planar: Complex
    vertical: Array | float = 0.0


class Shape(Protocol):
    """What a fence lets vehicles stay in."""

    @property
    def count(self) -> int:
        """M, the number of functions whose least is h."""
        ...

    def clearance(self, point: Complex, height: Array) -> Array:
        """Signed distance (...) m of positions to the fence less its margin; < 0 is where none may be."""
        ...

    def between(self, first: Complex, last: Complex, ends: Array) -> Array:
        """The smallest clearance (...) on straight lines between positions whose own are `ends` (2, ...).

        Where both ends are on the wrong side it is that of the worse end.
        """
        ...

    def of_circle(self, centre: Complex, radius: Array, height: Array) -> Pieces:
        """The smallest clearance on circles (...) of radius > 0, flown at `height`."""
        ...

    def of_ray(self, point: Complex, ahead: Complex, height: Array) -> tuple[Pieces, Array]:
        """The smallest clearance on half-lines (...) from `point` along `ahead`, and m (..., M) to it.

        Raises  ValueError where no such flight keeps clear, or none is computed.
        """
        ...


@dataclass(frozen=True, eq=False)
class Area:
    """The inside of a polygon, which vehicles stay in, or its outside.

    margin  m, distance to keep from the boundary
    inside  whether to stay inside

    Inside, h is the least over the edges of |centre - edge| - radius. Outside it is the same, or, where the
    circle surrounds the polygon, the least over its corners of radius - |centre - corner|. Both are the exact
    clearance where h >= 0. Where h < 0, h is continued: the sign stays right, and |h| is how far the circle
    has to move (outside: has to move, or to grow).
    """

    polygon: Polygon
    inside: bool
    margin: float = 0.0

    def __post_init__(self) -> None:
        check_margin(self.margin)

    @property
    def count(self) -> int:
        return len(self.polygon.points)

    def clearance(self, point: Complex, height: Array) -> Array:
        """As `Shape.clearance`."""
        distance = self.polygon.edges(point)[0].min(axis=-1)
        allowed = self.polygon.contains(point) == self.inside
        return np.asarray(np.where(allowed, distance, -distance) - self.margin)

    def between(self, first: Complex, last: Complex, ends: Array) -> Array:
        """As `Shape.between`: a line that crosses the boundary twice comes down to 0, less the margin."""
        least, move = np.asarray(ends.min(axis=0)), (last - first)[..., None]
        corner = self.polygon.points - first[..., None]
        length = np.maximum(np.abs(move), 1e-300)
        along = np.clip((corner * move.conj()).real / length**2, 0.0, 1.0)
        passed = np.abs(corner - along * move).min(axis=-1)
        passed = np.where(self.polygon.crossed(first, last), 0.0, passed)
        return np.asarray(np.minimum(least, passed - self.margin))

    def of_circle(self, centre: Complex, radius: Array, height: Array) -> Pieces:
        """As `Shape.of_circle`."""
        distance, normal = self.polygon.signed(centre, self.inside)
        radius = radius[..., None]
        h = distance - radius
        if not self.inside:
            from_corner = centre[..., None] - self.polygon.points
            far = np.abs(from_corner)
            around = radius - far
            surrounds = around.min(axis=-1) > h.min(axis=-1)
            if surrounds.any():
                at, within = surrounds[..., None], np.maximum(far, AT_POINT_M)
                h, normal = np.where(at, around, h), np.where(at, -from_corner / within, normal)
        return Pieces(h - self.margin, normal)

    def of_ray(self, point: Complex, ahead: Complex, height: Array) -> tuple[Pieces, Array]:
        """As `Shape.of_ray`."""
        if self.inside:
            raise ValueError("a vehicle that flies straight on for ever leaves every area it shall stay in")
        raise ValueError("straight flight past a polygon is not computed; give a circle around it")


@dataclass(frozen=True, eq=False)
class Disc:
    """The outside of a disc.

    centre  complex, m;  radius  m, > 0;  margin  m, distance to keep from it
    Raises  ValueError naming the number that is out of range.
    Along a circle h = | |c - o| - r | - R: also where the circle surrounds the disc.
    """

    centre: complex
    radius: float
    margin: float = 0.0

    def __post_init__(self) -> None:
        check_margin(self.margin)
        if not (np.isfinite(self.radius) and self.radius > 0):
            raise ValueError(f"a disc's radius must be positive and finite, got {self.radius} m")

    count = 1

    def clearance(self, point: Complex, height: Array) -> Array:
        """As `Shape.clearance`."""
        return np.abs(point - self.centre) - (self.radius + self.margin)

    def between(self, first: Complex, last: Complex, ends: Array) -> Array:
        """As `Shape.between`."""
        move, offset = last - first, self.centre - first
        along = (offset * move.conj()).real / np.maximum(np.abs(move) ** 2, 1e-300)
        return self.clearance(first + np.clip(along, 0.0, 1.0) * move, ends[0])

    def of_circle(self, centre: Complex, radius: Array, height: Array) -> Pieces:
        """As `Shape.of_circle`."""
        offset = centre - self.centre
        apart = np.abs(offset)
        gap = apart - radius
        direction = np.where(gap < 0, -1.0, 1.0) * offset / np.maximum(apart, AT_POINT_M)
        return Pieces((np.abs(gap) - (self.radius + self.margin))[..., None], direction[..., None])

    def of_ray(self, point: Complex, ahead: Complex, height: Array) -> tuple[Pieces, Array]:
        """As `Shape.of_ray`."""
        offset = point - self.centre
        flown = np.maximum(-(offset * ahead.conj()).real, 0.0)
        nearest = offset + flown * ahead
        apart = np.abs(nearest)
        direction = nearest / np.maximum(apart, AT_POINT_M)
        return Pieces((apart - (self.radius + self.margin))[..., None], direction[..., None]), flown[
            ..., None
        ]


@dataclass(frozen=True, eq=False)
class Heights:
    """A band of heights; one of its ends may be infinite.

    floor, ceiling  m;  margin  m, distance to keep from both
    Raises  ValueError if the band less its margins is empty.
    """

    floor: float
    ceiling: float
    margin: float = 0.0
    _signs: Array = field(init=False, repr=False)  # of the ends that are finite, 1 for the floor
    _offsets: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_margin(self.margin)
        if not self.floor + 2 * self.margin < self.ceiling:
            raise ValueError(
                f"floor {self.floor:g} m and ceiling {self.ceiling:g} m, a margin of {self.margin:g} m from"
                " each, leave no height"
            )

        ends = [(sign, end) for sign, end in ((1.0, self.floor), (-1.0, self.ceiling)) if np.isfinite(end)]
        object.__setattr__(self, "_signs", np.array([sign for sign, _ in ends]))
        object.__setattr__(self, "_offsets", np.array([sign * end + self.margin for sign, end in ends]))

    @property
    def count(self) -> int:
        return len(self._signs)

    def clearance(self, point: Complex, height: Array) -> Array:
        """As `Shape.clearance`."""
        return np.minimum(height - self.floor, self.ceiling - height) - self.margin

    def between(self, first: Complex, last: Complex, ends: Array) -> Array:
        """As `Shape.between`: at one of the ends, since height changes evenly."""
        return np.asarray(ends.min(axis=0))

    def of_circle(self, centre: Complex, radius: Array, height: Array) -> Pieces:
        """As `Shape.of_circle`."""
        h = self._signs * height[..., None] - self._offsets
        return Pieces(h, np.zeros(h.shape, dtype=complex), self._signs)

    def of_ray(self, point: Complex, ahead: Complex, height: Array) -> tuple[Pieces, Array]:
        """As `Shape.of_ray`."""
        pieces = self.of_circle(point, np.zeros(height.shape), height)
        return pieces, np.zeros(pieces.h.shape)


def check_margin(margin: float) -> None:
    """Raises ValueError unless a margin is finite and not negative."""
    if not (np.isfinite(margin) and margin >= 0):
        raise ValueError(f"a fence's margin must be finite and not negative, got {margin} m")
