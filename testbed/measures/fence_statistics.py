"""Finds how near each vehicle came to its fences, also between samples, and the least h of each fence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.barriers.fences.fences import Fences
from filters.model import Array, Command, State
from testbed.measures.between_samples import Bends
from testbed.measures.extreme import Extreme


class FenceStatistics:
    """Extremes over a whole run of K combinations of a fence and a vehicle, as `fences` orders them.

    clearance  m, signed distance to the fence less its margin, at every FDM step
    between    m, on the straight lines between FDM steps
    h          m, at the true state, at every filter step

    A path leaves the straight line between two samples by no more than `radius`: see
    `testbed.measures.between_samples`, whose bounds are used here for one vehicle.
    """

    def __init__(self, fences: Fences, start: State, arcs: bool, periods: int, fdm_dt: float) -> None:
        """From `start` (N,) on, sampled every `fdm_dt` s, `periods` samples to a filter period.

        arcs  whether the vehicles are unicycles, which fly exact arcs over a filter period
        """
        self.fences, self._arcs, self._periods, self._fdm_dt = fences, arcs, periods, fdm_dt
        count = len(fences.fence)
        self.clearance, self.between, self.h = Extreme.of(count), Extreme.of(count), Extreme.of(count)
        self._bends, self._bent = Bends(len(start)), np.zeros(len(start))
        self._last = start.position[None], fences.clearance(start.position)[None]
        self.clearance.update(np.zeros(1), self._last[1])

    def positions(
        self, t: Array, track: Array, flown: Command, gone: NDArray[np.bool_] | None = None
    ) -> None:
        """Take in positions `track` (n, N, 3) at times `t` (n,), and the commands (S, N) that led there.

        gone  (S, N) who has left at the begin of each period; not judged. None if none can
        """
        at = self.fences.clearance(track)
        if gone is not None:
            at = np.where(np.repeat(gone, self._periods, axis=0)[:, self.fences.vehicle], np.inf, at)
        self.clearance.update(t, at)
        track, at = np.concatenate([self._last[0], track]), np.concatenate([self._last[1], at])
        self._lines(t, track, at)
        self._bends.update(np.ascontiguousarray(track.transpose(2, 0, 1)), self._periods)
        turning = np.abs(flown.v * flown.omega).max(axis=0)
        self._bent = np.maximum(self._bent, 0.125 * self._fdm_dt**2 * turning)
        self._last = track[-1:].copy(), at[-1:].copy()

    def state(self, t: Array, truth: State, gone: NDArray[np.bool_] | None = None) -> Array:
        """Take in true states (S, N) at times `t` (S,); returns h (S, K), inf of who has left."""
        h = self.fences.values(truth)
        if gone is not None:
            h = np.where(gone[:, self.fences.vehicle], np.inf, h)
        self.h.update(t, h)
        return h

    @property
    def radius(self) -> Array:
        """(K,) m: how far the clearance between samples may be from that on the straight line."""
        bent = self._bent if self._arcs else 0.25 * self._bends.largest
        return np.asarray(bent[self.fences.vehicle])

    def least(self) -> tuple[Array, Extreme]:
        """Lower bounds of the clearances (K,) m, and clearances reached, between samples as well."""
        radius = self.radius
        nearer = self.between.value + radius < self.clearance.value
        value = np.where(nearer, self.between.value + radius, self.clearance.value)
        when = np.where(nearer, self.between.t, self.clearance.t)
        low = np.minimum(self.between.value, self.clearance.value)
        return np.where(np.isfinite(radius), low, 0.0) - radius, Extreme(value, when)

    def _lines(self, t: Array, track: Array, at: Array) -> None:
        """Take in the straight lines between positions (n + 1, N, 3) whose clearances are `at`."""
        length = np.linalg.norm(np.diff(track, axis=0), axis=-1)[:, self.fences.vehicle]
        # No line comes nearer than half its length below the mean of its ends: few need a closer look.
        low = 0.5 * (at[:-1] + at[1:] - length)
        least = np.minimum(at[:-1], at[1:])
        near = np.flatnonzero((low < np.minimum(self.between.value, least.min(axis=0))).any(axis=1))
        if near.size:
            ends = np.stack([at[near], at[near + 1]])
            found = self.fences.between(track[near], track[near + 1], ends)
            # Who has left is far away at both ends.
            least[near] = np.where(np.isposinf(ends[0]), np.inf, found)
        self.between.update(t, least)
