"""Judges G9: from instants along a run the vehicles really fly the evading manoeuvre gamma.

h promises that if all fly gamma for ever from here on, no pair comes closer than h says. Every theorem of
the paper rests on that; here it is flown, from branches of the recorded flight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from aircraft.plant import Plant
from filters.barriers.pairs import Barrier
from filters.model import Array, Command, Limits, State
from testbed.claims.guarantees import H_TOLERANCE_M
from testbed.claims.judging import decide, premise_not_met
from testbed.claims.registry import MANOEUVRE_KEEPS_DS
from testbed.measures.near_misses import NearMisses
from testbed.records.verdict import Verdict
from testbed.scenario.scenario import Scenario

# How often the air is asked and the plant stepped while gamma is flown [s].
PERIOD_S = 0.05
# Long enough for straight flyers of the paper to be past each other.
STRAIGHT_HORIZON_S = 60.0


def instants(s: Scenario, near_misses: NearMisses, end_t: float) -> list[float]:
    """When to branch first: a third evenly along the run, a third where pairs drew nearest; [s], ascending.

    Whole filter periods; of the nearest pairs the end of their approach and its beginning. The rest of
    `checks.manoeuvre_instants` is for `fly` to place.
    """
    dt, n = s.rates.filter_dt_s, s.checks.manoeuvre_instants
    spread = max(1, n // 3)
    steps = {round(k * end_t / spread / dt) for k in range(spread)}
    for p in np.argsort(near_misses.least):
        if not np.isfinite(near_misses.least[p]):
            break
        for t in (near_misses.last[p], near_misses.first[p]):
            if len(steps) < max(2, 2 * n // 3):
                steps.add(round(t / dt))
    return [k * dt for k in sorted(steps)]


def fly(
    s: Scenario,
    branch: Callable[[float], Plant],
    wind: Callable[[float, State], Array],
    barrier: Barrier,
    limits: Limits,
    when: list[float],
    i: np.ndarray,
    j: np.ndarray,
) -> Verdict:
    """G9: one verdict, its detail a row per instant.

    branch  a plant at a time of the run
    wind    the air's motion (N, 3) m/s at a time and state
    when    instants to start with; what they leave of `checks.manoeuvre_instants` goes, one at a time,
            halfway between the worst instant so far and the worse of its neighbours
    i, j    vehicles of each pair, from 0
    """
    v = MANOEUVRE_KEEPS_DS.unjudged(s.barrier.form, s.goal_radius_m)
    if not i.size:
        return v.but(why="no pair")
    gamma = barrier.manoeuvre(s.vehicles)
    if gamma is None or s.barrier.kind == "euclidean":
        return v.but(why="the barrier has no one manoeuvre")
    dt = s.rates.filter_dt_s
    rows: dict[int, dict[str, Any]] = {}
    waiting = [round(t / dt) for t in when]
    for _ in range(s.checks.manoeuvre_instants):
        step = waiting.pop(0) if waiting else _between(rows)
        if step is None:
            break
        plant = branch(step * dt)
        h = barrier.values(plant.state()).h
        least, fault = _least_distance(plant, wind, limits.clip(gamma), step * dt, i, j)
        rows[step] = _row(s, step * dt, h, least, i, j) | {"fault": fault}
    branches = [rows[step] for step in sorted(rows)]
    v = v.but(detail={"branches": branches})
    safe = [row for row in branches if row["safe_pairs"]]
    if not safe:
        return premise_not_met(v, "no pair was in the safe set at any of these instants")
    worst = min(safe, key=lambda row: row["least_m"])
    value, fault = worst["least_m"], next((row["fault"] for row in safe if row["fault"]), "")
    v = v.but(
        value=value,
        bound=s.d_safe_m,
        margin=value - s.d_safe_m,
        instant=worst["t_s"],
        vehicles=tuple(worst["vehicles"]),
        why=fault or f"flown from h = {worst['h']:.2f}, which promises {worst['promised_m']:.2f} m",
    )
    return decide(v, value >= s.d_safe_m - H_TOLERANCE_M and not fault, None)


def _row(s: Scenario, t: float, h: Array, least: Array, i: np.ndarray, j: np.ndarray) -> dict[str, Any]:
    """What came of one instant: its worst safe pair, and how far any safe pair fell short of h's promise."""
    safe = h >= 0.0
    row: dict[str, Any] = {"t_s": t, "safe_pairs": int(safe.sum())}
    if not safe.any():
        return row
    promised = h + s.d_safe_m if s.barrier.form == "root" else np.sqrt(np.maximum(h + s.d_safe_m**2, 0.0))
    p = int(np.argmin(np.where(safe, least, np.inf)))
    row |= {"least_m": float(least[p]), "vehicles": [int(i[p]) + 1, int(j[p]) + 1], "h": float(h[p])}
    return row | {"promised_m": float(promised[p]), "short_m": float(np.max((promised - least)[safe]))}


def _between(rows: dict[int, dict[str, Any]]) -> int | None:
    """A filter step between the worst one and its worse neighbour; None where there is none left."""
    steps = sorted(rows)
    reached = {step: rows[step].get("least_m", np.inf) for step in steps}
    worst = steps.index(min(steps, key=lambda step: reached[step]))
    gaps = [(steps[k], steps[k + 1]) for k in (worst - 1, worst) if 0 <= k < len(steps) - 1]
    for low, high in sorted(gaps, key=lambda gap: reached[gap[0]] + reached[gap[1]]):
        if high - low > 1:
            return (low + high) // 2
    return None


def _least_distance(
    plant: Plant,
    wind: Callable[[float, State], Array],
    gamma: Command,
    t: float,
    i: np.ndarray,
    j: np.ndarray,
) -> tuple[Array, str]:
    """Least distance of each pair (P,) m while all fly gamma for its period, and what ended it early."""
    turning = np.abs(gamma.omega) > 1e-9
    horizon = float(2 * np.pi / np.abs(gamma.omega[turning]).min()) if turning.any() else STRAIGHT_HORIZON_S
    n = max(1, round(PERIOD_S / plant.dt))
    position = plant.state().position
    least = np.linalg.norm(position[i] - position[j], axis=-1)
    for k in range(int(np.ceil(horizon / (n * plant.dt)))):
        track = plant.step(gamma, wind(t + k * n * plant.dt, plant.state()), n)
        fault = next((f"vehicle {v + 1}: {what}" for v, what in enumerate(plant.faults()) if what), "")
        if fault:
            return least, f"{fault} while flying gamma from {t:g} s"
        least = np.minimum(least, np.linalg.norm(track[:, i] - track[:, j], axis=-1).min(axis=0))
    return least, ""
