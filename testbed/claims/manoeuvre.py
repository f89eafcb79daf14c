"""Judges G9: from instants along a run the vehicles really fly the evading manoeuvre gamma.

h promises that if all fly gamma for ever from here on, no pair comes closer than h says. Every theorem of
the paper rests on that; here it is flown, from branches of the recorded flight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from aircraft.plant import Plant
from filters.barriers.pairs import Barrier
from filters.model import Array, Command, Limits, State
from testbed.claims.guarantees import H_TOLERANCE_M
from testbed.claims.judging import decide, finer, leave_open, premise_not_met
from testbed.claims.registry import MANOEUVRE_KEEPS_DS
from testbed.measures.between_samples import Bends, closest_on_arcs, nearest_on_chords
from testbed.measures.near_misses import NearMisses
from testbed.measures.roles import Mask, Roles
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
    arcs: bool,
    who: Roles | None = None,
    left_s: Array | None = None,
) -> Verdict:
    """G9: one verdict, its detail a row per instant.

    branch  a plant at a time of the run
    wind    the air's motion (N, 3) m/s at a time and state
    when    instants to start with; what they leave of `checks.manoeuvre_instants` goes, one at a time,
            halfway between the worst instant so far and the worse of its neighbours
    i, j    vehicles of each pair, from 0
    arcs    whether the vehicles are unicycles, which fly gamma exactly
    who     who is under the filter: intruders do not fly gamma, but on; None without intruders
    left_s  (N,) s, when each vehicle left, nan if it did not: then its pairs are not looked at any more
    """
    v = MANOEUVRE_KEEPS_DS.unjudged(s.barrier.form, s.goal_radius_m)
    if who is not None:
        i, j = i[who.ours], j[who.ours]
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
        flown = limits.clip(gamma)
        here = None if left_s is None else ~(left_s <= step * dt + 1e-9)
        a, b = (i, j) if here is None else (i[here[i] & here[j]], j[here[i] & here[j]])
        if not a.size:  # nobody is left to meet
            rows[step] = {"t_s": step * dt, "safe_pairs": 0, "fault": ""}
            continue
        if who is None and here is None:
            h = barrier.values(plant.state()).h
        else:
            h = barrier.values(plant.state(), a, b).h
        if who is not None:
            flown = _on(flown, plant, limits, who)
        reached, fault = _fly(plant, wind, flown, step * dt, a, b, s.d_safe_m, arcs, here)
        rows[step] = _row(s, step * dt, h, reached, a, b) | {"fault": fault}
    branches = [rows[step] for step in sorted(rows)]
    v = v.but(detail={"branches": branches})
    safe = [row for row in branches if row["safe_pairs"]]
    if not safe:
        return premise_not_met(v, "no pair was in the safe set at any of these instants")
    worst = min(safe, key=lambda row: row["least_m"])
    value, fault = worst["least_m"], next((row["fault"] for row in safe if row["fault"]), "")
    low = s.d_safe_m - H_TOLERANCE_M
    if fault and value >= low:  # how near they would have come is not known
        return decide(v.but(why=fault), False, None)
    v = v.but(
        value=value,
        bound=low,
        margin=value - low,
        instant=worst["t_s"],
        vehicles=tuple(worst["vehicles"]),
        why=fault or f"flown from h = {worst['h']:.2f}, which promises {worst['promised_m']:.2f} m",
    )
    doubtful = min(safe, key=lambda row: row["possible_m"])
    if value < low or doubtful["possible_m"] >= low:
        return decide(v, value >= low, None)
    why = finer(doubtful["possible_m"], doubtful["radius_m"], s.d_safe_m, s.rates.fdm_dt_s)
    return leave_open(v, f"flown from {doubtful['t_s']:g} s, {why}", None)


def _on(gamma: Command, plant: Plant, limits: Limits, who: Roles) -> Command:
    """gamma, but intruders keep their speed, course and climb rate, inside their limits."""
    rates = plant.achieved()
    on = limits.clip(Command(rates.v, np.zeros(len(rates)), rates.zeta)).array()
    return Command.of(np.where(who.under[:, None], gamma.array(), on))


@dataclass(frozen=True)
class Reached:
    """Distances of each pair (P,) m while gamma was flown.

    least     at samples, or nearer between them where that is certain
    possible  lower bounds, between samples as well
    radius    how far distances between samples may be from those of straight lines; 0 for known motion
    """

    least: Array
    possible: Array
    radius: Array


def _row(s: Scenario, t: float, h: Array, reached: Reached, i: np.ndarray, j: np.ndarray) -> dict[str, Any]:
    """What came of one instant: its worst safe pair, and how far any safe pair fell short of h's promise."""
    safe, least = h >= 0.0, reached.least
    row: dict[str, Any] = {"t_s": t, "safe_pairs": int(safe.sum())}
    if not safe.any():
        return row
    promised = h + s.d_safe_m if s.barrier.form == "root" else np.sqrt(np.maximum(h + s.d_safe_m**2, 0.0))
    p = int(np.argmin(np.where(safe, least, np.inf)))
    row |= {"least_m": float(least[p]), "vehicles": [int(i[p]) + 1, int(j[p]) + 1], "h": float(h[p])}
    q = int(np.argmin(np.where(safe, reached.possible, np.inf)))
    row |= {"possible_m": float(reached.possible[q]), "radius_m": float(reached.radius[q])}
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


def _fly(
    plant: Plant,
    wind: Callable[[float, State], Array],
    gamma: Command,
    t: float,
    i: np.ndarray,
    j: np.ndarray,
    d_safe: float,
    arcs: bool,
    here: Mask | None = None,
) -> tuple[Reached, str]:
    """How near each pair comes while all fly gamma for its period, and what ended it early.

    here  (N,) who has not left; None is everybody
    """
    turning = np.abs(gamma.omega) > 1e-9
    horizon = float(2 * np.pi / np.abs(gamma.omega[turning]).min()) if turning.any() else STRAIGHT_HORIZON_S
    n = max(1, round(PERIOD_S / plant.dt))
    start = plant.state()
    bends, last = Bends(len(start)), start.position[None]
    least = np.linalg.norm(last[0, i] - last[0, j], axis=-1)
    between = least
    steps = int(np.ceil(horizon / (n * plant.dt)))
    for k in range(steps):
        track = plant.step(gamma, wind(t + k * n * plant.dt, plant.state()), n)
        faults = enumerate(plant.faults())
        met = ((v, what) for v, what in faults if what and (here is None or here[v]))
        fault = next((f"vehicle {v + 1}: {what}" for v, what in met), "")
        if fault:
            return Reached(least, least, np.zeros(len(i))), f"{fault} while flying gamma from {t:g} s"
        whole = np.concatenate([last, track])
        offset = whole[:, i] - whole[:, j]
        least = np.minimum(least, np.linalg.norm(offset, axis=-1).min(axis=0))
        between = np.minimum(between, nearest_on_chords(offset[:-1], offset[1:]).min(axis=0))
        bends.update(whole.transpose(2, 0, 1), 1)
        last = whole[-1:]
    if arcs:
        ends, radius = (start[i], gamma[i], start[j], gamma[j]), np.zeros(len(i))
        possible, nearest, _ = closest_on_arcs(*ends, steps * n * plant.dt, d_safe)
    else:
        radius = bends.radius(i, j)
        possible, nearest = between - radius, between + radius
    decides = (nearest < d_safe - H_TOLERANCE_M) & (least >= d_safe - H_TOLERANCE_M)
    return Reached(np.where(decides, nearest, least), np.minimum(possible, least), radius), ""
