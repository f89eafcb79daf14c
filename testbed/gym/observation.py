"""What a vehicle observes, as one vector: itself, its goal, the others in the frame of its own course.

Ahead is along its course, left is to the left of it, up is up; m, m/s and rad/s.
"""

from __future__ import annotations

import numpy as np

from filters.model import Array, State, View

OWN = ("v_mps", "omega_radps", "zeta_mps", "goal_ahead_m", "goal_left_m", "goal_up_m")
OTHER = (
    "known",
    "ahead_m",
    "left_m",
    "up_m",
    "v_ahead_mps",
    "v_left_mps",
    "v_up_mps",
    "omega_radps",
)


def names(vehicle: int, vehicles: int) -> tuple[str, ...]:
    """What each entry of the vector of `vehicle` is, with its unit; vehicles count from 1.

    Its own rates and where its goal is; then of every other vehicle, in the order of their numbers: 1 if it
    is known (0: it has left, is out of range or has not been heard of, and its entries are 0), where it is,
    its velocity over the ground relative to this vehicle's, and its course rate.
    """
    others = (k for k in range(1, vehicles + 1) if k != vehicle)
    return (*OWN, *(f"{k}_{name}" for k in others for name in OTHER))


def observe(view: View, vehicle: int, goal: Array) -> Array:
    """The vector of `vehicle` (from 0).

    view  what the vehicles know, arrays (N,) or (N, N)
    goal  (N, 3) m
    """
    own = view.of(vehicle)
    state, rates = own.state, own.rates
    frame = np.array([np.cos(state.theta[vehicle]), np.sin(state.theta[vehicle])])
    place = state.position
    velocity = np.stack([rates.v * np.cos(state.theta), rates.v * np.sin(state.theta), rates.zeta], axis=-1)
    towards = _turned(goal[vehicle] - place[vehicle], frame)
    others = np.arange(len(state)) != vehicle
    seen = np.zeros((int(others.sum()), len(OTHER)))
    seen[:, 0] = known(view, vehicle)[others]
    seen[:, 1:4] = _turned(place[others] - place[vehicle], frame)
    seen[:, 4:7] = _turned(velocity[others] - velocity[vehicle], frame)
    seen[:, 7] = rates.omega[others]
    seen[seen[:, 0] == 0.0] = 0.0  # the pose of one that is not known has no meaning
    return np.concatenate(
        [[rates.v[vehicle], rates.omega[vehicle], rates.zeta[vehicle]], towards, seen.ravel()]
    )


def known(view: View, vehicle: int) -> np.ndarray:
    """(N,) bool: whom `vehicle` (from 0) knows."""
    n = np.arange(len(view.state))
    return view.knows(np.full_like(n, vehicle), n)


def distance(state: State, vehicle: int, there: np.ndarray) -> float:
    """Distance [m] of `vehicle` (from 0) to the nearest of those `there` (N,) bool; inf if there is none."""
    others = there & (np.arange(len(state)) != vehicle)
    if not there[vehicle] or not others.any():
        return float("inf")
    place = state.position
    return float(np.linalg.norm(place[others] - place[vehicle], axis=-1).min())


def _turned(vectors: Array, frame: Array) -> Array:
    """Vectors (..., 3), east-north-up, as ahead, left and up of the course with cosine and sine `frame`."""
    c, s = frame
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x + s * y, c * y - s * x, vectors[..., 2]], axis=-1)
