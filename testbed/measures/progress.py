"""Measures how long vehicles go without coming nearer to their goals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.model import Array
from testbed.scenario import fleet, guidance_rules
from testbed.scenario.scenario import Scenario


class Progress:
    """The longest waits of N vehicles that are `distance` (N,) m from their goals at 0 s.

    A vehicle makes progress at a filter step at which it is nearer to its goal than at its last progress by
    `quantum` [m], or within `quantum` of it. Its wait is the time between; once it is there it waits no more.
    """

    def __init__(self, distance: Array, quantum: float, patience_s: float) -> None:
        self._quantum, self.patience_s = quantum, patience_s
        self._next = np.where(distance <= quantum, -np.inf, np.maximum(distance - quantum, quantum))
        self._since = np.where(distance <= quantum, np.inf, 0.0)
        self._longest = np.zeros(len(distance))
        self._begin = np.zeros(len(distance))

    def update(self, t: Array, distance: Array) -> None:
        """Take in distances (n, N) m from the goals at filter steps t (n,)."""
        for v in np.flatnonzero(distance.min(axis=0, initial=np.inf) <= self._next):
            near, k = distance[:, v], 0
            while (hits := np.flatnonzero(near[k:] <= self._next[v])).size:
                k += int(hits[0])
                self._stop(int(v), float(t[k]))
                there = near[k] <= self._quantum
                self._next[v] = -np.inf if there else max(near[k] - self._quantum, self._quantum)
                self._since[v] = np.inf if there else t[k]

    def _stop(self, v: int, t: float) -> None:
        if t - self._since[v] > self._longest[v]:
            self._longest[v], self._begin[v] = t - self._since[v], self._since[v]

    @property
    def arrived(self) -> NDArray[np.bool_]:
        """(N,) who has been within `quantum` of its goal."""
        return np.isinf(self._since)

    def waits(self, end: float) -> tuple[Array, Array]:
        """The longest wait (N,) s of each vehicle in a run that ends at `end` [s], and when it began."""
        last = np.where(np.isfinite(self._since), end - self._since, -np.inf)
        later = last > self._longest
        return np.where(later, last, self._longest), np.where(later, self._since, self._begin)


def seeking(s: Scenario) -> NDArray[np.bool_]:
    """(N,) whether each vehicle has a goal to come to; an intruder's is its own affair."""
    due = guidance_rules.seeking(s)
    due[list(fleet.intruders(s))] = False
    return due


def progress_of(s: Scenario, start: Array, goal: Array) -> Progress | None:
    """From `start` to `goal`, (N, 3) m; None in a run too short to tell waiting from flying.

    The patience is the time that the longest straight way takes at the vehicle's least speed.
    """
    straight = np.linalg.norm(goal - start, axis=-1)
    least = np.array([box.v_min_mps for box in fleet.limits(s)])
    due = seeking(s)
    patience = float((straight / least)[due].max(initial=0.0))
    if not due.any() or patience >= s.duration_s:
        return None
    return Progress(straight, s.goal_radius_m, patience)
