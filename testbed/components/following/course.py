"""Turns wanted courses and heights into course rates and climb rates inside the limits."""

from __future__ import annotations

import numpy as np

from filters.model import Array, Limits

# The share of the turn rate that following a path's field may take at most; the rest closes course errors.
FIELD_SHARE = 0.5
# Following the field of a line takes at most this times v / (its approach distance).
STEEPEST = 2.0 / np.sqrt(27.0)


# A course within this [rad] of the opposite one counts as beyond it: then the turn is to the right.
OPPOSITE = 1e-9


def wrapped(angle: Array) -> Array:
    """The angle in [-pi, pi), with half turns to the right."""
    return np.asarray(np.remainder(angle + (np.pi + OPPOSITE), 2 * np.pi) - (np.pi + OPPOSITE))


def approach(speed: Array | float, limits: Limits) -> Array:
    """(N,) m, the distance from a line at which the course is 45 deg towards it, for speeds [m/s].

    The field of a line turns at no more than STEEPEST v / approach (at approach / sqrt(2) from it): this
    distance leaves the other part of the turn rate free.
    """
    return np.asarray(STEEPEST * speed / (FIELD_SHARE * np.maximum(limits.omega_max, 1e-6)))


def turn(course: Array, wanted: Array, rate: Array | float, gain: float, limits: Limits) -> Array:
    """The course rate (N,) [rad/s] that brings courses to `wanted`, which itself turns at `rate`.

    gain  1/s; inside the limits the error decays as exp(-gain t)
    """
    omega = rate + gain * wrapped(wanted - course)
    return np.asarray(np.minimum(np.maximum(omega, -limits.omega_max), limits.omega_max))


def climb(z: Array, wanted: Array | float, rate: Array | float, gain: float, limits: Limits) -> Array:
    """The climb rate (N,) [m/s] that brings heights z to `wanted`, which itself changes at `rate`."""
    zeta = rate + gain * (wanted - z)
    return np.asarray(np.minimum(np.maximum(zeta, -limits.zeta_max), limits.zeta_max))
