"""The evading manoeuvre itself: from instants along a run the vehicles really fly gamma.

h promises that from here on, if all fly gamma for ever, no pair comes closer than h says. That is the
construct every theorem of the paper rests on; here it is flown, from branches of the recorded flight.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aircraft.plant import Plant
from filters.barrier import Barrier
from filters.unicycle import Array, Limits, State
from testbed.scenario import Scenario
from testbed.tally import Extreme
from testbed.verdicts import PREMISE, Entry, decide, entry

# How often the air is asked and the plant stepped while gamma is flown [s].
PERIOD_S = 0.05
# Long enough for straight flyers of the paper to be past each other.
STRAIGHT_HORIZON_S = 60.0


def instants(s: Scenario, least_h_t: float, end_t: float) -> list[float]:
    """When to branch: evenly along the run, and where h was least; [s], whole filter periods, ascending."""
    dt = s.rates.filter_dt_s
    steps = {round(k * end_t / s.checks.manoeuvre_instants / dt) for k in range(s.checks.manoeuvre_instants)}
    if np.isfinite(least_h_t):
        steps.add(round(least_h_t / dt))
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
) -> Entry:
    """G9: one entry, its detail a row per instant.

    branch  a plant at a time of the run
    wind    the air's motion (N, 3) m/s at a time and state
    i, j    vehicles of each pair, from 0
    """
    e = entry(
        "manoeuvre-keeps-Ds",
        "G9",
        "flown from a safe state, gamma keeps every pair Ds apart",
        "eq. (9), Theorem 2",
        "least distance while flying gamma",
        "m",
    )
    if not i.size:
        return e | {"why": "no pair"}
    if not s.barrier.shared or s.barrier.kind == "euclidean":
        return e | {"why": "the barrier has no one manoeuvre"}
    reached, rows = Extreme.of(i.size), []
    for t in when:
        plant = branch(t)
        h = barrier.values(plant.state()).h
        promised = h + s.d_safe_m if s.barrier.form == "root" else np.sqrt(np.maximum(h + s.d_safe_m**2, 0.0))
        least, fault = _least_distance(s, plant, wind, barrier, limits, t, i, j)
        safe = h >= 0.0
        reached.update(t, np.where(safe, least, np.inf))
        p = int(np.argmin(least))
        row = {"t_s": t, "least_m": float(least[p]), "vehicles": [int(i[p]) + 1, int(j[p]) + 1]}
        row |= {"promised_m": float(promised[p]), "short_m": float(np.max(promised - least)), "fault": fault}
        rows.append(row | {"safe_pairs": int(safe.sum())})
    e["detail"] = {"branches": rows}
    p, value, t = reached.worst()
    if p < 0:
        return e | {"verdict": PREMISE, "why": "no pair was in the safe set at any of these instants"}
    e.update(
        value=value,
        bound=s.d_safe_m,
        margin=value - s.d_safe_m,
        t_s=t,
        vehicles=[int(i[p]) + 1, int(j[p]) + 1],
    )
    fault = next((row["fault"] for row in rows if row["fault"]), "")
    e["why"] = fault or f"short of h's promise by {max(row['short_m'] for row in rows):.2f} m at most"
    return decide(e, value >= s.d_safe_m and not fault, None)


def _least_distance(
    s: Scenario,
    plant: Plant,
    wind: Callable[[float, State], Array],
    barrier: Barrier,
    limits: Limits,
    t: float,
    i: np.ndarray,
    j: np.ndarray,
) -> tuple[Array, str]:
    """Least distance of each pair (P,) m while all fly gamma for its period, and what ended it early."""
    gamma = limits.clip(barrier.manoeuvre(s.vehicles))
    turning = np.abs(gamma.omega) > 1e-9
    horizon = float(2 * np.pi / np.abs(gamma.omega[turning]).min()) if turning.any() else STRAIGHT_HORIZON_S
    n = max(1, round(PERIOD_S / plant.dt))
    now = plant.state()
    position = np.stack([now.x, now.y, now.z], axis=-1)
    least = np.linalg.norm(position[i] - position[j], axis=-1)
    for k in range(int(np.ceil(horizon / (n * plant.dt)))):
        track = plant.step(gamma, wind(t + k * n * plant.dt, plant.state()), n)
        fault = next((f"vehicle {v + 1}: {what}" for v, what in enumerate(plant.faults()) if what), "")
        if fault:
            return least, f"{fault} while flying gamma from {t:g} s"
        least = np.minimum(least, np.linalg.norm(track[:, i] - track[:, j], axis=-1).min(axis=0))
    return least, ""
