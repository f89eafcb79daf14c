"""Decides who has left: who has come within the goal radius, where vehicles leave on arrival."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.model import Array, State, View
from testbed.scenario import guidance_rules
from testbed.scenario.scenario import Scenario

Mask = NDArray[np.bool_]


class Leaving:
    """Who has left (N,), and when.

    A vehicle has left from the filter step on at which its true place is within the goal radius of its goal.
    One without a goal never leaves.
    """

    def __init__(self, s: Scenario, goal: Array) -> None:
        self._goal, self._radius = goal, s.goal_radius_m
        self._seeks = guidance_rules.seeking(s)
        self.gone: Mask = np.zeros(s.vehicles, dtype=bool)
        self.left_s: Array = np.full(s.vehicles, np.nan)

    def look(self, t: float, truth: State) -> None:
        """Take in the true state (N,) at the filter step of time t [s]."""
        there = np.linalg.norm(truth.position - self._goal, axis=-1) <= self._radius
        now = there & self._seeks & ~self.gone
        if now.any():
            self.gone = self.gone | now
            self.left_s = np.where(now, t, self.left_s)

    def unseen(self, view: View) -> View:
        """The view in which nobody knows of who has left, and they of nobody."""
        if not self.gone.any():
            return view
        here = ~self.gone
        if view.known is None:
            return View(view.state, view.rates, here, view.age)
        both = here if view.known.ndim == 1 else here[:, None] & here
        return View(view.state, view.rates, view.known & both, view.age)

    def well(self, faults: list[str]) -> list[str]:
        """The faults without those of who has left: they end nothing any more."""
        return ["" if gone else fault for gone, fault in zip(self.gone, faults, strict=True)]

    def summary(self) -> list[float | None]:
        """When each vehicle left [s]; None if it did not."""
        return [float(t) if np.isfinite(t) else None for t in self.left_s]


def leaving(s: Scenario, goal: Array) -> Leaving | None:
    """For goals (N, 3) m; None where vehicles do not leave on arrival."""
    return Leaving(s, goal) if s.goal.on_arrival == "leave" else None
