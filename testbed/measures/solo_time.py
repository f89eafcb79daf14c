"""What the way to the goal would have taken without anybody to avoid."""

from __future__ import annotations

import numpy as np

from filters.model import Array, Limits, State
from testbed.components.guidance import Guidance, NearIdentity

# The nominal speed is smooth along the way: more points change the time by less than a millisecond.
POINTS = 400


def solo_time(nominal: Guidance, limits: Limits, start: Array, goal: Array, goal_radius_m: float) -> Array:
    """(N,) s: the straight way from `start` to within the goal radius of `goal`, both (N, 3) m.

    Flown at the ground speed the nominal controller asks for on it, inside the limits.
    """
    way = goal - start
    length = np.linalg.norm(way, axis=-1)
    left = np.maximum(length - goal_radius_m, 0.0)
    theta = np.arctan2(way[:, 1], way[:, 0])
    ahead = way / np.where(length > 0.0, length, 1.0)[:, None]
    share = (np.arange(POINTS) + 0.5)[:, None] / POINTS
    x, y, z = (start + ahead * (share * left)[..., None]).transpose(2, 0, 1)
    places = State(x, y, np.broadcast_to(theta, x.shape), z)
    if isinstance(nominal, NearIdentity):
        wanted = nominal(0.0, places).v  # takes any number of instants
    else:
        wanted = np.stack([nominal(0.0, places[k]).v for k in range(POINTS)])
    pace = (1.0 / np.minimum(np.maximum(wanted, limits.v_min), limits.v_max)).sum(axis=0)
    return np.asarray(pace / POINTS * left)
