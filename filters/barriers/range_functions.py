"""Defines safety functions rho(x_i, x_j) and the relative motion along which `rollout` minimises them.

Planar vectors are complex numbers, east + 1j north.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from filters.model import Array, State


@dataclass(frozen=True, eq=False)
class Motion:
    """Relative motion of P pairs under their manoeuvres, all (P,).

    At time tau in [0, horizon] the planar offset p_i - p_j is
    centre + drift tau + arm_i e^(1j rate_i tau) + arm_j e^(1j rate_j tau), the vertical height + climb tau.
    Equal rates are merged into arm_i, and arm_j is 0.
    """

    centre: Array
    drift: Array
    arm_i: Array
    arm_j: Array
    rate_i: Array
    rate_j: Array
    height: Array
    climb: Array
    theta_i: Array
    horizon: Array

    @property
    def largest_range(self) -> Array:
        """m, never exceeded within the horizon."""
        planar = (
            np.abs(self.centre) + np.abs(self.drift) * self.horizon + np.abs(self.arm_i) + np.abs(self.arm_j)
        )
        return np.asarray(np.hypot(planar, np.abs(self.height) + np.abs(self.climb) * self.horizon))

    @property
    def largest_speed(self) -> Array:
        """m/s, bound of the relative speed."""
        turning = np.abs(self.arm_i * self.rate_i) + np.abs(self.arm_j * self.rate_j)
        return np.asarray(np.hypot(np.abs(self.drift) + turning, self.climb))

    @property
    def largest_acceleration(self) -> Array:
        """m/s^2, bound of the relative acceleration."""
        return np.abs(self.arm_i) * self.rate_i**2 + np.abs(self.arm_j) * self.rate_j**2


class Safety(Protocol):
    """A differentiable safety function rho(x_i, x_j), 2 pi-periodic in courses, and bounds for the search."""

    def value(self, a: State, b: State) -> Array:
        """rho, of the states' common shape."""
        ...

    def gradient(self, a: State, b: State) -> Array:
        """d rho/d[x_a, x_b], of the states' shape and a last axis of 8."""
        ...

    def reach(self, value: Array) -> Array:
        """m: pairs farther apart than this all have rho >= value."""
        ...

    def curvature(self, motion: Motion) -> Array:
        """(P,) bounds of |d^2 rho/d tau^2| along the motion, for tau in [0, motion.horizon]."""
        ...


@dataclass(frozen=True)
class SquaredRange:
    """rho = |p_a - p_b|^2 - 2 delta + delta sin theta_a - delta cos theta_a, m^2, before the form's Ds.

    delta  m^2, >= 0; 0 is the squared distance
    Source  Squires et al. 2022, the adjusted safety function of Example 1.
    """

    delta: float = 0.0

    def value(self, a: State, b: State) -> Array:
        range2 = np.square(a.x - b.x) + np.square(a.y - b.y) + np.square(a.z - b.z)
        if self.delta:
            range2 = range2 + self.delta * (np.sin(a.theta) - np.cos(a.theta) - 2)
        return np.asarray(range2)

    def gradient(self, a: State, b: State) -> Array:
        dx, dy, dz = 2 * (a.x - b.x), 2 * (a.y - b.y), 2 * (a.z - b.z)
        turn = self.delta * (np.cos(a.theta) + np.sin(a.theta))
        return np.stack([dx, dy, turn, dz, -dx, -dy, np.zeros_like(dx), -dz], axis=-1)

    def reach(self, value: Array) -> Array:
        return np.asarray(np.sqrt(np.maximum(value + (2 + np.sqrt(2)) * self.delta, 0.0)))

    def curvature(self, motion: Motion) -> Array:
        """The sum of each harmonic's amplitude times its rate squared: 0 for a range that stays constant."""
        m = motion
        reach = np.abs(m.drift) * m.horizon
        # delta's harmonic turns with vehicle i and adds to that vehicle's own where the rates are merged
        tilt = self.delta * (-1 - 1j) * np.exp(1j * m.theta_i)
        first = np.abs(2 * np.conj(m.centre) * m.arm_i + tilt) + 2 * reach * np.abs(m.arm_i)
        second = 2 * (np.abs(m.centre) + reach) * np.abs(m.arm_j)
        both = 2 * np.abs(m.arm_i * m.arm_j)
        bend = first * m.rate_i**2 + second * m.rate_j**2 + both * (m.rate_i - m.rate_j) ** 2
        turning = np.abs(m.arm_i * m.rate_i) + np.abs(m.arm_j * m.rate_j)
        return np.asarray(bend + 2 * (np.abs(m.drift) ** 2 + m.climb**2) + 4 * np.abs(m.drift) * turning)
