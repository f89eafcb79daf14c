"""Flies the lagging vehicles on under plans: some commands in turn, each for a while, then gamma for ever.

What the rivals with a backup share: what is known of the vehicles (`Model`), the flow of plans, and how near
vehicles come on them. The channels are those of `filters.flow`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from filters.constraints import Indices
from filters.flow.belief import Belief
from filters.flow.channels import Channels, Lag
from filters.flow.rollout import Begun, Flow, Paths
from filters.model import Array, Command, View


class Model:
    """What a rival knows of N lagging vehicles: their channels, their rates, the commands on their way.

    lags     (v, omega, zeta) of every vehicle: one triple for all, or N
    gamma    (N,) the backup manoeuvre; one turn rate for all, not zero
    d_safe   m, Ds
    dt       s, the filter's period
    margin   m, what plans keep beyond Ds
    trust    share of the difference between measured and modelled rates that is believed in a period
    Raises   ValueError for numbers out of these ranges
    """

    def __init__(
        self,
        lags: Sequence[Sequence[Lag]],
        gamma: Command,
        d_safe: float,
        dt: float,
        margin: float = 0.0,
        trust: float = 0.1,
    ) -> None:
        if not (np.isfinite(margin) and margin >= 0):
            raise ValueError(f"the margin must be finite and not negative, got {margin} m")
        self.flow = Flow(Channels.of(lags, len(gamma)), gamma.array(), dt)
        self.level = d_safe + margin
        self._belief = Belief(self.flow, trust)
        self._pairs = np.triu_indices(len(gamma), 1)

    def begin(self, view: View, ahead: float, lower: Array, upper: Array) -> Begun:
        """What is certain now, at instants until plans that last `ahead` s, more than a period, are flown.

        lower, upper  (N, 3) the ends of the box
        Raises  ValueError if what is seen is not finite
        """
        own, flow = view.own(), self.flow
        rates = own.rates.array()
        if not (own.state.isfinite().all() and np.isfinite(rates).all()):
            raise ValueError("plans need finite poses and rates")
        self._belief.see(rates)
        rates = self._belief.rates
        times = flow.times(rates)
        if ahead > flow.dt:
            # By the end of a plan the channels may be at any end of the box.
            furthest = np.where(upper - flow.gamma > flow.gamma - lower, upper, lower)
            last = max(times.size, flow.times(furthest).size) + int(np.ceil(ahead / flow.dt))
            times = flow.dt * np.arange(1.0, last + 1)
        return flow.begin(own.state, rates, self._belief.queued, times)

    def told(self, u: Array) -> None:
        """Inputs (N, 3) commanded for the period that begins now."""
        self._belief.told(u)

    def seen(self, view: View) -> tuple[Indices, Indices]:
        """The pairs (i, j), i < j, that know of each other."""
        i, j = self._pairs
        known = view.known
        if known is None:
            return i, j
        both = known[i] & known[j] if known.ndim == 1 else known[i, j] & known[j, i]
        return i[both], j[both]


def covered(begun: Begun, plan: Array, lasts: Array) -> Array:
    """Integrals (..., N, 3, M) of the channels when the commands of plans are flown in turn, then gamma.

    plan   (..., N, K, 3) the commands
    lasts  (..., N, K) s, how long each is commanded, 0 or more
    """
    channels, times = begun.channels, begun.times
    shape = (*np.broadcast_shapes(plan.shape[:-2], lasts.shape[:-1]), 3)
    y, began = np.broadcast_to(begun.rates, shape), np.broadcast_to(channels.delay, shape)
    total = np.broadcast_to(begun.covered, (*shape, times.size)).copy()
    for k in range(plan.shape[-2]):
        long = np.broadcast_to(lasts[..., k, None], shape)
        told = channels.towards(y, np.broadcast_to(plan[..., k, :], shape))
        # Only at these instants a channel may be in the midst of it.
        first, last = np.searchsorted(times, [began.min(), (began + long).max()])
        since = np.minimum(np.maximum(times[first:last] - began[..., None], 0.0), long[..., None])
        total[..., first:last] += told.integral(since)
        total[..., last:] += told.integral(long[..., None])
        y, began = told.value(long), began + long
    evading = channels.towards(y, np.broadcast_to(begun.gamma, shape))
    first = np.searchsorted(times, began.min())
    total[..., first:] += evading.integral(np.maximum(times[first:] - began[..., None], 0.0))
    return total


@dataclass(frozen=True, eq=False)
class Tracks:
    """Paths of N vehicles without leading axes, and how far (N,) m each is from its centre at most, level."""

    paths: Paths
    reach: Array

    @classmethod
    def of(cls, paths: Paths) -> Tracks:
        off = np.abs(paths.at - paths.centre[..., None]).max(axis=-1, initial=0.0)
        return cls(paths, np.maximum(off, np.abs(paths.arm)))

    def put(self, vehicle: int, other: Tracks, which: int) -> None:
        """Replace the path of `vehicle` by the path `which` of `other`, at the same instants."""
        for name in ("at", "z", "centre", "arm"):
            getattr(self.paths, name)[vehicle] = getattr(other.paths, name)[which]
        self.reach[vehicle] = other.reach[which]


def nearest(a: Tracks, i: Indices, b: Tracks, j: Indices, enough: float) -> Array:
    """The least distances (P,) m of the paths i of `a` from the paths j of `b`, for all time.

    Both are at the same instants. Of pairs that never come nearer than `enough` [m] it is a lower bound,
    and at least `enough`.
    """
    p, q = a.paths, b.paths
    apart = np.abs(p.centre[i] - q.centre[j])
    least = apart - a.reach[i] - b.reach[j]
    near = np.flatnonzero(least < enough)
    if near.size:
        i, j, apart = i[near], j[near], apart[near]
        level, up = p.at[i] - q.at[j], p.z[i] - q.z[j]
        square = (level.real**2 + level.imag**2 + up**2).min(axis=-1)
        # Once all fly gamma the line between two vehicles is that between the centres and an arm that turns.
        circle = (apart - np.abs(p.arm[i] - q.arm[j])) ** 2 + up[:, -1] ** 2
        least[near] = np.sqrt(np.minimum(square, circle))
    return np.asarray(least)
