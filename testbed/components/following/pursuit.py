"""Turns vehicles towards a place, and waits where it lies inside the circle that a turn would fly."""

from __future__ import annotations

import numpy as np

from filters.model import Array, Limits, State
from testbed.components.following.course import turn, wrapped

# Of the radius at the turn rate limit, that of the circle which a goal has to lie outside of: the rest is for
# the end of the turn, which is slower.
CIRCLE = 1.2


# To places further off its course than this [rad], a vehicle with a preferred sense turns in that.
AGAINST = np.pi / 2


def pursue(
    state: State, place: Array, speed: Array, gain: float, limits: Limits, sense: float = 0.0
) -> Array:
    """The course rate (N,) [rad/s] that turns vehicles at `state` (N,) towards `place` (N, 2) m.

    speed  (N,) m/s;  gain  1/s, on the angle to the place
    sense  +1 or -1 of long turns; 0: the shorter way

    A vehicle that turns at once towards a place beside it, nearer than its turn circle, flies around it for
    ever. It flies straight on instead until the place is outside that circle.
    """
    offset = (place[:, 0] - state.x) + 1j * (place[:, 1] - state.y)
    seen = offset * np.exp(-1j * state.theta)
    course = np.angle(offset)
    omega = turn(state.theta, course, 0.0, gain, limits)
    if sense:
        long = np.abs(wrapped(course - state.theta)) > AGAINST
        omega = np.where(long, sense * limits.omega_max, omega)
    circle = 2.0 * CIRCLE * speed / np.maximum(limits.omega_max, 1e-6) * np.abs(seen.imag)
    return np.asarray(np.where(np.abs(seen) ** 2 >= circle, omega, 0.0))
