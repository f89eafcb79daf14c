"""Initial states and goals of a scenario, and the random streams that everything draws from."""

from __future__ import annotations

import numpy as np

from filters.model import Array, State
from testbed.components.random_starts import random_goals
from testbed.scenario import guidance_rules
from testbed.scenario.scenario import Scenario
from testbed.scenario.start import Circle, RandomGoals, Streams

# Append only: a stream's position decides its numbers.
STREAMS = ("start", "plant", "gust", "noise", "network", "other")


def generators(seed: int) -> dict[str, np.random.Generator]:
    """Independent named generators, all from one seed."""
    children = np.random.SeedSequence(seed).spawn(len(STREAMS))
    return {name: np.random.default_rng(child) for name, child in zip(STREAMS, children, strict=True)}


def places(scenario: Scenario, rng: np.random.Generator) -> tuple[State, Array]:
    """Initial states (N,) and goals (N, 3) m.

    On the circle vehicle i (from 0) stands at angle pi + i 2 pi / k, faces the centre plus an offset, and
    its goal is the antipode (Squires et al. 2022, III.D, without the goal's stray pi).
    Perturbations are drawn whatever their size, so that equal seeds stay paired across scenarios; offsets
    are added to them.
    Raises  UserError where no safe places are found for random goals
    """
    start, n = scenario.start, scenario.vehicles
    lateral, turn, height = rng.uniform(-1.0, 1.0, (3, n))
    if isinstance(start, Circle):
        angle = np.arange(n) * (2 * np.pi / n)
        x, y = start.radius_m * np.cos(angle + np.pi), start.radius_m * np.sin(angle + np.pi)
        theta = angle + np.radians(start.course_offset_deg)
        z = np.resize(np.asarray(start.heights_m), n)
        goal = np.stack(
            [start.radius_m * np.cos(angle), start.radius_m * np.sin(angle), np.zeros(n)], axis=-1
        )
    elif isinstance(start, RandomGoals):
        x, y, theta, z, goal = random_goals(scenario, start, rng)
    elif isinstance(start, Streams):
        x, y, theta, z, goal = _streams(start, n)
    else:
        p = start.places
        x, y, z = (np.array([getattr(q, name) for q in p]) for name in ("x_m", "y_m", "z_m"))
        theta = np.radians([q.course_deg for q in p])
        goal = np.array([[q.goal_x_m, q.goal_y_m, q.goal_z_m] for q in p])
    if scenario.vehicle:
        x, y, theta, z, goal = _own_places(scenario, x, y, theta, z, goal)
    for k, own in guidance_rules.goals(scenario).items():
        goal[k] = own
    if start.round_decimals is not None:
        x, y = np.round(x, start.round_decimals), np.round(y, start.round_decimals)
        theta = np.radians(np.round(np.degrees(theta), start.round_decimals))
    across = lateral * start.lateral_perturbation_m + _each(start.lateral_offsets_m, n)
    x, y = x - across * np.sin(theta), y + across * np.cos(theta)
    turned = turn * np.radians(start.heading_perturbation_deg) + np.radians(
        _each(start.heading_offsets_deg, n)
    )
    up = height * start.height_perturbation_m + _each(start.height_offsets_m, n)
    return State(x, y, theta + turned, z + up), goal


def _streams(start: Streams, n: int) -> tuple[Array, Array, Array, Array, Array]:
    """x, y, course, height (n,) and goal (n, 3) of two streams that cross at the origin."""
    place, most = np.arange(n) // 2, (n + 1) // 2 - 1
    theta = np.radians(start.crossing_deg) * (np.arange(n) % 2)
    behind = start.ahead_m + start.spacing_m * place
    beyond = start.ahead_m + start.spacing_m * (most - place)
    ahead = np.stack([np.cos(theta), np.sin(theta), np.zeros(n)], axis=-1)
    return -behind * ahead[:, 0], -behind * ahead[:, 1], theta, np.zeros(n), beyond[:, None] * ahead


def _own_places(
    scenario: Scenario, x: Array, y: Array, theta: Array, z: Array, goal: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Places and goals with those that vehicles have of their own; who says x and no height is at 0."""
    x, y, theta, z, goal = (a.copy() for a in (x, y, theta, z, goal))
    for k, v in enumerate(scenario.vehicle):
        if v.x_m is not None and v.y_m is not None and v.course_deg is not None:
            x[k], y[k], theta[k], z[k] = v.x_m, v.y_m, np.radians(v.course_deg), 0.0
        if v.goal_x_m is not None and v.goal_y_m is not None:
            goal[k] = v.goal_x_m, v.goal_y_m, 0.0
        z[k] = z[k] if v.z_m is None else v.z_m
        goal[k, 2] = goal[k, 2] if v.goal_z_m is None else v.goal_z_m
    return x, y, theta, z, goal


def _each(offsets: list[float], n: int) -> Array:
    """One offset per vehicle (n,); none listed is none."""
    return np.asarray(offsets) if offsets else np.zeros(n)
