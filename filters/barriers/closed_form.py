"""Computes pairwise barriers in closed form, with gradients: all turn at one rate, or all fly straight on.

Planar vectors are complex numbers, east + 1j north. The construction for any manoeuvre is in `rollout`.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike

from filters.barriers.pairs import (
    ARRAYS,
    FEW,
    NUMBERS,
    Form,
    Index,
    PairValues,
    all_pairs,
    at,
    by_blocks,
    check_count,
    check_separation,
    chosen_pairs,
    form_function,
    vehicle_of,
)
from filters.barriers.reach import Reach
from filters.barriers.turn_kernel import clearance
from filters.model import Array, Command, State


@dataclass(frozen=True, eq=False)
class TurnBarrier:
    """Smallest future clearance of each pair if all turn at one rate for ever.

    v          m/s, speed of the manoeuvre at ratio 1
    omega      rad/s, turn rate of the manoeuvre, either sign, not 0
    d_safe     m, separation to keep
    delta      m^2, the paper's rounding of the kink; 0 leaves it out. The paper's vehicle 1 is the pair's i
    sigma      ratio of each vehicle's manoeuvre speed to v: a number or (N,). The paper's pair (sigma v, v)
               is sigma = (sigma, 1)
    form       "root" (h in m) or "squared" (h in m^2)
    smoothing  m^2, eps: |Z| is replaced by sqrt(|Z|^2 + eps^2), which is smooth at equal headings, lowers h
               and keeps L_g h gamma = 0; 0 leaves it out
    Raises  ValueError naming the parameter that is out of range.
    Source  Squires et al. 2022, Example 1, A1 and A2 = |Z|. With signed radii r = sigma v/omega, centres
            c = p + 1j r e^(1j theta), D = c_i - c_j, q = r_i e^(1j theta_i) - r_j e^(1j theta_j), the safety
            function along the manoeuvre is A1 + Re(Z e^(1j omega tau)) - Ds^2, with
            A1 = |D|^2 + |q|^2 + dz^2 - 2 delta and Z = -2j conj(D) q + delta (-1 - 1j) e^(1j theta_i).
    """

    v: float
    omega: float
    d_safe: float
    delta: float = 0.0
    sigma: ArrayLike = 1.0
    form: str = "root"
    smoothing: float = 0.0
    _radius: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        sigma = np.asarray(self.sigma, dtype=float)
        check_separation(self.d_safe)
        form_function(self.form)
        if not (np.isfinite(self.v) and self.v > 0):
            raise ValueError(f"the turn's speed v must be positive and finite, got {self.v} m/s")
        if not np.isfinite(self.omega) or self.omega == 0:
            raise ValueError(
                f"the turn rate omega must be finite and not 0, got {self.omega} rad/s; "
                "for a straight manoeuvre use StraightBarrier"
            )
        if sigma.ndim > 1 or not (np.all(np.isfinite(sigma)) and np.all(sigma > 0)):
            raise ValueError(
                f"sigma must be positive and finite, a number or one per vehicle, got {self.sigma}"
            )
        for name, value in (("delta", self.delta), ("smoothing", self.smoothing)):
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be finite and not negative, got {value} m^2")
        object.__setattr__(self, "sigma", sigma)
        object.__setattr__(self, "_radius", self.v / self.omega * sigma)

    def manoeuvre(self, n: int) -> Command:
        """(n,): v sigma_i, omega, no climb."""
        sigma = np.asarray(self.sigma)
        check_count(n, sigma, "sigma")
        return Command(self.v * np.broadcast_to(sigma, n), np.full(n, self.omega), np.zeros(n))

    def reach(self, n: int) -> Reach | None:
        """How far away h of n vehicles matters; None in squared form, whose h changes without bound."""
        if self.form != "root":
            return None
        loss = (2.0 + 2.0**0.5) * self.delta + self.smoothing
        return Reach(np.array(np.broadcast_to(self._radius, n)), self.d_safe, loss)

    def values(self, state: State, i: Index | None = None, j: Index | None = None) -> PairValues:
        """h and gradient (see `Barrier.values`); at Z = 0, the kink, the subgradient that takes d|Z| = 0."""
        check_count(len(state), self._radius, "sigma")
        form, epsilon = form_function(self.form), self.smoothing**2
        i, j = chosen_pairs(state, i, j)
        if len(state.shape) == 1 and len(i) <= FEW:
            with suppress(ValueError, OverflowError):  # an infinite course, say: an array has a nan for it
                return self._values_of_few(state, i, j, form, epsilon)
        # One array, so that a pair's vehicles are looked up once: heading times radius, centre, height, tilt.
        poses = np.empty((4 if self.delta else 3, *state.shape), dtype=complex)
        heading = np.empty(state.shape, dtype=complex)
        np.cos(state.theta, out=heading.real)
        np.sin(state.theta, out=heading.imag)
        arm = np.multiply(self._radius, heading, out=poses[0])
        np.subtract(state.x, arm.imag, out=poses[1].real)
        np.add(state.y, arm.real, out=poses[1].imag)
        poses[2] = state.z
        if self.delta:
            np.multiply(self.delta * (-1 - 1j), heading, out=poses[3])

        def kernel(i: Index, j: Index, grad: Array) -> Array:
            poses_i, poses_j = at(poses, i), at(poses, j)
            q, d, height = poses_i[:3] - poses_j[:3]
            arms, apart, tilt = (poses_i[0], poses_j[0]), (q, d, height.real), poses_i[-1]
            c = clearance(arms, apart, tilt, self.delta, epsilon, self.d_safe, form, ARRAYS)
            grad[0], grad[1], grad[2], grad[3], grad[6] = c.x, c.y, c.theta_i, c.z, c.theta_j
            np.negative(grad[0:2], out=grad[4:6])
            np.negative(grad[3], out=grad[7])
            return np.asarray(c.h)

        return by_blocks(i, j, kernel)

    def _values_of_few(self, state: State, i: Index, j: Index, form: Form, epsilon: float) -> PairValues:
        """`values` of a few pairs (i, j) of a state (N,), in plain numbers."""
        theta, radius = state.theta.tolist(), self._radius.tolist()
        if not self._radius.ndim:
            radius = [radius] * len(theta)
        x, y, z = state.x.tolist(), state.y.tolist(), state.z.tolist()
        delta = self.delta
        numbers: list[float] = []
        for a, b in zip(i.tolist(), j.tolist(), strict=True):
            cos_a, sin_a, cos_b, sin_b = cos(theta[a]), sin(theta[a]), cos(theta[b]), sin(theta[b])
            arm_a, arm_b = radius[a] * complex(cos_a, sin_a), radius[b] * complex(cos_b, sin_b)
            d = complex(x[a] - arm_a.imag, y[a] + arm_a.real) - complex(x[b] - arm_b.imag, y[b] + arm_b.real)
            apart = arm_a - arm_b, d, z[a] - z[b]
            tilt = delta * (-1 - 1j) * complex(cos_a, sin_a)
            c = clearance((arm_a, arm_b), apart, tilt, delta, epsilon, self.d_safe, form, NUMBERS)
            numbers += c.h, c.x, c.y, c.theta_i, c.z, -c.x, -c.y, c.theta_j, -c.z
            numbers += c.x * cos_a + c.y * sin_a, c.theta_i, c.z
            numbers += -c.x * cos_b - c.y * sin_b, c.theta_j, -c.z
        found = np.array(numbers).reshape(-1, 15)
        sides = found[:, 9:12], found[:, 12:]
        return PairValues(i, j, found[:, 0], found[:, 1:9], (state, sides))

    def phasor(self, state: State, i: Index | None = None, j: Index | None = None) -> Array:
        """Z of every pair i < j (..., P), complex, m^2: the kink of h is where it is 0, smoothing apart.

        state  (..., N)
        i, j   (P,) some pairs instead of all
        """
        if i is None or j is None:
            i, j = all_pairs(len(state))
        heading = np.exp(1j * state.theta)
        arm = self._radius * heading
        centre = state.x + 1j * state.y + 1j * arm
        z = -2j * np.conj(at(centre, i) - at(centre, j)) * (at(arm, i) - at(arm, j))
        return np.asarray(z + at((self.delta * (-1 - 1j)) * heading, i))


@dataclass(frozen=True, eq=False)
class StraightBarrier:
    """Smallest future clearance of each pair if all fly straight on for ever, each at its own speed.

    v       (N,) m/s, manoeuvre speed of each vehicle
    zeta    (N,) or a number, m/s, its climb rate
    d_safe  m, separation to keep
    form    "root" (h in m) or "squared" (h in m^2)
    Raises  ValueError naming two vehicles whose speeds and climb rates are both equal: at equal headings
            their range never changes, at nearly equal ones it can shrink to 0, so h would jump; also for
            parameters out of range.
    Source  Squires et al. 2022, Example 2 and appendix, with the zeta terms the appendix omits from a and b.
    """

    v: ArrayLike
    zeta: ArrayLike
    d_safe: float
    form: str = "root"

    def __post_init__(self) -> None:
        v = np.atleast_1d(np.asarray(self.v, dtype=float))
        zeta = np.asarray(self.zeta, dtype=float)
        check_separation(self.d_safe)
        form_function(self.form)
        if v.ndim != 1 or not (np.all(np.isfinite(v)) and np.all(v > 0)):
            raise ValueError(
                f"straight speeds v must be positive and finite, one per vehicle, got {v.tolist()}"
            )
        if zeta.ndim > 1 or not np.all(np.isfinite(zeta)):
            raise ValueError(
                f"climb rates zeta must be finite, a number or one per vehicle, got {zeta.tolist()}"
            )
        check_count(len(v), zeta, "zeta")
        zeta = np.broadcast_to(zeta, v.shape)
        object.__setattr__(self, "v", v)
        object.__setattr__(self, "zeta", zeta)
        i, j = all_pairs(len(v))
        gap = np.hypot(v[i] - v[j], zeta[i] - zeta[j])
        equal = np.flatnonzero(gap <= 1e-9 * np.maximum(v[i], v[j]))
        if equal.size:
            a, b = int(i[equal[0]]), int(j[equal[0]])
            raise ValueError(
                f"vehicles {a + 1} and {b + 1} have equal straight speeds ({v[a]} m/s) and climb rates: on "
                "equal headings h is discontinuous; make the speeds differ, as 16 (1 + 0.01 id) m/s does"
            )

    def manoeuvre(self, n: int) -> Command:
        """(n,): v_i straight on, climbing at zeta_i."""
        check_count(n, np.asarray(self.v), "v")
        return Command(np.asarray(self.v), np.zeros(n), np.asarray(self.zeta))

    def values(self, state: State, i: Index | None = None, j: Index | None = None) -> PairValues:
        """h and gradient (see `Barrier.values`)."""
        speed, climb = np.asarray(self.v), np.asarray(self.zeta)
        check_count(len(state), speed, "v")
        form = form_function(self.form)
        # One array, so that a pair's vehicles are looked up once: velocity, position, height.
        poses = np.empty((3, *state.shape), dtype=complex)
        np.multiply(speed, np.cos(state.theta), out=poses[0].real)
        np.multiply(speed, np.sin(state.theta), out=poses[0].imag)
        poses[1].real, poses[1].imag, poses[2] = state.x, state.y, state.z

        def kernel(i: Index, j: Index, grad: Array) -> Array:
            poses_i, poses_j = at(poses, i), at(poses, j)
            velocity_i, velocity_j = poses_i[0], poses_j[0]
            w, d, d_z = poses_i - poses_j
            d_z = d_z.real
            w_z = climb[vehicle_of(i)] - climb[vehicle_of(j)]
            closing = d.real * w.real + d.imag * w.imag + d_z * w_z
            tau = np.maximum(0.0, -closing / (w.real * w.real + w.imag * w.imag + w_z * w_z))
            # The closest offset is squared; the text's c - b^2/4a would cancel for pairs that nearly collide.
            d = d + tau * w
            d_z = d_z + tau * w_z
            h, slope = form(d.real * d.real + d.imag * d.imag + d_z * d_z, self.d_safe, ARRAYS)

            # tau is a minimiser, so its own derivative drops out (envelope theorem)
            slope = 2.0 * slope
            lever = slope * tau
            grad[0], grad[1] = slope * d.real, slope * d.imag
            grad[2] = lever * (d.imag * velocity_i.real - d.real * velocity_i.imag)
            grad[3] = slope * d_z
            np.negative(grad[0:2], out=grad[4:6])
            grad[6] = lever * (d.real * velocity_j.imag - d.imag * velocity_j.real)
            np.negative(grad[3], out=grad[7])
            return np.asarray(h)

        return by_blocks(*chosen_pairs(state, i, j), kernel)
