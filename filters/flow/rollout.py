"""Rolls the model of lagging vehicles forward: the commands on their way, one more command, then gamma.

All vehicles share gamma's turn rate, so that once the channels have settled each flies a circle, all in step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.constraints import Indices
from filters.flow.channels import Channels
from filters.flow.grid import Grid
from filters.model import Array, State

Complex = np.ndarray

# Channels this near to gamma have settled [m/s, rad/s, m/s].
SETTLED = np.array([1e-4, 1e-6, 1e-4])
# So many instants are prepared at once.
_INSTANTS = 160


@dataclass(frozen=True, eq=False)
class Paths:
    """Positions on the flow: at M instants of the transient, then on circles.

    at      (..., N, M) complex m, x + j y at dt, 2 dt, ... M dt
    z       (..., N, M) m
    centre  (..., N) complex m, of the circle flown after M dt
    arm     (..., N) complex m, from the centre to the vehicle at M dt
    turned  (..., N, M) rad, by which the course has turned at the instants
    """

    at: Complex
    z: Array
    centre: Complex
    arm: Complex
    turned: Array

    def __getitem__(self, index: int | slice | Indices) -> Paths:
        """The paths at `index` of the first axis."""
        each = (self.at, self.z, self.centre, self.arm, self.turned)
        return Paths(*(x[index] for x in each))

    def arms(self, which: Indices) -> Complex:
        """(..., K) m, arms of the circles that gamma, followed at once, would fly from instants on.

        which  (K,) or more axes, place in (N, M)
        """
        instants = self.turned.shape[-1]
        turned = self.turned.reshape(*self.turned.shape[:-2], -1).take(which, axis=-1)
        vehicle = which // instants
        left = turned - self.turned[..., -1].take(vehicle, axis=-1)
        return np.asarray(self.arm.take(vehicle, axis=-1) * np.exp(1j * left))


@dataclass(frozen=True, eq=False)
class Begun:
    """What is certain whatever is commanded next: states, commands on their way, and what they lead to.

    state     (N,)
    rates     (N, 3) when the next command is heard, each channel after its own delay
    covered   (N, 3, M) integrals of the rates at the instants, up to each channel's delay
    grid      the instants
    channels  of the vehicles
    gamma     (N, 3) flown after the next command
    """

    state: State
    rates: Array
    covered: Array
    grid: Grid
    channels: Channels
    gamma: Array

    @property
    def times(self) -> Array:
        """(M,) s"""
        return self.grid.times

    def of(self, vehicles: Indices) -> Begun:
        """The same of some vehicles alone."""
        state, v = self.state, vehicles
        some = State(state.x[v], state.y[v], state.theta[v], state.z[v])
        return Begun(
            some,
            self.rates[v],
            self.covered[v],
            self.grid.some(v, self.times.size),
            self.channels.of_some(v),
            self.gamma[v],
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
        self._grid = Grid.of(channels, dt, _INSTANTS)
        # How long each of the commands on their way, the oldest first, is heard, in all and at each instant.
        delay = channels.delay
        early = dt * np.arange(1.0, max(self.depth, 1) + 1)
        self._heard = []
        for k in range(self.depth - 1, -1, -1):
            begin = np.maximum(delay - (k + 1) * dt, 0.0)
            long = np.maximum(delay - k * dt, 0.0) - begin
            self._heard.append((k, long, _within(early, begin, long)))
        # In a period each channel hears one change, from the command `back + 1` periods old to the next.
        self._back = np.floor(delay / dt + 1e-9).astype(int)
        self._until = np.maximum(delay - self._back * dt, 0.0)

    def grid(self, instants: int) -> Grid:
        """The first instants."""
        if instants > self._grid.times.size:
            self._grid = Grid.of(self.channels, self.dt, 2 * instants)
        return self._grid.some(slice(None), instants)

    def begin(self, state: State, rates: Array, queued: Array, times: Array) -> Begun:
        """Take what is on its way into account.

        rates   (N, 3) now
        queued  (depth, N, 3) commands given, the latest first
        times   (M,) s, multiples of dt from dt on
        """
        y, few = rates, max(self.depth, 1)
        # After `depth` periods all of it has been heard.
        covered = np.zeros((*rates.shape, times.size))
        early = covered[..., :few]
        for k, long, within in self._heard:
            motion = self.channels.towards(y, queued[k])
            early += motion.integral(within[..., : early.shape[-1]])
            y = motion.value(long)
        covered[..., few:] = early[..., -1:]
        return Begun(state, y, covered, self.grid(times.size), self.channels, self.gamma)

    def after(self, rates: Array, queued: Array) -> Array:
        """The rates (N, 3) one period after `rates`, with the commands (K, N, 3) given, the latest first.

        K is the depth and one more, or the longest that there is.
        """
        vehicle, channel = np.arange(len(rates))[:, None], np.arange(3)

        def heard(k: Indices) -> Array:
            return np.asarray(queued[np.minimum(k, len(queued) - 1), vehicle, channel])

        changing = self.channels.towards(rates, heard(self._back + 1)).value(self._until)
        return self.channels.towards(changing, heard(self._back)).value(self.dt - self._until)

    def times(self, rates: Array, told: Array | None = None) -> Array:
        """Instants dt, 2 dt, ... [s] until all channels have settled on gamma, whatever is on its way.

        rates  (N, 3) now. Commands on their way carry a channel no further off than its largest rate allows.
        told   (N, 3) how far from gamma commands may be; None: they are gamma
        """
        c = self.channels
        moved = c.delay + self.dt
        gap = np.abs(rates - self.gamma)
        slowest = np.minimum(c.fall, c.rise)
        bounded = np.maximum(gap / slowest - c.constant, 0.0)
        left = np.minimum(gap if told is None else np.maximum(gap, told), slowest * c.constant)
        settled = bounded + c.constant * np.log(np.maximum(left / SETTLED, 1.0))
        longest = float(np.max(2 * moved + settled))
        return np.asarray(self.dt * np.arange(1.0, np.ceil(longest / self.dt) + 1))

    def roll(self, begun: Begun, u: Array) -> Paths:
        """The paths when u (..., N, 3) is commanded for one period, then gamma."""
        return self.paths(begun, self.covered(begun, u))

    def covered(self, begun: Begun, u: Array) -> Array:
        """Integrals (..., N, 3, M) of the channels when u (..., N, 3) is commanded, then gamma."""
        channels, grid = begun.channels, begun.grid
        told = channels.towards(begun.rates, u)
        two = told.integral(grid.heard)
        evading = channels.towards(told.value(self.dt), begun.gamma)
        covered = evading.integral(grid.evading, grid.decay)
        covered += begun.covered
        covered += grid.within * two[..., :1]
        covered += grid.after * two[..., 1:]
        return covered

    def paths(self, begun: Begun, covered: Array) -> Paths:
        """The paths of channels whose integrals are `covered` (..., N, 3, M)."""
        far, turned, climbed = covered[..., 0, :], covered[..., 1, :], covered[..., 2, :]
        way, half = steps(far), 0.5 * steps(turned)
        course = begun.state.theta[:, None] + turned - half
        share = _chord(half) * way
        at = np.empty(far.shape, dtype=complex)
        for part, begin, turned_to in (
            (at.real, begun.state.x, np.cos(course)),
            (at.imag, begun.state.y, np.sin(course)),
        ):
            turned_to *= share
            turned_to[..., 0] += begin
            np.cumsum(turned_to, axis=-1, out=part)
        radius = begun.gamma[:, 0] / begun.gamma[:, 1]
        arm = -1j * radius * np.exp(1j * (begun.state.theta + turned[..., -1]))
        return Paths(at, begun.state.z[:, None] + climbed, at[..., -1] - arm, arm, turned)


def _chord(half: Array) -> Array:
    """sin(half) / half [rad]: what an arc's chord is of its way."""
    square = half * half
    if square.max(initial=0.0) > 0.01:
        return np.asarray(np.sinc(half / np.pi))
    # The next term of the series is less than 3e-12.
    return np.asarray(1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)))


def steps(total: Array) -> Array:
    """What each period adds to integrals (..., M) that start at 0."""
    step = np.empty(total.shape)
    step[..., 0] = total[..., 0]
    np.subtract(total[..., 1:], total[..., :-1], out=step[..., 1:])
    return step


def _within(times: Array, begin: Array, long: Array) -> Array:
    """How much (..., M) of an interval has passed at each time."""
    return np.minimum(np.maximum(times - begin[..., None], 0.0), long[..., None])
