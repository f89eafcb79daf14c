"""What must not be missed between recordings: extremes and counts kept at every step of a run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from filters.barrier import PairValues
from filters.collision import Decision
from filters.qp import Status
from filters.unicycle import Array, Command, Limits
from testbed.approach import Approach
from testbed.saturation import Saturation

# |h| [m] below which a pair stands at the boundary of the safe set.
BOUNDARY_M = 0.05


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

    Per pair (P,):
    separation  m, at every FDM step
    between     m, closest approach of the paths, straight between FDM steps
    h           the unmodified barrier at the true state, at every filter step
    admissible  the most that hdot + alpha(h) can be made by inputs in U, where h >= 0
    condition   hdot + alpha(h) along the motion that followed, over each filter period
    rows        L_g h u + alpha(h) of the filter's own rows under its commands, where its QPs were solved
    gradient    |L_g h| at the boundary of the safe set
    kink        filter steps' worth of motion between the state and the barrier's kink, for binding pairs

    Per vehicle (N,):
    command_margin  distance of the command inside its limits as a share of their range
    goal            m, closest approach to its goal at every FDM step
    passed          s, when it first came within the goal radius; nan if never
    path            m, flown until then, or in all
    altered         (N, 3) integral of |u - clip(u_hat)|: m, rad, m
    lowest, highest (N, 3) achieved rates

    saturation  surfaces and throttle at their stops
    approach    where pairs drew nearest, if anybody asks
    """

    vehicles: int
    saturation: Saturation = field(default_factory=Saturation)
    approach: Approach | None = None
    separation: Extreme = field(init=False)
    between: Extreme = field(init=False)
    h: Extreme = field(init=False)
    admissible: Extreme = field(init=False)
    condition: Extreme = field(init=False)
    rows: Extreme = field(init=False)
    gradient: Extreme = field(init=False)
    kink: Extreme = field(init=False)
    command_margin: Extreme = field(init=False)
    goal: Extreme = field(init=False)
    passed: Array = field(init=False)
    path: Array = field(init=False)
    altered: Array = field(init=False)
    lowest: Array = field(init=False)
    highest: Array = field(init=False)
    override_steps: Array = field(init=False)
    filter_steps: int = 0
    solves: bool = False  # whether any QP stood above any vehicle
    qp_failures: dict[str, int] = field(default_factory=dict)
    failures_inside: int = 0
    first_failure: tuple[float, int, str] | None = None
    worst_residual: float = 0.0

    def __post_init__(self) -> None:
        n, pairs = self.vehicles, self.vehicles * (self.vehicles - 1) // 2
        for name in ("separation", "between", "h", "admissible", "condition", "rows", "gradient", "kink"):
            setattr(self, name, Extreme.of(pairs))
        self.command_margin, self.goal = Extreme.of(n), Extreme.of(n)
        self.passed, self.path, self.altered = np.full(n, np.nan), np.zeros(n), np.zeros((n, 3))
        self.lowest, self.highest = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
        self.override_steps = np.zeros(n, dtype=int)
        self._last: Array | None = None
        self._amplitude: Array | None = None

    @property
    def without_qp(self) -> bool:
        """Whether decisions were seen, and no QP stood behind any of them."""
        return self.filter_steps > 0 and not self.solves

    def positions(self, t: Array, track: Array, goal: Array, goal_radius: float, i: Array, j: Array) -> None:
        """Take in positions `track` (n, N, 3) at times `t` (n,), for the pairs `i`, `j`."""
        whole = track if self._last is None else np.concatenate([self._last[None], track])
        if i.size:
            offset = whole[:, i] - whole[:, j]
            first = len(whole) - len(track)
            self.separation.update(t, np.sqrt(np.sum(offset[first:] ** 2, axis=-1)))
            if len(whole) > 1:
                self.between.update(t[-(len(whole) - 1) :], _closest(offset))
        distance = np.sqrt(np.sum((track - goal) ** 2, axis=-1))
        self.goal.update(t, distance)
        flying = np.isnan(self.passed)
        if len(whole) > 1:
            flown = np.sqrt(np.sum(np.diff(whole, axis=0) ** 2, axis=-1)).sum(axis=0)
            self.path += np.where(flying, flown, 0.0)
        inside = distance <= goal_radius
        arrived = inside.any(axis=0) & flying
        self.passed = np.where(arrived, t[np.argmax(inside, axis=0)], self.passed)
        self._last = track[-1]

    def decided(
        self, t: float, dt: float, decision: Decision, wanted: Command, rates: Command, limits: Limits
    ) -> None:
        """Take in what the filter chose at `t`, the nominal input, and the rates achieved until then."""
        self.filter_steps += 1
        self.solves = self.solves or bool(np.any(decision.status != Status.NONE))
        c, low, high = decision.command.array(), limits.lower.array(), limits.upper.array()
        span = np.where(high > low, high - low, 1.0)
        self.command_margin.update(t, (np.minimum(c - low, high - c) / span).min(axis=-1))
        self.altered += np.abs(c - np.clip(wanted.array(), low, high)) * dt
        achieved = rates.array()
        self.lowest, self.highest = np.minimum(self.lowest, achieved), np.maximum(self.highest, achieved)
        self.override_steps += decision.override
        self.worst_residual = max(self.worst_residual, float(decision.residual.max(initial=0.0)))

    def failed(self, t: float, decision: Decision, inside: bool) -> None:
        """Count vehicles whose QP had no solution; `inside` if every pair was in the safe set."""
        bad = (decision.status == Status.INFEASIBLE) | (decision.status == Status.ITERATION_LIMIT)
        if not bad.any():
            return
        for vehicle in np.flatnonzero(bad):
            name = Status(int(decision.status[vehicle])).name.lower()
            self.qp_failures[name] = self.qp_failures.get(name, 0) + 1
            self.failures_inside += inside
            if self.first_failure is None:
                self.first_failure = (t, int(vehicle), name)

    def barrier(
        self, t: float, true: PairValues, lie: tuple[Array, Array], alpha: Array, limits: Limits
    ) -> None:
        """Take in the unmodified barrier at the true state: h, L_g h (P, 3) each, alpha(h) (P,)."""
        self.h.update(t, true.h)
        if self.approach is not None:
            self.approach.update(t, true.h)
        low, high = limits.lower.array(), limits.upper.array()
        best, least = alpha.copy(), alpha.copy()
        for side, vehicle in zip(lie, (true.i, true.j), strict=True):
            a, b = side * low[vehicle], side * high[vehicle]
            best += np.maximum(a, b).sum(axis=-1)
            least += np.minimum(a, b).sum(axis=-1)
        # sup over U of hdot + alpha(h), eq. (3), for pairs in their safe set
        self.admissible.update(t, np.where(true.h >= 0.0, best, np.inf))
        self._binding = least < 0.0
        edge = np.abs(true.h) <= BOUNDARY_M
        if edge.any():
            size = np.sqrt((lie[0] ** 2).sum(axis=-1) + (lie[1] ** 2).sum(axis=-1))
            self.gradient.update(t, np.where(edge, size, np.inf))

    def phasor(self, t: float, z: Array) -> None:
        """Take in the turn barrier's phasor Z (P,) complex [m^2]; call after `barrier`."""
        if self._amplitude is not None and self._binding.any():
            moved = np.abs(z - self._amplitude)
            self.kink.update(t, np.where(self._binding, np.abs(z) / np.maximum(moved, 1e-12), np.inf))
        self._amplitude = z


def _closest(offset: Array) -> Array:
    """Least distance (n - 1, P) between straight paths whose offsets at n instants are `offset` (n, P, 3)."""
    a, move = offset[:-1], np.diff(offset, axis=0)
    length = (move**2).sum(axis=-1)
    share = -(a * move).sum(axis=-1) / np.where(length > 0.0, length, 1.0)
    nearest = a + np.clip(share, 0.0, 1.0)[..., None] * move
    return np.asarray(np.sqrt((nearest**2).sum(axis=-1)))
