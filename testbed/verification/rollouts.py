"""Computes h by flying two vehicles on along different constant manoeuvres: sampled densely, then bisected.

Where one flies straight or both turn at different rates, the squared range along the manoeuvres is no
constant and one harmonic. Its least value is looked for over a common period of both turns, or until the
vehicles have parted for good.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from testbed.verification.recorded import Array

# Angle turned, and share of a straight flight's turn-sized radius, between samples [rad].
STEP = 0.05
# Of turn rates, the largest numbers of a ratio that closes the relative orbit.
RATIO = 64
HALVINGS = 60
# Numbers held at a time.
BLOCK = 2_000_000

# One vehicle of a pair: pose (x, y, theta, z) and manoeuvre (v, omega, zeta), arrays of one shape.
Side = tuple[tuple[Array, ...], tuple[Array, ...]]


def least(a: Side, b: Side) -> tuple[Array, Array]:
    """The time (M,) s at which M pairs are nearest, and by how much a second such time is farther [m^2]."""
    horizon, fastest = _horizon(a, b)
    count = int(np.ceil(np.max(horizon * fastest, initial=1.0) / STEP)) + 2
    best, apart = np.empty(horizon.size), np.empty(horizon.size)
    rows = max(1, BLOCK // count)
    for first in range(0, horizon.size, rows):
        some = slice(first, first + rows)
        best[some], apart[some] = _searched(_cut(a, some), _cut(b, some), horizon[some], count)
    return best, apart


def after(side: Side, t: Array) -> tuple[Array, Array, Array]:
    """Where a vehicle (M,) has got to after t (M,) or (M, K): east, north and up from its start."""
    (_, _, theta, _), (v, omega, zeta) = (_like(part, t) for part in side)
    half = 0.5 * omega * t
    chord = v * t * np.sinc(half / np.pi)
    return chord * np.cos(theta + half), chord * np.sin(theta + half), zeta * t


def offset(a: Side, b: Side, t: Array) -> tuple[Array, Array, Array]:
    """The offset of a from b after t, of t's shape."""
    (xa, ya, _, za), (xb, yb, _, zb) = (_like(side[0], t) for side in (a, b))
    east, north, up = (p - q for p, q in zip(after(a, t), after(b, t), strict=True))
    return xa - xb + east, ya - yb + north, za - zb + up


def _searched(a: Side, b: Side, horizon: Array, count: int) -> tuple[Array, Array]:
    t = horizon[:, None] * np.linspace(0.0, 1.0, count)
    square = np.asarray(sum(x * x for x in offset(a, b, t)))
    rows, found = np.arange(horizon.size), []
    for again in (True, False):
        k = np.argmin(square, axis=1)
        low, high = t[rows, np.maximum(k - 1, 0)], t[rows, np.minimum(k + 1, count - 1)]
        at = _bisected(a, b, low, high)
        there = np.asarray(sum(x * x for x in offset(a, b, at)))
        found.append((at, np.where(np.isfinite(square[rows, k]), there, np.inf)))
        if again:  # the second is looked for away from the first: past the rise on either side of it
            square = np.where(_basin(square, k), np.inf, square)
    (one, at_one), (other, at_other) = found
    first = at_one <= at_other
    return np.where(first, one, other), np.abs(at_one - at_other)


def _basin(square: Array, k: Array) -> Array:
    """The samples from which square falls all the way down to sample k."""
    step, rows = np.diff(square, axis=1), np.arange(square.shape[1])
    right = np.cumsum(np.where(rows[None, :-1] >= k[:, None], step < 0.0, False), axis=1)
    left = np.cumsum(np.where(rows[None, :-1] < k[:, None], step > 0.0, False)[:, ::-1], axis=1)[:, ::-1]
    inside = np.ones(square.shape, dtype=bool)
    inside[:, 1:] &= (right == 0) | (rows[None, 1:] <= k[:, None])
    inside[:, :-1] &= (left == 0) | (rows[None, :-1] >= k[:, None])
    return inside


def _bisected(a: Side, b: Side, low: Array, high: Array) -> Array:
    """Where the range stops shrinking between low and high (M,); an end where it does not."""
    for _ in range(HALVINGS):
        t = 0.5 * (low + high)
        rising = _slope(a, b, t) > 0.0
        low, high = np.where(rising, low, t), np.where(rising, t, high)
    return 0.5 * (low + high)


def _slope(a: Side, b: Side, t: Array) -> Array:
    velocity = []
    for (_, _, theta, _), (v, omega, zeta) in (a, b):
        course = theta + omega * t
        velocity.append((v * np.cos(course), v * np.sin(course), zeta))
    closing = (p - q for p, q in zip(*velocity, strict=True))
    return np.asarray(sum(x * w for x, w in zip(offset(a, b, t), closing, strict=True)))


def _horizon(a: Side, b: Side) -> tuple[Array, Array]:
    """(M,) s: how long to look, and the rate [rad/s] at which the range may change its mind."""
    centre, drift = np.zeros((2, *a[0][0].shape), dtype=complex)
    arm = np.zeros(a[0][0].shape)
    for sign, ((x, y, theta, _), (v, omega, _)) in ((1.0, a), (-1.0, b)):
        straight = omega == 0.0
        radius = np.where(straight, 0.0, v / np.where(straight, 1.0, omega))
        heading = np.exp(1j * theta)
        centre = centre + sign * (x + 1j * y + 1j * radius * heading)
        drift = drift + sign * np.where(straight, v * heading, 0.0)
        arm = arm + np.abs(radius)
    climb, height = a[1][2] - b[1][2], a[0][3] - b[0][3]
    pace = np.hypot(np.abs(drift), climb)
    reach = np.sqrt(sum(x * x for x in offset(a, b, np.zeros(centre.shape)))) + arm
    toward = (centre * drift.conj()).real + height * climb
    gap = np.abs(centre) ** 2 + height**2 - reach**2
    # |centre + drift t| = reach for the last time.
    square = np.maximum(toward**2 - pace**2 * gap, 0.0)
    parted = (np.sqrt(square) - toward) / np.where(pace > 0.0, pace, 1.0) ** 2
    horizon = np.where(pace > 0.0, np.maximum(parted, 0.0) * 1.001 + 1e-3, 0.0)
    for wa, wb in {(float(p), float(q)) for p, q in zip(a[1][1], b[1][1], strict=True)}:
        if wa and wb:
            both = (a[1][1] == wa) & (b[1][1] == wb) & (climb == 0.0)
            ratio = Fraction(abs(wa / wb)).limit_denominator(RATIO)
            horizon = np.where(both, 2.0 * np.pi * ratio.denominator / abs(wb), horizon)
    # What turns fastest, and for straight flights at least a hundred samples.
    rate = np.maximum(np.abs(a[1][1]), np.abs(b[1][1]))
    return horizon, np.maximum(rate, 100.0 * STEP / np.maximum(horizon, 1e-6))


def _like(part: tuple[Array, ...], t: Array) -> tuple[Array, ...]:
    return part if t.ndim == 1 else tuple(x[:, None] for x in part)


def _cut(side: Side, some: slice) -> Side:
    pose, gamma = (tuple(x[some] for x in part) for part in side)
    return pose, gamma
