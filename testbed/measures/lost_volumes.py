"""Follows pairs along recorded paths: which volumes they lose, and where they are closest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filters.model import Array
from testbed.measures.between_samples import Bends
from testbed.measures.cylinders import Cylinder, inside, nearest

# Pairs times instants looked at at a time: some tens of megabytes.
_BLOCK = 500_000


@dataclass(frozen=True)
class Lost:
    """What became of one cylinder in a run; see `encounter_measures.CYLINDER_COLUMNS`."""

    lost: bool
    undecided: bool
    pairs: int
    first_s: float | None
    time_s: float
    depth: float


@dataclass(frozen=True)
class Paths:
    """Recorded positions of N vehicles, and the P pairs of them that are looked at.

    t        (T,) s;  place  (3, T, N) m
    i, j     (P,) vehicles of each pair, from 0
    left     (T, N) who has left and is not looked at; None if nobody can
    turning  (T, N) m/s^2, the acceleration of unicycles from each instant to the next; None for vehicles
             whose motion between samples is not known, see `between_samples.Bends`
    """

    t: Array
    place: Array
    i: NDArray[np.int_]
    j: NDArray[np.int_]
    left: NDArray[np.bool_] | None = None
    turning: Array | None = None

    @cached_property
    def bends(self) -> tuple[Array, Array]:
        """(P,) m each: how far a pair's offset may leave the straight line between samples, across and up."""
        if len(self.t) < 2:
            return np.zeros(self.i.size), np.zeros(self.i.size)
        if self.turning is not None:
            step = np.diff(self.t)[:, None]
            each = (0.125 * step**2 * self.turning[:-1]).max(axis=0)
            return each[self.i] + each[self.j], np.zeros(self.i.size)
        found = []
        for keep in ([1.0, 1.0, 0.0], [0.0, 0.0, 1.0]):
            bends = Bends(self.place.shape[2])
            bends.update(self.place * np.array(keep)[:, None, None], 1)
            found.append(bends.radius(self.i, self.j))
        return found[0], found[1]

    def blocks(self) -> list[slice]:
        """Instants of the intervals, some at a time."""
        size = max(1, _BLOCK // max(1, self.i.size))
        last = len(self.t) - 1
        return [slice(k, min(k + size, last)) for k in range(0, last, size)]

    def offsets(self, block: slice) -> tuple[Array, Array]:
        """Offsets (3, B, P) m at the begin of intervals, and what is added by their end; nan of who left."""
        whole = self.place[:, block.start : block.stop + 1]
        apart = whole[:, :, self.i] - whole[:, :, self.j]
        if self.left is not None:
            gone = self.left[block.start : block.stop + 1]
            apart = np.where(gone[:, self.i] | gone[:, self.j], np.nan, apart)
        return apart[:, :-1], np.diff(apart, axis=1)

    def closest(self) -> tuple[dict[str, Any], tuple[int, ...]]:
        """The least distance of any pair on straight lines: its columns, and the pair, from 0."""
        found: tuple[float, float, int, Array] = (np.inf, np.nan, -1, np.full(3, np.nan))
        for block in self.blocks():
            a, move = self.offsets(block)
            length = (move * move).sum(axis=0)
            share = np.clip(-(a * move).sum(axis=0) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
            distance = np.sqrt(((a + share * move) ** 2).sum(axis=0))
            k = int(np.argmin(np.where(np.isnan(distance), np.inf, distance)))
            if distance.flat[k] < found[0]:
                row, pair = divmod(k, self.i.size)
                begin = block.start + row
                when = self.t[begin] + share[row, pair] * (self.t[begin + 1] - self.t[begin])
                place = a[:, row, pair] + share[row, pair] * move[:, row, pair]
                found = float(distance[row, pair]), float(when), pair, place
        if found[2] < 0 and len(self.t):  # a record of one instant
            apart = self.place[:, 0, self.i] - self.place[:, 0, self.j]
            pair = int(np.argmin(np.linalg.norm(apart, axis=0)))
            place = apart[:, pair]
            found = float(np.linalg.norm(place)), float(self.t[0]), pair, place
        value, at, pair, place = found
        columns = {
            "closest_m": value if np.isfinite(value) else None,
            "closest_horizontal_m": float(np.hypot(*place[:2])) if pair >= 0 else None,
            "closest_vertical_m": float(abs(place[2])) if pair >= 0 else None,
            "closest_s": at if pair >= 0 else None,
        }
        return columns, (int(self.i[pair]), int(self.j[pair])) if pair >= 0 else ()

    def until(self, goal: Array, radius: float) -> Array:
        """(N,) s: when each vehicle first was within `radius` of its `goal` (N, 3), or the last instant."""
        if not len(self.t):
            return np.zeros(len(goal))
        distance = np.linalg.norm(self.place - goal.T[:, None], axis=0)
        there = distance <= radius  # nan, of a vehicle without a goal, is not
        return np.asarray(np.where(there.any(axis=0), self.t[there.argmax(axis=0)], self.t[-1]))

    def lengths(self, until: Array) -> Array:
        """(N,) m: the path of each vehicle until then."""
        steps = np.linalg.norm(np.diff(self.place, axis=1), axis=0)
        return np.asarray(np.where(self.t[1:, None] <= until + 1e-9, steps, 0.0).sum(axis=0))


def lost(paths: Paths, cylinder: Cylinder) -> Lost:
    """Which pairs were inside `cylinder` about each other, how deep and for how long.

    All is counted on straight lines between samples. `undecided` says that a cylinder smaller or larger by
    the bends would be lost differently.
    """
    across, up = paths.bends
    pairs = paths.i.size
    least, time = np.full(pairs, np.inf), np.zeros(pairs)
    first = np.inf
    sampled, surely, maybe = False, False, False
    for block in paths.blocks():
        a, move = paths.offsets(block)
        near = _near(a, move, cylinder, across, up)
        if not near.any():
            continue
        row, pair = np.nonzero(near)
        begin, step = a[:, row, pair], move[:, row, pair]
        measure, _ = nearest(begin, step, cylinder)
        np.minimum.at(least, pair, measure)
        low, high = inside(begin, step, cylinder)
        length = np.diff(paths.t[block.start : block.stop + 1])[row]
        np.add.at(time, pair, (high - low) * length)
        entered = high > low
        if entered.any():
            first = min(first, float((paths.t[block.start + row] + low * length)[entered].min()))
        maybe |= _reaches(begin, step, cylinder, across[pair], up[pair], 1.0)
        surely |= _reaches(begin, step, cylinder, across[pair], up[pair], -1.0)
        sampled |= bool((_measure(begin, cylinder) < 1.0).any())
        sampled |= bool((_measure(begin + step, cylinder) < 1.0).any())
    happened = bool((least < 1.0).any())
    undecided = bool(not (sampled or surely) if happened else maybe)
    if not len(paths.t) or (len(paths.t) == 1 and not happened):
        undecided = True
    return Lost(
        happened,
        undecided,
        int((least < 1.0).sum()),
        first if np.isfinite(first) else None,
        float(time.max(initial=0.0)),
        float(max(0.0, 1.0 - least.min(initial=np.inf))),
    )


def _near(a: Array, move: Array, cylinder: Cylinder, across: Array, up: Array) -> NDArray[np.bool_]:
    """(B, P) intervals that may touch the cylinder; the others surely do not."""
    reach = np.hypot(move[0], move[1])
    flat = np.hypot(a[0], a[1]) - reach < cylinder.radius_m + across
    return np.asarray(flat & (np.abs(a[2]) - np.abs(move[2]) < cylinder.half_height_m + up))


def _measure(offset: Array, cylinder: Cylinder) -> Array:
    across, up = np.hypot(offset[0], offset[1]), np.abs(offset[2])
    return np.asarray(np.maximum(across / cylinder.radius_m, up / cylinder.half_height_m))


def _reaches(a: Array, move: Array, cylinder: Cylinder, across: Array, up: Array, sign: float) -> bool:
    """Whether any line enters the cylinder grown (sign 1) or shrunk (sign -1) by its pair's bends."""
    radius, height = cylinder.radius_m + sign * across, cylinder.half_height_m + sign * up
    there = (radius > 0.0) & (height > 0.0)
    if not there.any():
        return False
    if not (np.isfinite(radius[there]).all() and np.isfinite(height[there]).all()):
        return True
    scale = np.stack([radius[there], radius[there], height[there]])
    measure, _ = nearest(a[:, there] / scale, move[:, there] / scale, Cylinder(1.0, 1.0))
    return bool((measure < 1.0).any())
