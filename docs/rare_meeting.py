"""Compares rare-event estimates with a long plain campaign of two lagged vehicles without a filter.

From the project's folder: python docs/rare_meeting.py [PLAIN RUNS]
writes docs/guide/data/rare-meeting.csv. The flights are those of `testbed rare` on the same scenario, with
the same guidance, plant and period; here thousands of encounters fly side by side as one fleet. No filter is
flown, which would couple them. tests/test_rare_events.py compares a flight with that of the simulation.
"""

from __future__ import annotations

import csv
import sys
from functools import cache
from pathlib import Path

import numpy as np
from scipy.special import ndtr

from filters.model import Array, Command, State, View
from testbed.components import catalogue
from testbed.components.guidance import NearIdentity
from testbed.components.initial_conditions import generators, places
from testbed.measures.between_samples import nearest_on_chords
from testbed.rare_events import importance, subset
from testbed.rare_events.estimate import Estimate
from testbed.scenario import guidance as tables
from testbed.scenario.scenario import Scenario, load
from testbed.statistics import rate

FILE = Path(__file__).parent / "guide" / "data" / "rare-meeting.csv"
SET = (
    'plant="lagged"', 'lags.source="table"', 'filter.kind="none"', "guidance.lookahead_m=10",
    "start.lateral_offsets_m=[12.0, 12.0]", "rates.filter_dt_s=0.1", "rates.fdm_dt_s=0.1",
    "rates.record_dt_s=1", "duration_s=11",
)  # fmt: skip
LATERAL_M, HEADING_DEG, LEAST_M = 10.0, 5.0, 2.4
SEED = 30_000


@cache
def scenario() -> Scenario:
    return load("paper-2-turn", SET)


def distances(z: Array) -> Array:
    """(n,) m, least distances of n encounters; z (n, 4) are lateral-1, lateral-2, heading-1, heading-2."""
    from aircraft.kinematic import KinematicFleet

    s = scenario()
    limits, (start, goal) = catalogue.limits(s), places(s, generators(s.seed)["start"])
    n, x = len(z), 2.0 * ndtr(z) - 1.0
    side, turn = LATERAL_M * x[:, :2], np.radians(HEADING_DEG) * x[:, 2:]
    # Offsets are to the left of the course as it was before it is turned.
    place = State(
        (start.x - side * np.sin(start.theta)).ravel(),
        (start.y + side * np.cos(start.theta)).ravel(),
        (start.theta + turn).ravel(),
        np.zeros(2 * n),
    )
    assert isinstance(s.guidance, tables.NearIdentity)
    wanted = NearIdentity(np.tile(goal, (n, 1)), s.guidance.lookahead_m, s.guidance.gain_per_s)
    plant = KinematicFleet(2 * n, s.rates.fdm_dt_s, catalogue.lags(s))
    plant.reset(place, np.random.default_rng(0), speed=s.start.speed_mps)
    low, high = (np.tile(corner, (n, 1)) for corner in limits.corners)
    least, before = np.full(n, np.inf), place.position
    for k in range(s.filter_steps):
        asked = wanted(k * s.rates.filter_dt_s, View(plant.state(), plant.achieved())).array()
        now = plant.step(Command.of(np.clip(asked, low, high)), np.zeros(3), s.rates.fdm_steps)[-1]
        chords = nearest_on_chords(before[::2] - before[1::2], now[::2] - now[1::2])
        least, before = np.minimum(least, chords), now
    return least


def state(z: Array) -> Array:
    return distances(z) - LEAST_M


def main(runs: int) -> None:
    rng = np.random.default_rng(SEED)
    seen = rate(np.concatenate([state(rng.standard_normal((5000, 4))) < 0.0 for _ in range(runs // 5000)]))
    rows = [["plain", SEED, seen.value, seen.low, seen.high, seen.runs, seen.count]]
    print(rows[-1], flush=True)
    for k in range(1, 6):
        for name, method in (("subset", subset), ("importance", importance)):
            found: Estimate = method.estimate(state, 4, np.random.default_rng(SEED + k))
            rows.append([name, SEED + k, found.probability, found.low, found.high, found.runs, ""])
            print(rows[-1], found.doubts, flush=True)
    with FILE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["method", "seed", "probability", "low", "high", "runs", "events"])
        table.writerows([f"{v:.4g}" if isinstance(v, float) else v for v in row] for row in rows)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300_000)
