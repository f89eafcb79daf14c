"""Derives how far vehicles must see each other so that a pair is safe, h >= 0, when it is first seen.

The proof is in docs/guide/range.md. In short: two vehicles that turn for ever at one rate on circles of radii
r_i and r_j come closer by at most 2 (r_i + r_j), whatever their headings. Between the instant at which a pair
was still out of range and the first decision that knows of it, both may close in; the worst is a pair that
passes nearly abreast and turns in.
"""

from __future__ import annotations

import numpy as np

from filters.barriers.closed_form import TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.barriers.pairs import Barrier, ForwardDifference, all_pairs
from filters.barriers.per_pair import PerPair
from filters.model import Array, Limits

# Turn rates and climb rates of two manoeuvres that count as one.
ALIKE = 1e-12


def required_range(barrier: Barrier, limits: Limits, unseen_s: float) -> Array:
    """The least range (P,) m of each pair i < j with which h >= 0 whenever the pair is first seen.

    barrier   the filter's own
    limits    (N,) what the vehicles can fly; those of unicycles, which fly their inputs exactly
    unseen_s  s, the longest time between an instant at which the pair was out of range and the first decision
              that knows of it: a filter period, and the age of what is known
    inf where no finite range is enough: two that fly straight at each other meet, however far away they were.
    Raises  ValueError for a time that is negative or not finite
    """
    if not (np.isfinite(unseen_s) and unseen_s >= 0.0):
        raise ValueError(f"the time unseen must be finite and not negative, got {unseen_s} s")
    inner = barrier.barrier if isinstance(barrier, ForwardDifference) else barrier
    n = len(limits)
    i, j = all_pairs(n)
    climbed = (limits.zeta_max[i] + limits.zeta_max[j]) * unseen_s
    if isinstance(inner, EuclideanBarrier):
        flown = (limits.v_max[i] + limits.v_max[j]) * unseen_s
        return np.asarray(inner.d_safe + np.hypot(flown, climbed))
    gammas = _manoeuvres(inner, n)
    if gammas is None:
        return np.full(i.size, np.inf)
    gamma_i, gamma_j = gammas
    rate = np.abs(gamma_i[:, 1])
    turning = (np.abs(gamma_i[:, 1:] - gamma_j[:, 1:]).max(axis=1) <= ALIKE) & (rate > 0.0)
    rate = np.where(turning, rate, 1.0)
    radius_i, radius_j = gamma_i[:, 0] / rate, gamma_j[:, 0] / rate
    reach = radius_i + radius_j
    inward = reach + sum(
        closing(radius, limits.v_max[k], limits.omega_max[k], unseen_s)
        for radius, k in ((radius_i, i), (radius_j, j))
    )
    return np.where(turning, np.hypot(inward, climbed) + _clearance(inner, reach), np.inf)


def closing(radius: Array, v_max: Array, omega_max: Array, seconds: float) -> Array:
    """By how much one vehicle's heading and motion let the pair's circles come together, (P,) m.

    The largest over epsilon in [0, pi/2] of
        radius cos(epsilon) + v_max * integral over [0, seconds] of sin(min(epsilon + omega_max s, pi/2)) ds,
    epsilon being how far from abreast the vehicle heads inwards at first sight: abreast its circle reaches in
    most, heading inwards it came from farther away. `radius` where seconds is 0.
    """
    v, omega, t = (np.asarray(x, dtype=float) for x in (v_max, omega_max, seconds))
    turns = omega > 0.0
    rate = np.where(turns, omega, 1.0)
    rho = v / rate
    # Still turning at first sight: an amplitude of cosine and sine.
    angle = rate * t
    half = np.sin(0.5 * angle)
    turning = np.sqrt(radius**2 + 4.0 * rho * (radius + rho) * half**2)
    epsilon = np.arctan2(rho * np.sin(angle), radius + 2.0 * rho * half**2)
    # Longer ago it headed straight in, and turned out of that for the last quarter turn less epsilon.
    late = np.arcsin(rho / (radius + rho))
    straight = (radius + rho) * np.cos(late) + v * t - rho * (0.5 * np.pi - late)
    found = np.where(epsilon + angle <= 0.5 * np.pi, turning, straight)
    return np.asarray(np.where(turns, found, np.hypot(radius, v * t)))


def _manoeuvres(barrier: Barrier, n: int) -> tuple[Array, Array] | None:
    """gamma (P, 3) of both vehicles of every pair; None where there is none."""
    i, j = all_pairs(n)
    if isinstance(barrier, PerPair):
        return barrier.manoeuvres(i, j, n)
    gamma = barrier.manoeuvre(n)
    if gamma is None:
        return None
    flown = gamma.array()
    return flown[i], flown[j]


def _clearance(barrier: Barrier, reach: Array) -> Array:
    """The distance (P,) m that h = 0 stands for at most: Ds, and what rounding and smoothing add to it."""
    one = barrier.barriers[0] if isinstance(barrier, PerPair) else barrier
    delta, smoothing = (one.delta, one.smoothing) if isinstance(one, TurnBarrier) else (0.0, 0.0)
    # |Z| is at least 2 reach^2 where the circles lie outside each other.
    amplitude = 2.0 * reach**2
    smoothed = smoothing**2 / (np.hypot(amplitude, smoothing) + amplitude)
    return np.asarray(np.sqrt(barrier.d_safe**2 + (2.0 + np.sqrt(2.0)) * delta + smoothed))
