"""Bounds the least distance of pairs over the motion between samples of their positions.

A sample is a position after a period of the flight dynamics. What lies between two samples is known in two
ways:

- A unicycle flies an arc that its pose and its rates fix. `closest_on_arcs` searches the closest approach of
  two arcs, and proves what it finds.
- The path of any other vehicle leaves the straight line between two samples, T apart, by at most a T^2 / 8,
  if its acceleration stays within a. Here a is taken to be twice the largest mean acceleration seen over two
  periods, |p(t - T) - 2 p(t) + p(t + T)| / T^2, because an acceleration that acts in one of them shows half
  of itself. A pair's distance is then known to within `Bends.radius`. Commands change at the ends of filter
  periods; a jump of velocity there bends no path between samples, so where a filter period has samples
  inside, only those count.
"""

from __future__ import annotations

import numpy as np

from filters.constraints import Indices
from filters.model import Array, Command, State, step
from testbed.measures.extreme import Extreme

# How closely the closest approach of two arcs is found [m].
TOLERANCE_M = 1e-9


class Bends:
    """How far N vehicles' paths bend between samples.

    largest  (N,) m, the largest second difference of positions; infinite until one was seen, since nothing is
             known between two samples of a path that was sampled twice
    """

    def __init__(self, vehicles: int) -> None:
        self.largest = np.full(vehicles, np.inf)
        self._last: Array | None = None

    def update(self, track: Array, periods: int) -> None:
        """Take in positions `track` (3, n, N) at n samples, the first of them at the end of a filter period.

        periods  samples per filter period
        """
        before, self._last = self._last, track[:, -2:].copy()
        if periods == 1 and before is not None and np.array_equal(before[:, -1], track[:, 0]):
            track = np.concatenate([before[:, :1], track], axis=1)
        second = track[:, 2:] - 2.0 * track[:, 1:-1] + track[:, :-2]
        bend = np.sqrt((second * second).sum(axis=0))
        if periods > 1:
            bend = bend[np.arange(1, len(bend) + 1) % periods != 0]
        if len(bend):
            seen = bend.max(axis=0)
            self.largest = np.where(np.isinf(self.largest), seen, np.maximum(self.largest, seen))

    def radius(self, i: Indices, j: Indices) -> Array:
        """(P,) m: how far the distance of pairs between samples may be from that of the straight lines."""
        return np.asarray(0.25 * (self.largest[i] + self.largest[j]))


class ArcApproach:
    """The least distances of P pairs of unicycles over whole filter periods.

    least     (P,) m, smallest distances reached on arcs that came near `enough`, and when
    possible  (P,) m, certified lower bounds over all arcs; the distance `enough` or more suffices
    """

    def __init__(self, i: Indices, j: Indices, enough: float) -> None:
        self._i, self._j, self._enough = i, j, enough
        self._at = np.arange(len(i))
        self.least, self.possible = Extreme.of(len(i)), np.full(len(i), np.inf)

    def take(self, i: Indices, j: Indices, at: Indices) -> None:
        """Look at the pairs (i, j) from now on, which are number `at` of all."""
        self._i, self._j, self._at = i, j, at

    def update(self, t: Array, start: State, flown: Command, chords: Array, fdm_dt: float) -> None:
        """Take in S filter periods that began at times `t` (S,).

        start, flown  (S, N) poses at their begin, and the rates flown
        chords        (S, periods, P) m, least distances on the straight lines between samples fdm_dt apart
        """
        if not len(t):
            return
        i, j, periods = self._i, self._j, chords.shape[1]
        bending = np.abs(flown.v * flown.omega) * (0.125 * fdm_dt**2)
        most = bending.max(axis=0)
        low = chords.min(axis=(0, 1)) - (most[i] + most[j])
        near = np.flatnonzero(low < self._enough)
        of = self._at
        self.possible[of] = np.minimum(self.possible[of], np.where(low < self._enough, np.inf, low))
        if not near.size:
            return
        each = chords[:, :, near].min(axis=1) - (bending[:, i[near]] + bending[:, j[near]])
        k, p = np.nonzero(each < self._enough)
        far = np.where(each < self._enough, np.inf, each).min(axis=0)
        self.possible[of[near]] = np.minimum(self.possible[of[near]], far)
        if not k.size:
            return
        a, b = (start[k, v[near[p]]] for v in (i, j))
        rates_a, rates_b = (flown[k, v[near[p]]] for v in (i, j))
        low, reached, when = closest_on_arcs(a, rates_a, b, rates_b, periods * fdm_dt, self._enough)
        np.minimum.at(self.possible, of[near[p]], low)
        for m in np.lexsort((reached, p)):  # few: the pairs about to touch
            pair = of[near[p[m]]]
            if reached[m] < self.least.value[pair]:
                self.least.value[pair], self.least.t[pair] = reached[m], t[k[m]] + when[m]


