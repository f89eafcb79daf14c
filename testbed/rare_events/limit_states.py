"""Limit states whose probability is known in closed form, to check estimates against."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from filters.model import Array
from testbed.rare_events.estimate import LimitState


@dataclass(frozen=True)
class Known:
    """A limit state of `size` standard normal numbers, and the probability that it is below 0."""

    name: str
    size: int
    state: LimitState
    probability: float


def linear(probability: float, size: int = 4) -> Known:
    """beta - u . z, u a unit vector: P = Phi(-beta)."""
    from scipy.stats import norm

    beta, u = float(norm.isf(probability)), np.full(size, 1.0 / sqrt(size))
    return Known(f"plane, {size} numbers", size, lambda z: beta - z @ u, probability)


def sphere(probability: float, size: int = 3) -> Known:
    """beta - |z|: P that a chi variable exceeds beta. The event lies in every direction."""
    from scipy.stats import chi

    beta = float(chi(size).isf(probability))
    return Known(f"sphere, {size} numbers", size, lambda z: beta - np.linalg.norm(z, axis=1), probability)


def passing(probability: float, offset_m: float = 30.0, least_m: float = 5.0) -> Known:
    """Two that fly opposite straight courses `offset_m` apart, their lateral offsets normal.

    They miss each other by |offset + s (z1 - z2)|; the event is a miss by less than `least_m`. The deviation
    s is the one that makes it as probable as wanted.
    """
    from scipy.optimize import brentq
    from scipy.stats import norm

    def chance(s: float) -> float:
        wide = s * sqrt(2.0)
        return float(norm.sf((offset_m - least_m) / wide) - norm.sf((offset_m + least_m) / wide))

    s = brentq(lambda s: chance(s) - probability, 1.0, offset_m / 2)
    return Known(
        "two pass, normal offsets",
        2,
        lambda z: np.abs(offset_m + s * (z[:, 0] - z[:, 1])) - least_m,
        probability,
    )


def crossing(probability: float, angle_deg: float = 90.0, half_width_m: float = 10.0) -> Known:
    """Two of one speed on straight courses that cross; lateral offsets uniform within `half_width_m`.

    Both are at the crossing at one time, but for their offsets a and b to the left of their courses: then the
    place of one relative to the other is b n2 - a n1, and it moves along e2 - e1, with e the courses and n
    their normals. The miss distance is that place's part across the motion. It is m + w (a + b) for the
    geometry's weight w, and the sum of two uniform numbers is triangular. The nominal miss distance m is the
    one that makes a miss by less than 1 m, to either side, as probable as wanted.
    """
    from scipy.optimize import brentq
    from scipy.special import ndtr

    turn = np.radians(angle_deg)
    e1, e2 = np.array([1.0, 0.0]), np.array([np.cos(turn), np.sin(turn)])
    n1, n2 = np.array([0.0, 1.0]), np.array([-np.sin(turn), np.cos(turn)])
    across = np.array([-(e2 - e1)[1], (e2 - e1)[0]]) / np.linalg.norm(e2 - e1)
    weights = half_width_m * np.array([-n1 @ across, n2 @ across])
    first, second = np.abs(weights)
    assert abs(first - second) < 1e-9 * half_width_m, "courses of one speed weigh both offsets alike"

    def below(x: float) -> float:
        """P(weights . (u1, u2) < x), the u uniform between -1 and 1."""
        share = float(np.clip(x / (2 * first), -1.0, 1.0))
        return 0.5 * (1 + share) ** 2 if share < 0 else 1 - 0.5 * (1 - share) ** 2

    def chance(miss: float) -> float:
        return below(1.0 - miss) - below(-1.0 - miss)

    miss = brentq(lambda m: chance(m) - probability, 1.0, 2 * first + 1.0, xtol=1e-14)

    def state(z: Array) -> Array:
        return np.asarray(np.abs(miss + (2.0 * ndtr(z) - 1.0) @ weights) - 1.0)

    return Known(f"two cross at {angle_deg:g} deg, uniform offsets", 2, state, probability)
