"""Computes the paper's general barrier: the least of a safety function while all fly constant manoeuvres.

Planar vectors are complex numbers, east + 1j north.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from filters.barriers.global_minimum import NotLocated, global_minimum
from filters.barriers.pairs import (
    ARRAYS,
    FORMS,
    Index,
    PairValues,
    all_pairs,
    check_count,
    check_separation,
    chosen_pairs,
    form_function,
    vehicle_of,
)
from filters.barriers.range_functions import Motion, Safety, SquaredRange
from filters.model import Array, Command, State, step

Indices = NDArray[np.intp]

# Turn rates whose ratio is p/q with p, q up to this have a common period; more turns are not searched.
RATIO_LIMIT = 64


class PremiseNotMet(ValueError):  # noqa: N818 - reads as the verdict it is
    """No finite horizon provably holds the infimum, so Theorem 2's h has no value computed here."""


@dataclass(frozen=True, eq=False)
class RolloutBarrier:
    """h(x) = min over the future of a safety function while each vehicle flies its manoeuvre for ever.

    gamma   (N,) v > 0, omega (any, 0 is straight) and zeta of each vehicle, constant
    d_safe  m, separation to keep
    safety  what is minimised; the squared range unless given
    form    "root" or "squared" turn that minimum into h as the closed forms do; "plain" leaves it as it is
    resolution  a minimum may be missed only if it is less than this fraction of rho's size deeper; coarser is
            cheaper where rho is nearly constant and its curvature bound loose
    Raises  ValueError for parameters out of range; PremiseNotMet naming two vehicles that climb alike and
            whose turn rates have no ratio p/q with p, q <= 64: their relative orbit never closes, the infimum
            is approached over two independent phases but reached at no time, so no horizon holds it and no
            minimiser gives a gradient.
    Source  Squires et al. 2022, "Constructing a Barrier Function via Evading Maneuvers": h(x; rho, gamma) and
            the theorem after it. The gradient is the envelope theorem's.

    The horizon is a common period of two turning vehicles that climb alike; otherwise the pair drifts apart,
    and the horizon ends when its range can no longer come back to one with rho as low as now. Two vehicles
    flying straight with equal velocities keep their range: h is rho now, with its gradient, though h jumps at
    nearby states (the reason why StraightBarrier refuses equal speeds).
    """

    gamma: Command
    d_safe: float
    safety: Safety = field(default_factory=SquaredRange)
    form: str = "root"
    resolution: float = 1e-13
    period: Array = field(init=False, repr=False)  # (N, N) s, of the relative orbit; nan where none

    def __post_init__(self) -> None:
        check_separation(self.d_safe)
        if not 0 < self.resolution < 1:
            raise ValueError(f"resolution must lie between 0 and 1, got {self.resolution}")
        if self.form not in (*FORMS, "plain"):
            raise ValueError(f"unknown form {self.form!r} of h; choose one of {', '.join(FORMS)}, plain")
        g = self.gamma
        if len(g.shape) != 1 or not (np.all(g.isfinite()) and np.all(g.v > 0)):
            raise ValueError(f"a manoeuvre needs a finite v > 0, omega and zeta for each vehicle, got {g}")
        period = np.full((len(g), len(g)), np.nan)
        known: dict[tuple[float, float], float] = {}
        for i, j in zip(*all_pairs(len(g)), strict=True):
            if g.omega[i] == 0 or g.omega[j] == 0 or g.zeta[i] != g.zeta[j]:
                continue
            rates = (float(g.omega[i]), float(g.omega[j]))
            if rates not in known:
                known[rates] = _common_period(*rates)
            if np.isinf(known[rates]):
                raise PremiseNotMet(
                    f"vehicles {i + 1} and {j + 1} climb alike and turn at {rates[0]} and {rates[1]} rad/s, "
                    f"without a ratio p/q of p, q <= {RATIO_LIMIT}: their relative orbit does not close and "
                    "no time attains the infimum; choose commensurable turn rates or different climb rates"
                )
            period[i, j] = period[j, i] = known[rates]
        object.__setattr__(self, "period", period)

    def manoeuvre(self, n: int) -> Command:
        """(n,): the manoeuvre given."""
        check_count(n, self.gamma.v, "gamma")
        return self.gamma

    def values(self, state: State, i: Index | None = None, j: Index | None = None) -> PairValues:
        """h and gradient (see `Barrier.values`).

        Raises  PremiseNotMet if a pair takes so many turns to part that its infimum cannot be located.
        """
        i, j = chosen_pairs(state, i, j)
        tau = self.worst_time(state, i, j)
        a, b = state[i], state[j]
        end_a = step(a, self.gamma[vehicle_of(i)], tau)
        end_b = step(b, self.gamma[vehicle_of(j)], tau)
        rho = self.safety.value(end_a, end_b)
        h, slope = (rho, 1.0) if self.form == "plain" else form_function(self.form)(rho, self.d_safe, ARRAYS)
        grad = np.array(self.safety.gradient(end_a, end_b).T, order="C")
        # A turn of the start carries the whole path round it
        grad[2] += grad[1] * (end_a.x - a.x) - grad[0] * (end_a.y - a.y)
        grad[6] += grad[5] * (end_b.x - b.x) - grad[4] * (end_b.y - b.y)
        grad *= slope
        return PairValues(i, j, h, grad.T)

    def worst_time(self, state: State, i: Index | None = None, j: Index | None = None) -> Array:
        """(P,) s: when the minimum is reached; modulo the period where there is one, so perhaps negative."""
        check_count(len(state), self.gamma.v, "gamma")
        i, j = chosen_pairs(state, i, j)
        vehicle_i, vehicle_j = vehicle_of(i), vehicle_of(j)
        a, b, gamma_a, gamma_b = state[i], state[j], self.gamma[vehicle_i], self.gamma[vehicle_j]
        period = self.period[vehicle_i, vehicle_j]
        motion = _motion(a, b, gamma_a, gamma_b, period, self.safety)

        def value(p: Indices, tau: Array) -> Array:
            return self.safety.value(step(a[p], gamma_a[p], tau), step(b[p], gamma_b[p], tau))

        def slope(p: Indices, tau: Array) -> Array:
            end_a, end_b = step(a[p], gamma_a[p], tau), step(b[p], gamma_b[p], tau)
            motions = [_rates(end_a, gamma_a[p]), _rates(end_b, gamma_b[p])]
            along = self.safety.gradient(end_a, end_b) * np.concatenate(motions, axis=-1)
            return np.asarray(np.sum(along, axis=-1))

        rate = np.maximum(np.abs(gamma_a.omega), np.abs(gamma_b.omega))
        scale = 1.0 / np.maximum(rate, 1.0 / np.maximum(motion.horizon, 1e-3))
        try:
            return global_minimum(
                value,
                slope,
                self.safety.curvature(motion),
                motion.horizon,
                np.isfinite(period),
                scale,
                self.resolution,
            )
        except NotLocated as e:
            p = e.function
            raise PremiseNotMet(
                f"the infimum of vehicles {vehicle_i[p] + 1} and {vehicle_j[p] + 1} cannot be located within "
                f"their horizon of {motion.horizon[p]:.3g} s; if it is long because their climb rates nearly "
                "agree, make these equal or more different, else choose a coarser resolution"
            ) from e


