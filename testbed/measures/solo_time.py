"""Computes how long the way to the goal takes without other vehicles."""

from __future__ import annotations

import numpy as np

from filters.model import Array, Command, Limits, State, View
from testbed.components.guidance import Guidance, NearIdentity

# The nominal speed is smooth along the way: more points change the time by less than a millisecond.
POINTS = 400


def solo_time(guidance: Guidance, limits: Limits, start: Array, goal: Array, goal_radius_m: float) -> Array:
    """(N,) s: the straight way from `start` to within the goal radius of `goal`, both (N, 3) m.

    Flown at the ground speed that the guidance asks for on it, inside the limits.
    """
    way = goal - start
    length = np.linalg.norm(way, axis=-1)
    left = np.maximum(length - goal_radius_m, 0.0)
    theta = np.arctan2(way[:, 1], way[:, 0])
    ahead = way / np.where(length > 0.0, length, 1.0)[:, None]
    share = (np.arange(POINTS) + 0.5)[:, None] / POINTS
    x, y, z = (start + ahead * (share * left)[..., None]).transpose(2, 0, 1)
    places = State(x, y, np.broadcast_to(theta, x.shape), z)
    # Level flight at the least speed: no guidance law of the catalogue looks at the rates.
    rates = Command(limits.v_min, np.zeros(len(start)), np.zeros(len(start)))
    if isinstance(guidance, NearIdentity):
        wanted = guidance(0.0, View(places, rates)).v  # takes any number of instants
    else:
        wanted = np.stack([guidance(0.0, View(places[k], rates)).v for k in range(POINTS)])
    pace = (1.0 / np.minimum(np.maximum(wanted, limits.v_min), limits.v_max)).sum(axis=0)
    return np.asarray(pace / POINTS * left)