def closest_on_arcs(
    a: State, rates_a: Command, b: State, rates_b: Command, period: float, enough: float = np.inf
) -> tuple[Array, Array, Array]:
    """The closest approach of M pairs of unicycles that fly constant rates for `period` s.

    a, b      (M,) poses at the begin;  rates_a, rates_b  (M,) what they fly
    enough    m: above this distance a lower bound will do
    Returns low (M,) m, reached (M,) m and when (M,) s: the distance `reached` occurs at `when`, and none
            below `low` occurs; low >= min(enough, reached - TOLERANCE_M)

    Within an interval of length T the offset of a pair leaves its chord by at most a T^2 / 8, a bounding its
    acceleration. Intervals whose chord stays further away than a distance reached are dropped, the others
    halved.
    """
    turn_a, turn_b = rates_a.v * rates_a.omega, rates_b.v * rates_b.omega
    # The accelerations of two arcs turn at their course rates: their difference changes by that of the rates.
    bound = np.abs(turn_a * np.exp(1j * a.theta) - turn_b * np.exp(1j * b.theta))
    bound = bound + np.abs(rates_a.omega - rates_b.omega) * period * np.minimum(
        np.abs(turn_a), np.abs(turn_b)
    )

    def offset(m: Indices, t: Array) -> Array:
        return step(a[m], rates_a[m], t).position - step(b[m], rates_b[m], t).position

    owner = np.arange(len(a))
    begin, end = np.zeros(owner.size), np.full(owner.size, float(period))
    first, last = offset(owner, begin), offset(owner, end)
    at_begin, at_end = np.linalg.norm(first, axis=-1), np.linalg.norm(last, axis=-1)
    reached, when = np.minimum(at_begin, at_end), np.where(at_begin <= at_end, begin, end)
    low = np.full(owner.size, np.inf)
    while owner.size:
        least = nearest_on_chords(first, last) - 0.125 * bound[owner] * (end - begin) ** 2
        open_ = (least < reached[owner] - TOLERANCE_M) & (least < enough)
        np.minimum.at(low, owner[~open_], least[~open_])
        owner, begin, end, first, last = (x[open_] for x in (owner, begin, end, first, last))
        middle = 0.5 * (begin + end)
        between = offset(owner, middle)
        distance = np.linalg.norm(between, axis=-1)
        np.minimum.at(reached, owner, distance)
        best = distance == reached[owner]
        when[owner[best]] = middle[best]
        owner = np.concatenate([owner, owner])
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        first, last = np.concatenate([first, between]), np.concatenate([between, last])
    return np.minimum(low, reached), reached, when


def nearest_on_chords(first: Array, last: Array) -> Array:
    """(...) least length of vectors that change from `first` to `last`, (..., 3), along straight lines."""
    move = last - first
    length = (move * move).sum(axis=-1)
    share = -(first * move).sum(axis=-1) / np.where(length > 0.0, length, 1.0)
    nearest = first + np.minimum(np.maximum(share, 0.0), 1.0)[..., None] * move
    return np.asarray(np.linalg.norm(nearest, axis=-1))
