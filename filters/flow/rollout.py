"""Rolls the model of lagging vehicles forward: the commands on their way, one more command, then gamma.

All vehicles share gamma's turn rate, so that once the channels have settled each flies a circle, all in step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.flow.channels import Channels, Motion
from filters.model import Array, State

Complex = np.ndarray

# Channels this near to gamma have settled [m/s, rad/s, m/s].
SETTLED = np.array([1e-4, 1e-6, 1e-4])


@dataclass(frozen=True, eq=False)
class Paths:
    """Positions on the flow: at M instants of the transient, then on circles.

    at      (..., N, M) complex m, x + j y at dt, 2 dt, ... M dt
    z       (..., N, M) m
    centre  (..., N) complex m, of the circle flown after M dt
    arm     (..., N) complex m, from the centre to the vehicle at M dt
    """

    at: Complex
    z: Array
    centre: Complex
    arm: Complex

    def __getitem__(self, index: int | slice) -> Paths:
        """The paths at `index` of the first axis."""
        return Paths(self.at[index], self.z[index], self.centre[index], self.arm[index])


@dataclass(frozen=True, eq=False)
class Begun:
    """What is certain whatever is commanded next: states, commands on their way, and what they lead to.

    state    (N,)
    rates    (N, 3) when the next command is heard, each channel after its own delay
    covered  (N, 3, M) integrals of the rates at the instants, up to each channel's delay
    times    (M,) s
    """

    state: State
    rates: Array
    covered: Array
    times: Array


class Flow:
    """The flow of N vehicles: Phi(t; u), for queued commands, then u for one period, then gamma.

    channels  of the vehicles
    gamma     (N, 3) the evading manoeuvre; one turn rate for all, not zero
    dt        s, the filter's period
    Raises    ValueError if the turn rates differ or are zero
    """

    def __init__(self, channels: Channels, gamma: Array, dt: float) -> None:
        turn = gamma[:, 1]
        if not (np.all(turn == turn[0]) and turn[0] != 0):
            raise ValueError(
                f"the manoeuvre needs one turn rate for all, not zero; got {turn.tolist()} rad/s"
            )
        self.channels, self.gamma, self.dt = channels, gamma, dt
        self.depth = int(np.ceil(channels.delay.max() / dt - 1e-9))
        """Commands that may be on their way to a channel at once."""

    def begin(self, state: State, rates: Array, queued: Array, times: Array) -> Begun:
        """Take what is on its way into account.

        rates   (N, 3) now
        queued  (depth, N, 3) commands given, the latest first
        times   (M,) s, multiples of dt from dt on
        """
        y, covered = rates, np.zeros((*rates.shape, times.size))
        for k in range(self.depth - 1, -1, -1):
            begin = np.maximum(self.channels.delay - (k + 1) * self.dt, 0.0)
            long = np.maximum(self.channels.delay - k * self.dt, 0.0) - begin
            motion = self.channels.towards(y, queued[k])
            covered += motion.integral(_within(times, begin, long))
            y = motion.value(long)
        return Begun(state, y, covered, times)

    def times(self, rates: Array) -> Array:
        """Instants dt, 2 dt, ... [s] until all channels have settled on gamma, whatever is on its way.

        rates  (N, 3) now. Commands on their way carry a channel no further off than its largest rate allows.
        """
        c = self.channels
        moved = c.delay + self.dt
        gap = np.abs(rates - self.gamma)
        slowest = np.minimum(c.fall, c.rise)
        bounded = np.maximum(gap / slowest - c.constant, 0.0)
        left = np.minimum(gap, slowest * c.constant)
        settled = bounded + c.constant * np.log(np.maximum(left / SETTLED, 1.0))
        longest = float(np.max(2 * moved + settled))
        return np.asarray(self.dt * np.arange(1.0, np.ceil(longest / self.dt) + 1))

    def roll(self, begun: Begun, u: Array) -> Paths:
        """The paths when u (..., N, 3) is commanded for one period, then gamma."""
        delay, dt, times = self.channels.delay, self.dt, begun.times
        told = self.channels.towards(np.broadcast_to(begun.rates, u.shape), u)
        # u is heard for one period: only one of the instants lies inside it.
        inside = np.floor(delay / dt + 1e-9)[..., None] + 1.0
        two = told.integral(np.stack([inside[..., 0] * dt - delay, np.full(delay.shape, dt)], axis=-1))
        index = np.round(times / dt)
        part = (index == inside) * two[..., :1]
        part += (index > inside) * two[..., 1:]
        covered = begun.covered + part
        long = np.full(u.shape, dt)
        evading: Motion = self.channels.towards(told.value(long), np.broadcast_to(self.gamma, u.shape))
        covered += evading.integral(np.maximum(times - (delay + dt)[..., None], 0.0))
        far, turned, climbed = covered[..., 0, :], covered[..., 1, :], covered[..., 2, :]
        theta = begun.state.theta[:, None] + turned
        before = np.concatenate(
            [np.broadcast_to(begun.state.theta[:, None], theta[..., :1].shape), theta[..., :-1]], -1
        )
        way = np.diff(far, axis=-1, prepend=0.0)
        half = 0.5 * (theta - before)
        chord = way * np.sinc(half / np.pi) * np.exp(1j * (before + half))
        start = (begun.state.x + 1j * begun.state.y)[:, None]
        at = start + np.cumsum(chord, axis=-1)
        radius = self.gamma[:, 0] / self.gamma[:, 1]
        arm = -1j * radius * np.exp(1j * theta[..., -1])
        return Paths(at, begun.state.z[:, None] + climbed, at[..., -1] - arm, arm)


def _within(times: Array, begin: Array, long: Array) -> Array:
    """How much (..., M) of an interval has passed at each time."""
    return np.minimum(np.maximum(times - begin[..., None], 0.0), long[..., None])
