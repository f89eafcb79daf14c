"""What must not be missed between recordings: extremes and counts kept at every step of a run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from filters.unicycle import Array


@dataclass
class Extreme:
    """The smallest value seen of each of several quantities, and when it was seen first."""

    value: Array
    t: Array

    @classmethod
    def of(cls, size: int) -> Extreme:
        return cls(np.full(size, np.inf), np.full(size, np.nan))

    def update(self, t: Array | float, value: Array) -> None:
        """Take in `value` (..., size) at times `t` (...)."""
        low = value if value.ndim == 1 else value.min(axis=0)
        better = low < self.value
        if not better.any():
            return
        when = t if value.ndim == 1 else np.asarray(t)[np.argmin(value, axis=0)]
        self.value = np.where(better, low, self.value)
        self.t = np.where(better, when, self.t)

    def worst(self) -> tuple[int, float, float]:
        """Index, value and time of the smallest of all; (-1, nan, nan) if nothing was seen."""
        if not self.value.size or not np.isfinite(self.value).any():
            return -1, float("nan"), float("nan")
        k = int(np.argmin(self.value))
        return k, float(self.value[k]), float(self.t[k])


@dataclass
class Tally:
    """Extremes over a whole run, at the rate each quantity is made.

    separation      per pair, m, at every FDM step
    h               per pair, the unmodified barrier at the true state, at every filter step
    admissible      per pair, the most that hdot + alpha(h) can be made by inputs in U, where h >= 0
    command_margin  per vehicle, distance of the command inside its limits as a share of their range
    goal            per vehicle, m, closest approach to its goal at every FDM step
    passed          per vehicle, s, when it first came within the goal radius; nan if never
    """

    vehicles: int
    separation: Extreme = field(init=False)
    h: Extreme = field(init=False)
    admissible: Extreme = field(init=False)
    command_margin: Extreme = field(init=False)
    goal: Extreme = field(init=False)
    passed: Array = field(init=False)
    filter_steps: int = 0
    qp_failures: dict[str, int] = field(default_factory=dict)
    first_failure: tuple[float, int, str] | None = None
    worst_residual: float = 0.0
    override_steps: Array = field(init=False)

    def __post_init__(self) -> None:
        pairs = self.vehicles * (self.vehicles - 1) // 2
        self.separation, self.h, self.admissible = (Extreme.of(pairs) for _ in range(3))
        self.command_margin, self.goal = Extreme.of(self.vehicles), Extreme.of(self.vehicles)
        self.passed = np.full(self.vehicles, np.nan)
        self.override_steps = np.zeros(self.vehicles, dtype=int)

    def positions(self, t: Array, track: Array, goal: Array, goal_radius: float, i: Array, j: Array) -> None:
        """Take in positions `track` (n, N, 3) at times `t` (n,), for the pairs `i`, `j`."""
        if i.size:
            self.separation.update(t, np.linalg.norm(track[:, i] - track[:, j], axis=-1))
        distance = np.linalg.norm(track - goal, axis=-1)
        self.goal.update(t, distance)
        inside = distance <= goal_radius
        arrived = inside.any(axis=0) & np.isnan(self.passed)
        self.passed = np.where(arrived, t[np.argmax(inside, axis=0)], self.passed)
