"""Extremes and counts over every step of a run, recorded or not."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import all_pairs
from filters.model import Array, Command, Limits, State
from filters.qp.single import Status
from testbed.measures.between_samples import ArcApproach, Bends
from testbed.measures.chords import closest, square
from testbed.measures.declared_barrier import DeclaredBarrier
from testbed.measures.declared_rows import DeclaredRows
from testbed.measures.extreme import Extreme
from testbed.measures.fence_statistics import FenceStatistics
from testbed.measures.near_misses import NearMisses
from testbed.measures.progress import Progress
from testbed.measures.roles import Roles
from testbed.measures.saturation import Saturation
from testbed.measures.track_error import TrackErrors

# |h| [m] below which a pair stands at the boundary of the safe set.
BOUNDARY_M = 0.05


@dataclass
class RunStatistics:
    """Extremes and counts over a whole run, at the rate at which each quantity is computed.

    Per pair (P,):
    separation  m, at every FDM step
    between     m, closest approach of the paths, straight between FDM steps
    h           the unmodified barrier at the true state, at every filter step
    admissible  the most that hdot + alpha(h) can be made by inputs in U, where h >= 0
    condition   hdot + alpha(h) along the motion that followed, over each filter period (G3)
    rows        L_g h u + alpha(h) of the filter's own rows under its commands, where its QPs were solved
    true_rows   L_g h u + alpha(h) of the scenario's barrier at the true states, of a foreign filter
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
    near_misses where pairs came nearest, if that is wanted
    foreign     whether the filter is a user's own
    declared    the rows that such a filter declares; None if it declares none
    own         the barrier that such a filter declares; None if it declares none
    arcs        closest approaches of unicycles, whose motion between samples is known; else None
    fences      how near vehicles came to their fences; None without fences
    bends       how paths bend between samples
    roles       who is under the filter; None without intruders
    progress    how long vehicles wait on the way to their goals; None where the run is too short to tell
    tracks      distances from recorded tracks that vehicles follow; None where none follows one

    Vehicles that have left (`gone`, (S, N) bool at filter steps; None if none can) are not judged from that
    step on. h of their pairs is given as inf.
    """

    vehicles: int
    saturation: Saturation = field(default_factory=Saturation)
    near_misses: NearMisses | None = None
    foreign: bool = False
    declared: DeclaredRows | None = None
    own: DeclaredBarrier | None = None
    arcs: ArcApproach | None = None
    fences: FenceStatistics | None = None
    roles: Roles | None = None
    tracks: TrackErrors | None = None
    progress: Progress | None = None
    bends: Bends = field(init=False)
    separation: Extreme = field(init=False)
    between: Extreme = field(init=False)
    h: Extreme = field(init=False)
    admissible: Extreme = field(init=False)
    condition: Extreme = field(init=False)
    rows: Extreme = field(init=False)
    true_rows: Extreme = field(init=False)
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
    solves: bool = False  # whether any QP was solved for any vehicle
    qp_failures: dict[str, int] = field(default_factory=dict)
    failures_inside: int = 0
    first_failure: tuple[float, int, str] | None = None
    worst_residual: float = 0.0
    last_s: float = 0.0  # of the positions taken in

    def __post_init__(self) -> None:
        n, pairs = self.vehicles, self.vehicles * (self.vehicles - 1) // 2
        for name in ("separation", "between", "h", "admissible", "condition", "gradient", "kink"):
            setattr(self, name, Extreme.of(pairs))
        self.rows, self.true_rows = Extreme.of(pairs), Extreme.of(pairs)
        self.command_margin, self.goal = Extreme.of(n), Extreme.of(n)
        self.bends = Bends(n)
        self.passed, self.path, self.altered = np.full(n, np.nan), np.zeros(n), np.zeros((n, 3))
        self.lowest, self.highest = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
        self.override_steps = np.zeros(n, dtype=int)
        self._i, self._j = all_pairs(n)
        self._at: NDArray[np.intp] | None = None  # which of all pairs those are; None: all
        self._last: Array | None = None
        self._amplitude: Array | None = None

    @property
    def without_qp(self) -> bool:
        """Whether there were decisions, and no QP was solved for any of them."""
        return self.filter_steps > 0 and not self.solves

    def take(self, i: NDArray[np.intp], j: NDArray[np.intp]) -> None:
        """Look at the pairs (i, j) from now on, instead of all: the others have no least value."""
        self._i, self._j = i, j
        self._at = (i * (2 * self.vehicles - i - 1)) // 2 + j - i - 1
        if self.arcs is not None:
            self.arcs.take(i, j, self._at)

    def start(self, position: Array, goal: Array, goal_radius: float) -> None:
        """Begin at `position` (N, 3) m; vehicles want to come within `goal_radius` [m] of `goal` (N, 3) m."""
        self._goal, self._goal_radius = goal, goal_radius
        self._last = None
        self.positions(np.zeros(1), position[None], 1)

    def positions(
        self,
        t: Array,
        track: Array,
        periods: int,
        motion: tuple[State, Command] | None = None,
        gone: NDArray[np.bool_] | None = None,
    ) -> None:
        """Take in positions `track` (n, N, 3) at times `t` (n,), `periods` of them to a filter period.

        gone    who has left at the begin of each of those periods
        motion  poses at the begin and rates of those filter periods, (S, N), of unicycles: see `arcs`
        """
        away = None if gone is None else np.repeat(gone, periods, axis=0)
        apart = None if away is None else away[:, self._i] | away[:, self._j]
        whole = track if self._last is None else np.concatenate([self._last[None], track])
        if self._i.size:
            # Entries first: numpy sums over a last axis of 3 slowly.
            places = np.ascontiguousarray(whole.transpose(2, 0, 1))
            offset = places.take(self._i, axis=-1) - places.take(self._j, axis=-1)
            self.see(self.separation, t, _without(apart, np.sqrt(square(offset[:, -len(track) :]))))
            if len(whole) > 1:
                chords, ends = _without(apart, closest(offset)), t[-(len(whole) - 1) :]
                self.between.update(ends, chords, self._at)
                self.bends.update(places, periods)
                if self.arcs is not None and motion is not None:
                    fdm_dt = (ends[-1] - ends[0]) / (len(ends) - 1) if len(ends) > 1 else float(ends[0])
                    begin = ends[periods - 1 :: periods] - periods * fdm_dt
                    by_period = chords.reshape(-1, periods, self._i.size)
                    self.arcs.update(begin, *motion, by_period, fdm_dt)
        distance = _without(away, np.sqrt(square((track - self._goal).transpose(2, 0, 1))))
        self.goal.update(t, distance)
        self.last_s = float(t[-1])
        if self.progress is not None:
            self.progress.update(t[periods - 1 :: periods], distance[periods - 1 :: periods])
        inside = distance <= self._goal_radius
        flying = np.isnan(self.passed)
        if len(whole) > 1:
            # The period in which the vehicle arrives still counts; those after it do not.
            flown = np.sqrt(square(np.diff(whole, axis=0).transpose(2, 0, 1)))
            by_period = flown.reshape(-1, periods, self.vehicles).sum(axis=1)
            arrives = inside.reshape(-1, periods, self.vehicles).any(axis=1)
            by_period[1:][np.logical_or.accumulate(arrives)[:-1]] = 0.0
            self.path += np.where(flying, by_period.sum(axis=0), 0.0)
        arrived = inside.any(axis=0) & flying
        self.passed = np.where(arrived, t[np.argmax(inside, axis=0)], self.passed)
        self._last = track[-1].copy()

    def refused(self, t: float, command: Array, limits: Limits) -> None:
        """Take in a command (N, 3) at t [s] with NaN in it, which no plant was given."""
        low, high = limits.corners
        self.command_margin.update(t, np.minimum(command - low, high - command).min(axis=-1))

    def least_distances(self) -> tuple[Array, Extreme]:
        """Lower bounds of the distances (P,) m, and distances reached (P,), between samples as well.

        The motion of unicycles is known. For others both rest on the largest acceleration seen.
        """
        if self.arcs is not None:
            nearer = self.arcs.least.value < self.separation.value
            value = np.where(nearer, self.arcs.least.value, self.separation.value)
            when = np.where(nearer, self.arcs.least.t, self.separation.t)
            return np.minimum(self.arcs.possible, self.separation.value), Extreme(value, when)
        radius = self.bends.radius(*all_pairs(self.vehicles))
        nearer = self.between.value + radius < self.separation.value
        value = np.where(nearer, self.between.value + radius, self.separation.value)
        when = np.where(nearer, self.between.t, self.separation.t)
        # Without a bound of the bends there is none of the distance.
        low = np.minimum(self.between.value, self.separation.value)
        return np.where(np.isfinite(radius), low, 0.0) - radius, Extreme(value, when)

    def decided(
        self,
        t: Array,
        dt: float,
        command: Array,
        wanted: Array,
        rates: Array,
        override: Array,
        limits: Limits,
        gone: NDArray[np.bool_] | None = None,
    ) -> None:
        """Take in what was commanded at `t` (S,), what was wanted, and the rates achieved until then.

        command, wanted, rates  (S, N, 3); override  (S, N)
        """
        self.filter_steps += len(t)
        low, high = limits.corners
        span = np.where(high > low, high - low, 1.0)
        margin = (np.minimum(command - low, high - command) / span).min(axis=-1)
        self.command_margin.update(t, _without(gone, margin))
        clipped = np.minimum(np.maximum(wanted, low), high)
        changed = np.abs(command - clipped) * dt
        slowest = fastest = rates
        if gone is not None:
            changed = np.where(gone[..., None], 0.0, changed)
            slowest, fastest = (np.where(gone[..., None], x, rates) for x in (np.inf, -np.inf))
        self.altered += changed.sum(axis=0)
        self.lowest = np.minimum(self.lowest, slowest.min(axis=0))
        self.highest = np.maximum(self.highest, fastest.max(axis=0))
        self.override_steps += override.sum(axis=0)

    def see(self, which: Extreme, t: Array, value: Array) -> None:
        """Take in `value` (S, P) at `t` (S,) for one of the extremes of pairs."""
        which.update(t, value, self._at)

    def solved(self, t: Array, status: NDArray[np.int_], residual: Array, inside: NDArray[np.bool_]) -> None:
        """Take in how the QPs at `t` (S,) ended, and count vehicles whose QP had no solution.

        status, residual  (S, N); inside  (S,) whether every pair was in the safe set
        """
        self.solves = self.solves or bool(np.any(status != Status.NONE))
        self.worst_residual = float(np.maximum(self.worst_residual, residual.max(initial=0.0)))
        bad = (status == Status.INFEASIBLE) | (status == Status.ITERATION_LIMIT)
        for step, vehicle in np.argwhere(bad).tolist():
            name = Status(int(status[step, vehicle])).name.lower()
            self.qp_failures[name] = self.qp_failures.get(name, 0) + 1
            self.failures_inside += bool(inside[step])
            if self.first_failure is None:
                self.first_failure = (float(t[step]), vehicle, name)

    def barrier(self, t: Array, h: Array, lie: Array, alpha: Array, limits: Limits) -> None:
        """Take in the unmodified barrier at the true states at `t` (S,): h and alpha(h), (S, P).

        lie  L_g h by vehicle i or j, and by v, omega and zeta, (2, 3, S, P)
        """
        self.h.update(t, h, self._at)
        if self.near_misses is not None:
            near = h if self.roles is None else np.where(self.roles.ours, h, np.inf)
            for at, now in zip(t.tolist(), near, strict=True):
                self.near_misses.update(at, now.copy())
        best, least = alpha.copy(), alpha.copy()
        for side, vehicle in zip(lie, (self._i, self._j), strict=True):
            low, high = (corner[vehicle].T[:, None] for corner in limits.corners)
            a, b = side * low, side * high
            best += np.maximum(a, b).sum(axis=0)
            least += np.minimum(a, b).sum(axis=0)
        # sup over U of hdot + alpha(h), eq. (3), for pairs in their safe set
        self.admissible.update(t, np.where(h < 0.0, np.inf, best), self._at)
        self._binding = ~(least >= 0.0)
        edge = ~(np.abs(h) > BOUNDARY_M)
        if edge.any():
            self.see(self.gradient, t, np.where(edge, np.sqrt(square(lie[0]) + square(lie[1])), np.inf))

    def phasor(self, t: Array, z: Array, before: Array | None = None) -> None:
        """Take in the turn barrier's phasor Z (S, P) complex [m^2]; call after `barrier`.

        before  (P,) what it was a step before; None: as last taken in
        """
        self._amplitude = self._amplitude if before is None else before
        before = z[:1] if self._amplitude is None else self._amplitude[None]
        moved = np.abs(z - np.concatenate([before, z[:-1]]))
        binding = self._binding
        if self._amplitude is None:
            binding[0] = False
        if binding.any():
            self.see(self.kink, t, np.where(binding, np.abs(z) / np.maximum(moved, 1e-12), np.inf))
        self._amplitude = z[-1]


def _without(gone: NDArray[np.bool_] | None, values: Array) -> Array:
    """The values with inf for what has left: it is not judged."""
    return values if gone is None else np.where(gone, np.inf, values)
