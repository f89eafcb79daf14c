"""Proves that fences leave a vehicle no place: no turn of its manoeuvre fits, or no height is allowed."""

from __future__ import annotations

import numpy as np

from filters.barriers.fences.fences import Fences
from filters.barriers.fences.shapes import Area, Heights, Shape
from filters.model import Array

# Cells smaller than this, or more of them than that, prove nothing any more.
LEAST_CELL_M = 0.01
MOST_CELLS = 200_000


def nowhere(fences: Fences, vehicle: int) -> str:
    """Why the fences of a vehicle (from 0) leave it no safe state; "" unless that is proved."""
    own = [f for f in fences.fences if vehicle in f.vehicles]
    names = " and ".join(f.name for f in own)
    bands = [f.shape for f in own if isinstance(f.shape, Heights)]
    low = max((b.floor + b.margin for b in bands), default=-np.inf)
    high = min((b.ceiling - b.margin for b in bands), default=np.inf)
    if low > high:
        return f"{names} leave vehicle {vehicle + 1} no height"
    flat = [f.shape for f in own if not isinstance(f.shape, Heights)]
    gamma = fences.gamma
    if not gamma.omega[vehicle]:
        return ""
    radius = float(gamma.v[vehicle] / abs(gamma.omega[vehicle]))
    if _no_circle(flat, radius):
        return f"{names} leave vehicle {vehicle + 1} no room: no turn of {radius:.1f} m radius fits anywhere"
    return ""


def _no_circle(shapes: list[Shape], radius: float) -> bool:
    """Whether no circle is clear of all shapes, by halving of cells.

    The clearance changes by no more than the centre moves: a cell whose middle lacks more than half its
    diagonal holds no centre.
    """
    areas = [s for s in shapes if isinstance(s, Area) and s.inside]
    if not areas:
        return False
    corners = min((a.polygon.points for a in areas), key=lambda p: np.ptp(p.real) * np.ptp(p.imag))
    middle = np.array([complex(np.ptp(corners.real), np.ptp(corners.imag)) / 2])
    half = middle[0]
    middle = middle + complex(corners.real.min(), corners.imag.min())
    while middle.size:
        least = _least(shapes, middle, radius)
        if least.max() >= 0.0:
            return False
        middle = middle[least + abs(half) >= 0.0]
        if abs(half) < LEAST_CELL_M or middle.size > MOST_CELLS:
            return False
        half /= 2
        middle = np.concatenate(
            [middle + complex(x * half.real, y * half.imag) for x in (-1, 1) for y in (-1, 1)]
        )
    return True


def _least(shapes: list[Shape], centre: np.ndarray, radius: float) -> Array:
    """The smallest clearance of circles about `centre` (n,) to any of the shapes."""
    of = np.full(centre.shape, radius), np.zeros(centre.shape)
    return np.asarray(np.min([s.of_circle(centre, *of).h.min(axis=-1) for s in shapes], axis=0))
