"""Computes distances of points to the edges of a simple polygon, and which side of it they are on.

Planar vectors are complex numbers, east + 1j north.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.model import Array

Complex = NDArray[np.complex128]

# A point nearer to an edge than this is on it, and its distance has no direction of its own [m].
ON_EDGE_M = 1e-12


@dataclass(frozen=True, eq=False)
class Polygon:
    """A simple polygon: its edges meet only at its corners. It may be non-convex.

    corners  (M, 2) m, east and north, M >= 3, in either order round
    points   the same, complex (M,), counter-clockwise
    Raises   ValueError naming the corners (from 1) or edges that make it no simple polygon.
    """

    corners: ArrayLike
    points: Complex = field(init=False, repr=False)
    following: Complex = field(init=False, repr=False)  # (M,) the corner at which edge k ends
    along: Complex = field(init=False, repr=False)  # (M,) unit vector of each edge
    length: Array = field(init=False, repr=False)  # (M,) m, of each edge; edge k begins at corner k

    def __post_init__(self) -> None:
        given = np.asarray(self.corners, dtype=float)
        if given.ndim != 2 or given.shape[1] != 2 or not np.isfinite(given).all():
            raise ValueError("a polygon needs finite corners [x, y]")
        if len(given) < 3:
            raise ValueError(
                f"a polygon needs three corners at least, got {len(given)}; a circle needs centre and radius"
            )
        corners = given[:, 0] + 1j * given[:, 1]
        _check_simple(corners)
        if _area(corners) < 0:
            corners = corners[::-1].copy()
        following = np.roll(corners, -1)
        edge = following - corners
        object.__setattr__(self, "points", corners)
        object.__setattr__(self, "following", following)
        object.__setattr__(self, "length", np.abs(edge))
        object.__setattr__(self, "along", edge / self.length)

    def edges(self, point: Complex) -> tuple[Array, Complex]:
        """Distance (..., M) m of points (...) to each edge, and the unit vectors from edge to point.

        Each is a smooth function of a point off the edge; on it the vector is the edge's inward normal.
        """
        # In the edge's own frame: along it, and to its left, which is inside.
        own = (point[..., None] - self.points) * self.along.conj()
        own -= np.minimum(np.maximum(own.real, 0.0), self.length)
        distance = np.abs(own)
        if (distance <= ON_EDGE_M).any():
            own = np.where(distance <= ON_EDGE_M, 1j, own)
            return distance, own / np.abs(own) * self.along
        return distance, own / distance * self.along

    def contains(self, point: Complex) -> NDArray[np.bool_]:
        """Whether points (...) are inside; on the boundary either is said."""
        x, y = point.real[..., None], point.imag[..., None]
        first, then = self.points, self.following
        crosses = (first.imag > y) != (then.imag > y)
        # Where the edge is level it crosses nothing, and what the division gives is not used.
        rise = np.where(then.imag == first.imag, 1.0, then.imag - first.imag)
        at = first.real + (y - first.imag) / rise * (then.real - first.real)
        return np.asarray((crosses & (x < at)).sum(axis=-1) % 2 == 1)

    def crossed(self, first: Complex, last: Complex) -> NDArray[np.bool_]:
        """Whether straight lines (...) between points cross an edge."""

        def left_of(origin: Complex, ahead: Complex, point: Complex) -> Array:
            return np.asarray(((point - origin) * ahead.conj()).imag)

        a, b, here, there = self.points, self.following, first[..., None], last[..., None]
        apart = left_of(a, self.along, here) * left_of(a, self.along, there) < 0
        astride = left_of(here, there - here, a) * left_of(here, there - here, b) < 0
        return np.asarray((apart & astride).any(axis=-1))

    def signed(self, point: Complex, inside: bool) -> tuple[Array, Complex]:
        """Distances (..., M) to each edge and their gradients, > 0 on the side that is allowed.

        inside  whether that is the inside
        On the other side all M are that to the nearest edge, < 0: the least of them is the signed distance.
        """
        distance, normal = self.edges(point)
        wrong = self.contains(point) != inside
        if wrong.any():
            nearest = distance.argmin(axis=-1)[..., None]
            beyond = np.take_along_axis(distance, nearest, -1), np.take_along_axis(normal, nearest, -1)
            # On an edge the vector is the inward normal already.
            sign = np.where(beyond[0] <= ON_EDGE_M, 1.0 if inside else -1.0, -1.0)
            distance = np.where(wrong[..., None], -beyond[0], distance)
            normal = np.where(wrong[..., None], sign * beyond[1], normal)
        return distance, normal


def _area(corners: Complex) -> float:
    """m^2, positive counter-clockwise."""
    centred = corners - corners.mean()
    return float(0.5 * np.sum((centred.conj() * np.roll(centred, -1)).imag))


def _check_simple(corners: Complex) -> None:
    """Raises ValueError if two corners coincide, edges meet elsewhere than at their corner, or fold back."""
    count = len(corners)
    then = np.roll(corners, -1)
    size = float(np.abs(corners - corners.mean()).max())
    for k in range(count):
        for m in range(k + 1, count):
            if abs(corners[k] - corners[m]) <= 1e-9 * size:
                raise ValueError(f"corners {k + 1} and {m + 1} are at one place; leave one out")
    for k in range(count):
        # A following edge shares the corner; it may not fold back along this one.
        edge, following = then[k] - corners[k], then[(k + 1) % count] - then[k]
        turn = edge.conjugate() * following
        if turn.real < 0 and abs(turn.imag) <= 1e-9 * abs(turn):
            raise ValueError(
                f"the polygon folds back on itself at corner {(k + 1) % count + 1}; leave the corner out"
            )
        for m in range(k + 2, count):
            if (m + 1) % count != k and _meet(corners[k], then[k], corners[m], then[m]):
                raise ValueError(
                    f"the polygon crosses itself: edges {_edge(k, count)} and {_edge(m, count)} meet;"
                    " list the corners in order round it"
                )


def _edge(k: int, count: int) -> str:
    return f"{k + 1}-{(k + 1) % count + 1}"


def _meet(a: complex, b: complex, c: complex, d: complex) -> bool:
    """Whether the segments from a to b and from c to d have a point in common."""

    def side(p: complex, q: complex, r: complex) -> float:
        return ((q - p).conjugate() * (r - p)).imag

    def between(p: complex, q: complex, r: complex) -> bool:
        return ((q - p).conjugate() * (r - p)).real >= 0 >= ((q - p).conjugate() * (r - q)).real

    c_side, d_side, a_side, b_side = side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)
    if c_side * d_side < 0 and a_side * b_side < 0:
        return True
    touching = ((c_side, a, b, c), (d_side, a, b, d), (a_side, c, d, a), (b_side, c, d, b))
    return any(s == 0 and between(p, q, r) for s, p, q, r in touching)
