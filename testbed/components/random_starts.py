"""Draws starts and goals at random so that every pair begins in the safe set, well inside."""

from __future__ import annotations

import numpy as np

from filters.model import Array, State
from testbed.components.barriers import MAKERS
from testbed.errors import UserError
from testbed.scenario import fleet
from testbed.scenario.scenario import Scenario
from testbed.scenario.start import RandomGoals

# Draws for one vehicle before it is said that there is no room.
MOST_DRAWS = 10_000


def random_goals(
    s: Scenario, start: RandomGoals, rng: np.random.Generator
) -> tuple[Array, Array, Array, Array, Array]:
    """x, y, course and height (N,), goals (N, 3): vehicle by vehicle, drawn until it fits.

    A draw is x, y of the start, then of the goal, uniform in the square. It fits if the goal is far enough,
    and h of the scenario's barrier with every vehicle before it is at least `start_h_m`.
    Raises  UserError naming the first vehicle for which no draw fits
    """
    n, table = s.vehicles, fleet.barrier(s)
    barrier = MAKERS[type(table)](table, s)
    least = start.start_h_m
    if table.form == "squared":
        least = (s.d_safe_m + least) ** 2 - s.d_safe_m**2
    pose, goal = np.zeros((n, 4)), np.zeros((n, 3))
    for k in range(n):
        for _ in range(MOST_DRAWS):
            x, y, to_x, to_y = rng.uniform(-0.5, 0.5, 4) * start.square_m
            if np.hypot(to_x - x, to_y - y) < start.goal_distance_m:
                continue
            pose[k], goal[k, :2] = (x, y, np.arctan2(to_y - y, to_x - x), 0.0), (to_x, to_y)
            before = np.arange(k)
            if not k or (barrier.values(State.of(pose), before, np.full(k, k)).h >= least).all():
                break
        else:
            raise UserError(
                f"start.pattern: of {MOST_DRAWS} draws none gives vehicle {k + 1} of {n} h >="
                f" {start.start_h_m:g} m with all before it; fly fewer, make start.square_m larger or"
                " start.start_h_m smaller"
            )
    return pose[:, 0], pose[:, 1], pose[:, 2], pose[:, 3], goal
