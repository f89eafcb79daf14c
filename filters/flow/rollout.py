"""Rolls the model of lagging vehicles forward: the commands on their way, one more command, then gamma.

All vehicles share gamma's turn rate, so that once the channels have settled each flies a circle, all in step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.constraints import Indices
from filters.flow.channels import Channels
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

    state     (N,)
    rates     (N, 3) when the next command is heard, each channel after its own delay
    covered   (N, 3, M) integrals of the rates at the instants, up to each channel's delay
    times     (M,) s
    channels  of the vehicles
    gamma     (N, 3) flown after the next command
    """

    state: State
    rates: Array
    covered: Array
    times: Array
    channels: Channels
    gamma: Array

    def of(self, vehicles: Indices) -> Begun:
        """The same of some vehicles alone."""
        state, v = self.state, vehicles
        some = State(state.x[v], state.y[v], state.theta[v], state.z[v])
        return Begun(
            some, self.rates[v], self.covered[v], self.times, self.channels.of_some(v), self.gamma[v]
        )


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
        y, few = rates, max(self.depth, 1)
        # After `depth` periods all of it has been heard.
        early = times[:few]
        covered = np.zeros((*rates.shape, early.size))
        for k in range(self.depth - 1, -1, -1):
            begin = np.maximum(self.channels.delay - (k + 1) * self.dt, 0.0)
            long = np.maximum(self.channels.delay - k * self.dt, 0.0) - begin
            motion = self.channels.towards(y, queued[k])
            covered += motion.integral(_within(early, begin, long))
            y = motion.value(long)
        covered = np.concatenate([covered, np.repeat(covered[..., -1:], times.size - early.size, -1)], -1)
        return Begun(state, y, covered, times, self.channels, self.gamma)

    def after(self, rates: Array, queued: Array) -> Array:
        """The rates (N, 3) one period after `rates`, with the commands (K, N, 3) given, the latest first.

        K is the depth and one more, or the longest that there is.
        """
        delay = self.channels.delay
        back = np.floor(delay / self.dt + 1e-9).astype(int)
        until = np.maximum(delay - back * self.dt, 0.0)

        def heard(k: Indices) -> Array:
            return np.asarray(np.take_along_axis(queued, np.minimum(k, len(queued) - 1)[None], axis=0)[0])

        changing = self.channels.towards(rates, heard(back + 1)).value(until)
        return self.channels.towards(changing, heard(back)).value(self.dt - until)

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
        return self.paths(begun, self.covered(begun, u))

    def covered(self, begun: Begun, u: Array) -> Array:
        """Integrals (..., N, 3, M) of the channels when u (..., N, 3) is commanded, then gamma."""
        channels, times, dt = begun.channels, begun.times, self.dt
        delay = channels.delay
        told = channels.towards(np.broadcast_to(begun.rates, u.shape), u)
        # u is heard for one period: only one of the instants lies inside it.
        inside = np.floor(delay / dt + 1e-9) + 1.0
        two = told.integral(np.stack([inside * dt - delay, np.full(delay.shape, dt)], axis=-1))
        index = np.round(times / dt)
        within, after = (index == inside[..., None]) * 1.0, (index > inside[..., None]) * 1.0
        covered: Array = begun.covered + within * two[..., :1] + after * two[..., 1:]
        evading = channels.towards(told.value(dt), np.broadcast_to(begun.gamma, u.shape))
        covered += evading.integral(np.maximum(times - (delay + dt)[..., None], 0.0))
        return covered

    def paths(self, begun: Begun, covered: Array) -> Paths:
        """The paths of channels whose integrals are `covered` (..., N, 3, M)."""
        far, turned, climbed = covered[..., 0, :], covered[..., 1, :], covered[..., 2, :]
        way, half = _steps(far), 0.5 * _steps(turned)
        course = begun.state.theta[:, None] + turned - half
        share = _chord(half) * way
        at = np.empty(far.shape, dtype=complex)
        at.real = begun.state.x[:, None] + np.cumsum(share * np.cos(course), axis=-1)
        at.imag = begun.state.y[:, None] + np.cumsum(share * np.sin(course), axis=-1)
        radius = begun.gamma[:, 0] / begun.gamma[:, 1]
        arm = -1j * radius * np.exp(1j * (begun.state.theta + turned[..., -1]))
        return Paths(at, begun.state.z[:, None] + climbed, at[..., -1] - arm, arm)


def _chord(half: Array) -> Array:
    """sin(half) / half [rad]: what an arc's chord is of its way."""
    square = half * half
    if square.max(initial=0.0) > 0.01:
        return np.asarray(np.sinc(half / np.pi))
    # The next term of the series is less than 3e-12.
    return np.asarray(1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)))


def _steps(total: Array) -> Array:
    """What each period adds to integrals (..., M) that start at 0."""
    step = total.copy()
    step[..., 1:] -= total[..., :-1]
    return step


@dataclass(frozen=True, eq=False)
class Reach:
    """How far any input of the box can move each vehicle from gamma's flow [m].

    at      (N, M) at the instants
    centre  (N,) the circle's centre, level
    arm     (N,) the arm
    circle  (N,) at any phase of the circle, with its height
    """

    at: Array
    centre: Array
    arm: Array
    circle: Array


def furthest(begun: Begun, gamma: Array, lower: Array, upper: Array) -> Reach:
    """How far any input of the box can move each vehicle.

    gamma, lower, upper  (N, 3, M) integrals of the channels under gamma and under the ends of the box

    A channel told more is at no time lower, so the integrals lie between those of the ends. With them the
    bound is a proof: |v e^{j theta} - v' e^{j theta'}| <= |v - v'| + v' |theta - theta'|, a course's change
    never shrinks along the flow, and an arm of length r moves by r times it at most.
    """
    off = np.maximum(np.abs(lower - gamma), np.abs(upper - gamma))
    turned, up = off[:, 1], off[:, 2]
    level = off[:, 0] + np.cumsum(np.abs(_steps(gamma[:, 0])) * turned, axis=-1)
    arm = np.abs(begun.gamma[:, 0] / begun.gamma[:, 1]) * turned[:, -1]
    centre = level[:, -1] + arm
    circle = centre + arm
    return Reach(np.sqrt(level**2 + up**2), centre, arm, np.sqrt(circle**2 + up[:, -1] ** 2))


def _within(times: Array, begin: Array, long: Array) -> Array:
    """How much (..., M) of an interval has passed at each time."""
    return np.minimum(np.maximum(times - begin[..., None], 0.0), long[..., None])
