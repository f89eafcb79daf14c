"""Shows a filter where the vehicles will be: poses predicted from the measured ones and their rates.

Aircraft answer commands late, so a filter that reasons as if they were unicycles acts late. Predicting the
pose over the lag takes most of that away; the commands, nominal and chosen, pass unchanged. The wrapped
filter's h is that of the predicted pose, never the true one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from filters.constraints import Constraints
from filters.filter import Choose, Decision, Declaration, declaration
from filters.model import Command, Limits, State, View, step

Pose = Callable[[State, Command], State]
"""Poses and measured rates (N,) or (observers, N) -> the poses to look at."""

# Gauss-Legendre points per panel, and the panels' ends in longest time constants after the last delay: the
# integrand decays exponentially and turns slowly.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
TAIL = np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.5, 7.0, 9.0, 12.0, 16.0, 20.0])


@dataclass(frozen=True)
class Predicted:
    """`filter`, seeing the poses that `pose` makes of the measured ones and their rates."""

    filter: Choose
    pose: Pose

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        return self.filter(self._ahead(view), nominal, limits)

    @property
    def declaration(self) -> Declaration:
        """The wrapped filter's, with its constraints at the predicted poses and without its barrier.

        The h of its decisions is that of the predicted poses, not of those it was shown.
        """
        inner = declaration(self.filter)
        rows = inner.constraints

        def constraints(view: View) -> tuple[Constraints, ...]:
            assert rows is not None
            return rows(self._ahead(view))

        return replace(inner, barrier=None, constraints=None if rows is None else constraints)

    def _ahead(self, view: View) -> View:
        return view.altered(self.pose(view.state, view.rates), view.rates)


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


class LaggedPose:
    """The pose at which the unicycle model is exact for a vehicle whose channels lag.

    lags  (v, omega, zeta) of every vehicle: one triple for all, or N of them
    held  (N,) the command taken to be given from now on; the evading manoeuvre, for a barrier built from it
    Raises  ValueError for another number of lags, or a time that is negative or not finite.

    A channel of time constant T and delay d, given u from now on, keeps its rate r for d (the commands of
    that time are on their way) and then decays towards u as exp(-t/T). Once that is over, the vehicle flies
    the arc
    that a unicycle would, given u now at another pose: the pose returned. It is displaced by where the
    transient carries the vehicle *beyond* the commanded motion, integral(r - u): for course and height
    (T + d) (r - u), for the position the integral of v(t) e(theta(t)) - v_u e(theta_u + omega_u t).

    So h there is the clearance at which the lagged vehicles end up when all fly `held`, it stays the same
    while they do, and the evading manoeuvre keeps satisfying every row, as in Theorem 3. Without delay the
    pose's course and height change at exactly the commanded omega and zeta, whatever they are (the rate of
    theta + T omega is the commanded one), and its position at the commanded v while the course is steady.
    Remaining error: inputs other than `held` while turning, of first order in the lags; and h says nothing
    of the transient itself. For that reason rate limits are left out, though they are known: the X8 takes
    5 s to slow down from 25 to 16 m/s, and a pose 20 m ahead of the aircraft has passed the other one when
    the aircraft has not (closest 1.0 m in ten perturbed encounters; without the limits 7.2 m).
    """

    def __init__(self, lags: Sequence[Sequence[Lag]], held: Command) -> None:
        if len(lags) not in (1, len(held)) or any(len(triple) != 3 for triple in lags):
            raise ValueError(f"{len(held)} vehicles need one or {len(held)} triples of lags, got {len(lags)}")
        constant, delay = (
            np.array([[getattr(lag, name) for lag in triple] for triple in lags])
            for name in ("time_constant_s", "delay_s")
        )
        for name, values in (("time constant", constant), ("delay", delay)):
            if not np.all(np.isfinite(values) & (values >= 0)):
                raise ValueError(f"a {name} must be finite and not negative, got {values.tolist()} s")
        self.held = held
        self._whole = constant + delay
        # A quadrature of its own for every vehicle (N, K), which depends on the lags alone.
        begin = np.sort(delay[:, :2], axis=1)
        tail = begin[:, 1:] + TAIL * np.max(constant[:, :2], axis=1, keepdims=True)
        ends = np.concatenate([np.zeros((len(lags), 1)), begin, tail], axis=1)
        half = 0.5 * np.diff(ends, axis=1)[..., None]
        t = (ends[:, :-1, None] + half * (1.0 + POINTS)).reshape(len(lags), -1)
        arc = np.exp(1j * held.omega[:, None] * t)
        self._weight = (half * WEIGHTS).reshape(len(lags), -1) * arc
        constant, delay = np.maximum(constant, 1e-12)[..., None], delay[..., None]
        decay = np.exp(-np.maximum(t - delay[:, 0], 0.0) / constant[:, 0])
        turn = -constant[:, 1] * np.expm1(-np.maximum(t - delay[:, 1], 0.0) / constant[:, 1])
        # Of one unit of speed and turn rate above the command: what is left, and the angle turned through.
        self._speed, self._angle = decay, np.minimum(t, delay[:, 1]) + turn

    def __call__(self, state: State, rates: Command) -> State:
        u, whole = self.held, self._whole
        turn = (rates.omega - u.omega)[..., None]
        swung = whole[:, 1] * turn[..., 0]
        speed = u.v[:, None] + (rates.v - u.v)[..., None] * self._speed
        gap = speed * np.exp(1j * turn * self._angle) - (u.v * np.exp(1j * swung))[..., None]
        moved = np.exp(1j * state.theta) * np.sum(self._weight * gap, axis=-1)
        return State(
            state.x + moved.real,
            state.y + moved.imag,
            state.theta + swung,
            state.z + whole[:, 2] * (rates.zeta - u.zeta),
        )
