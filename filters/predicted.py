"""A filter that looks at where the vehicles will be: its pose predicted from measured rates.

Aircraft answer commands late, so a filter that reasons as if they were unicycles acts late. Predicting the
pose over the lag takes most of that away; the commands, nominal and chosen, pass unchanged. The wrapped
filter's h is that of the predicted pose, never the true one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from filters.collision import Decision, Filter
from filters.unicycle import Array, Command, Limits, State, View, step

Pose = Callable[[State, Command], State]
"""Poses and measured rates (N,) or (observers, N) -> the poses to look at."""

# Gauss-Legendre points per panel, and the panels' ends in longest time constants after the last delay and
# rate limit: the integrand decays exponentially and turns slowly. Error below 1e-6 m on the X8's lags.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
TAIL = np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.5, 7.0, 9.0, 12.0, 16.0, 20.0])


@dataclass(frozen=True)
class Predicted:
    """`filter`, seeing the poses that `pose` makes of the measured ones and their rates.

    Deliberately without the wrapped filter's `barrier`: its values are not those of the true pose.
    """

    filter: Filter
    pose: Pose

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        return self.filter(View(self.pose(view.state, view.rates), view.rates), nominal, limits)


@dataclass(frozen=True)
class Horizon:
    """Where each vehicle is `seconds` later if it keeps its measured rates: the exact arc.

    Raises  ValueError unless seconds is finite and not negative.
    """

    seconds: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.seconds) and self.seconds >= 0):
            raise ValueError(f"a prediction horizon must be finite and not negative, got {self.seconds} s")

    def __call__(self, state: State, rates: Command) -> State:
        return step(state, rates, self.seconds)


class Lag(Protocol):
    """How one channel follows its command (see `aircraft.kinematic.Lag`)."""

    @property
    def time_constant_s(self) -> float: ...
    @property
    def delay_s(self) -> float: ...
    @property
    def rate_min(self) -> float: ...
    @property
    def rate_max(self) -> float: ...


class LaggedPose:
    """The pose at which the unicycle model is exact for a vehicle whose channels lag.

    lags  (v, omega, zeta) of every vehicle: one triple for all, or N of them
    held  (N,) the command taken to be given from now on; the evading manoeuvre, for a barrier built from it
    Raises  ValueError for another number of lags, or a time that is negative or not finite.

    A channel of time constant T and delay d, given u from now on, keeps its rate r for d (what it hears is
    on its way already), then moves towards u no faster than its rate limits allow and decays as exp(-t/T).
    Once that is over, the vehicle flies the arc that a unicycle would, given u now at another pose: the pose
    returned. It is displaced by where the transient carries the vehicle *beyond* the commanded motion,
    integral(r - u): for course and height (T + d) (r - u), for the position the integral of
    v(t) e(theta(t)) - v_u e(theta_u + omega_u t), by quadrature.

    So h there is the clearance at which the lagged vehicles end up when all fly `held`, it stays the same
    while they do, and the evading manoeuvre keeps satisfying every row, as in Theorem 3. Without delay and
    rate limits the pose's course and height change at exactly the commanded omega and zeta whatever they are
    (d(theta + T omega)/dt = omega_u, the reason for all this), and its position at v_u e while the course is
    steady. Remaining error: inputs other than `held` while turning, of first order in the lags; and h says
    nothing of the transient itself.
    """

    def __init__(self, lags: Sequence[Sequence[Lag]], held: Command) -> None:
        if len(lags) not in (1, len(held)) or any(len(triple) != 3 for triple in lags):
            raise ValueError(f"{len(held)} vehicles need one or {len(held)} triples of lags, got {len(lags)}")
        self.held = held
        self._channels = [_Channel.of([triple[c] for triple in lags]) for c in range(3)]

    def __call__(self, state: State, rates: Command) -> State:
        u = self.held
        of = zip(self._channels, (rates.v, rates.omega, rates.zeta), (u.v, u.omega, u.zeta), strict=True)
        speed, turn, climb = (_Move.of(*channel) for channel in of)
        theta = state.theta + turn.excess
        t, weight = _nodes(speed, turn)
        # Course of the vehicle and of the unicycle it ends up on, along a new first axis of times.
        flown = state.theta + turn.angle(t)
        ideal = theta + u.omega * t
        v = speed.rate(t)
        east = np.sum(weight * (v * np.cos(flown) - u.v * np.cos(ideal)), axis=0)
        north = np.sum(weight * (v * np.sin(flown) - u.v * np.sin(ideal)), axis=0)
        return State(state.x + east, state.y + north, theta, state.z + climb.excess)


@dataclass(frozen=True, eq=False)
class _Channel:
    """Time constant and delay [s], largest rates of change down and up (N,) or (1,)."""

    constant: Array
    delay: Array
    fall: Array
    rise: Array

    @classmethod
    def of(cls, lags: Sequence[Lag]) -> _Channel:
        constant, delay = (np.array([getattr(x, n) for x in lags]) for n in ("time_constant_s", "delay_s"))
        for name, values in (("time constant", constant), ("delay", delay)):
            if not np.all(np.isfinite(values) & (values >= 0)):
                raise ValueError(f"a {name} must be finite and not negative, got {values.tolist()} s")
        # Finite, so that a channel without lag and limit, which jumps, needs no case of its own.
        fall = np.minimum([-x.rate_min for x in lags], 1e9)
        rise = np.minimum([x.rate_max for x in lags], 1e9)
        return cls(np.maximum(constant, 1e-9), delay, fall, rise)


@dataclass(frozen=True, eq=False)
class _Move:
    """One channel on its way from `now` to `asked`: it waits, ramps at its rate limit, then decays."""

    now: Array
    asked: Array
    delay: Array
    constant: Array
    slope: Array
    ramp: Array
    left: Array

    @classmethod
    def of(cls, channel: _Channel, now: Array, asked: Array) -> _Move:
        gap = asked - now
        limit = np.where(gap > 0, channel.rise, channel.fall)
        ramp = np.maximum(np.abs(gap) / limit - channel.constant, 0.0)
        slope = np.sign(gap) * limit
        return cls(now, asked, channel.delay, channel.constant, slope, ramp, gap - slope * ramp)

    @property
    def begin(self) -> Array:
        """When only the exponential is left [s]."""
        return self.delay + self.ramp

    def rate(self, t: Array) -> Array:
        heard = np.maximum(t - self.delay, 0.0)
        decayed = self.left * np.exp(-np.maximum(heard - self.ramp, 0.0) / self.constant)
        return np.asarray(np.where(heard < self.ramp, self.now + self.slope * heard, self.asked - decayed))

    def angle(self, t: Array) -> Array:
        """The rate's integral over [0, t]."""
        heard = np.maximum(t - self.delay, 0.0)
        up = np.minimum(heard, self.ramp)
        after = heard - up
        gone = self.left * self.constant * -np.expm1(-after / self.constant)
        return np.asarray(
            self.now * (np.minimum(t, self.delay) + up) + 0.5 * self.slope * up**2 + self.asked * after - gone
        )

    @property
    def excess(self) -> Array:
        """The integral of rate - asked over all time: how far the transient carries the vehicle."""
        gap = self.now - self.asked
        return gap * self.begin + 0.5 * self.slope * self.ramp**2 - self.left * self.constant


def _nodes(speed: _Move, turn: _Move) -> tuple[Array, Array]:
    """Times [s] and weights (K, ...) of a quadrature from now until both channels are settled."""
    marks = np.broadcast_arrays(speed.delay, turn.delay, speed.begin, turn.begin)
    marks = np.sort(np.stack([np.zeros_like(marks[0]), *marks]), axis=0)
    longest = np.maximum(speed.constant, turn.constant)
    tail = marks[-1] + TAIL.reshape(-1, *[1] * (marks.ndim - 1)) * longest
    ends = np.concatenate([marks, tail])
    half = 0.5 * np.diff(ends, axis=0)
    shape = (-1, *[1] * ends.ndim)
    t = ends[:-1] + half * (1.0 + POINTS.reshape(shape))
    weight = half * WEIGHTS.reshape(shape)
    return t.reshape(-1, *ends.shape[1:]), weight.reshape(-1, *ends.shape[1:])
