"""Finds the global minima of many smooth functions of time; a curvature bound ensures that none is missed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filters.model import Array

FIRST_CELLS = 32
# Cells alive at once, all functions together: more would not fit in memory.
CELL_LIMIT = 4_000_000

Function = Callable[[NDArray[Any], Array], Array]
"""(p, tau) -> values: function number p at time tau, both of one shape."""


class NotLocated(ArithmeticError):  # noqa: N818 - what happened, as PremiseNotMet
    """A minimum needs more cells than fit in memory; `function` is the number of the worst one."""

    def __init__(self, function: int) -> None:
        super().__init__(f"the minimum of function {function} cannot be located with {CELL_LIMIT} cells")
        self.function = function


def global_minimum(
    value: Function,
    slope: Function,
    curvature: Array,
    end: Array,
    periodic: NDArray[np.bool_],
    scale: Array,
    resolution: float,
) -> Array:
    """The time of the smallest value of each of P functions on [0, end].

    value      the functions, continuously differentiable
    slope      their derivatives by time
    curvature  (P,) bounds of |second derivative| on [0, end]
    end        (P,) s, >= 0
    periodic   (P,) True where end is a period, so that a time outside [0, end] is a time as well
    scale      (P,) s, time over which the function bends: Newton's difference step is a small part of it
    resolution a minimum may be missed only if it is less than this fraction of the function's size deeper
    Returns tau (P,) s, >= 0 unless periodic, polished on the slope.
    Raises  NotLocated.

    On a cell of width w with |f''| <= M, f lies above the parabola of second derivative M through the cell's
    ends. A cell whose parabola stays above the best sample cannot hold the minimum and is dropped; the others
    are halved. The parabola sinks at most M w^2/8 below the ends, so this stops, with the best sample within
    the resolution of the infimum.
    """
    n = np.arange(len(end))
    times = end[:, np.newaxis] * np.linspace(0.0, 1.0, FIRST_CELLS + 1)
    samples = value(n[:, np.newaxis], times)
    first = np.argmin(samples, axis=1)
    best, best_time = samples[n, first], times[n, first]
    size = np.maximum(np.max(np.abs(samples), axis=1), curvature * (end / FIRST_CELLS) ** 2)
    tolerance = resolution * size

    some = np.flatnonzero(end > 0)
    p = np.repeat(some, FIRST_CELLS)
    left = times[some, :-1].ravel()
    width = np.repeat(end[some] / FIRST_CELLS, FIRST_CELLS)
    at_left, at_right = samples[some, :-1].ravel(), samples[some, 1:].ravel()
    while True:
        low = least_possible(at_left, at_right, width, curvature[p])
        keep = low < best[p] - tolerance[p]
        if not np.any(keep):
            break
        p, left, at_left, at_right = p[keep], left[keep], at_left[keep], at_right[keep]
        if len(p) > CELL_LIMIT // 2:
            raise NotLocated(int(np.argmax(np.bincount(p))))
        width = 0.5 * width[keep]
        middle = left + width
        at_middle = value(p, middle)
        np.minimum.at(best, p, at_middle)
        hit = at_middle == best[p]
        best_time[p[hit]] = middle[hit]
        p, width = np.tile(p, 2), np.tile(width, 2)
        left = np.concatenate([left, middle])
        at_left, at_right = np.concatenate([at_left, at_middle]), np.concatenate([at_middle, at_right])
    return _polished(value, slope, best_time, best + tolerance, periodic, scale)


def least_possible(at_left: Array, at_right: Array, width: Array, curvature: Array) -> Array:
    """Lower bound of a function on each cell from its end values and its curvature bound, all (cells,)."""
    ends = np.minimum(at_left, at_right)
    rise = np.abs(at_right - at_left)
    sag = curvature * width**2
    # The parabola's vertex lies inside the cell only if the chord is flatter than the parabola can bend.
    inside = 2 * rise < sag
    safe_sag = np.where(inside, sag, 1.0)
    vertex = 0.5 * (at_left + at_right) - safe_sag / 8 - rise**2 / (2 * safe_sag)
    return np.where(inside, vertex, ends)


def _polished(
    value: Function,
    slope: Function,
    start: Array,
    ceiling: Array,
    periodic: NDArray[np.bool_],
    scale: Array,
) -> Array:
    """Newton's method on the slope from `start` (P,); a result whose value is above `ceiling` is dropped."""
    n = np.arange(len(start))
    eta = 1e-5 * scale
    bottom = np.where(periodic, -np.inf, 0.0)
    tau = start
    for _ in range(5):
        before, here, after = slope(np.stack([n] * 3), np.stack([tau - eta, tau, tau + eta]))
        bend = after - before
        bends = bend > 0
        step = np.where(bends, 2 * eta * here / np.where(bends, bend, 1.0), 0.0)
        tau = np.maximum(tau - np.clip(step, -1e-2 * scale, 1e-2 * scale), bottom)
    return np.where(value(n, tau) <= ceiling, tau, start)