def _common_period(rate_i: float, rate_j: float) -> float:
    """s, the smallest time in which both turn whole circles; inf if their ratio is not of small integers."""
    ratio = abs(rate_i / rate_j)
    fraction = Fraction(ratio).limit_denominator(RATIO_LIMIT)
    close = abs(ratio - fraction) <= 1e-12 * ratio
    if not close or fraction.numerator > RATIO_LIMIT:
        return float("inf")
    return 2 * np.pi * fraction.denominator / abs(rate_j)


def _rates(state: State, command: Command) -> Array:
    """d state/d tau, of the states' shape and a last axis of 4 (eq. (2))."""
    v = np.stack([command.v * np.cos(state.theta), command.v * np.sin(state.theta)], axis=-1)
    turn_climb = np.stack(np.broadcast_arrays(command.omega, command.zeta), axis=-1)
    return np.concatenate([v, np.broadcast_to(turn_climb, v.shape)], axis=-1)


def _motion(a: State, b: State, gamma_a: Command, gamma_b: Command, period: Array, safety: Safety) -> Motion:
    """The relative motion of pairs, with its horizon: `period` (P,) s where that is finite."""

    def parts(s: State, g: Command) -> tuple[Array, Array, Array]:
        heading = np.exp(1j * s.theta)
        straight = g.omega == 0
        arm = np.where(straight, 0.0, -1j * heading * g.v / np.where(straight, 1.0, g.omega))
        return s.x + 1j * s.y - arm, np.where(straight, g.v * heading, 0.0), arm

    centre_a, drift_a, arm_a = parts(a, gamma_a)
    centre_b, drift_b, arm_b = parts(b, gamma_b)
    centre, drift = centre_a - centre_b, drift_a - drift_b
    height, climb = a.z - b.z, gamma_a.zeta - gamma_b.zeta
    alike = gamma_a.omega == gamma_b.omega
    arm_i, arm_j = np.where(alike, arm_a - arm_b, arm_a), np.where(alike, 0.0, -arm_b)

    # |centre + drift tau| - |arms| bounds the range from below; after the larger root of
    # |centre + drift tau|^2 = limit^2 it stays beyond the reach of the present value.
    limit = safety.reach(safety.value(a, b)) + np.abs(arm_i) + np.abs(arm_j)
    speed2 = np.abs(drift) ** 2 + climb**2
    parting = centre.real * drift.real + centre.imag * drift.imag + height * climb
    inside = np.maximum(limit**2 - np.abs(centre) ** 2 - height**2, 0.0)
    root = np.sqrt(parting**2 + speed2 * inside)
    # Two forms of the one root, each where it does not cancel.
    with np.errstate(divide="ignore", invalid="ignore"):
        late = np.where(parting > 0, inside / (parting + root), (root - parting) / speed2)
    late = np.where(speed2 > 0, late, 0.0) * (1 + 1e-9)
    horizon = np.where(np.isfinite(period), period, late)
    return Motion(centre, drift, arm_i, arm_j, gamma_a.omega, gamma_b.omega, height, climb, a.theta, horizon)
