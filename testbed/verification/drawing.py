"""Draws random starts and goals again, and lays out streams, from the scenario and its seed."""

from __future__ import annotations

import json
from functools import lru_cache
from typing import Any

import numpy as np

from testbed.verification.future import Pose, future

Array = np.ndarray
PATTERNS = ("random-goals", "streams")


def places(s: dict[str, Any]) -> tuple[Pose, Array]:
    """Poses (N,) before perturbations, and goals (N, 3) m."""
    told = {name: s[name] for name in ("start", "vehicles", "barrier", "d_safe_m", "seed")}
    return _places(json.dumps(told))


@lru_cache(maxsize=8)
def _places(told: str) -> tuple[Pose, Array]:
    s = json.loads(told)
    return _drawn(s) if s["start"]["pattern"] == "random-goals" else _streams(s["start"], s["vehicles"])


def _streams(a: dict[str, Any], n: int) -> tuple[Pose, Array]:
    course = np.where(np.arange(n) % 2 == 1, np.radians(a["crossing_deg"]), 0.0)
    far = a["ahead_m"] + a["spacing_m"] * (np.arange(n) // 2)
    begin = -far * np.exp(1j * course)
    # Everybody flies as far as the first: to the crossing, from there on, and past the others' places.
    end = begin + (2 * a["ahead_m"] + a["spacing_m"] * ((n - 1) // 2)) * np.exp(1j * course)
    flat = np.zeros(n)
    return Pose(np.stack([begin.real, begin.imag, flat], 1), course), np.stack([end.real, end.imag, flat], 1)


def _drawn(s: dict[str, Any]) -> tuple[Pose, Array]:
    a, n = s["start"], s["vehicles"]
    rng = np.random.default_rng(np.random.SeedSequence(s["seed"]).spawn(1)[0])
    rng.uniform(-1.0, 1.0, (3, n))  # the perturbations come first
    i, j = np.triu_indices(n, 1)
    every = future(s, i, j)
    if every is None:
        raise ValueError("this manoeuvre is not covered")
    least = a["start_h_m"]
    if s["barrier"]["form"] == "squared":
        least = (s["d_safe_m"] + least) ** 2 - s["d_safe_m"] ** 2
    position, theta, goal = np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3))
    for k in range(n):
        pairs = np.flatnonzero(j == k)
        of = every.of(pairs) if k else None
        while True:
            begin, end = (rng.uniform(-0.5, 0.5, 4) * a["square_m"]).reshape(2, 2)
            way = complex(*(end - begin))
            if abs(way) < a["goal_distance_m"]:
                continue
            position[k, :2], goal[k, :2], theta[k] = begin, end, np.angle(way)
            now = Pose(position, theta)
            if of is None or (of.h(now.of(i[pairs]), now.of(j[pairs])) >= least).all():
                break
    return Pose(position, theta), goal
