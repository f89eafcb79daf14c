"""What a step of the flow filter costs while twenty vehicles on the lagged plant swap places.

    cd tests && python -m benchmarks.flow_step [SECONDS]

The thread's own time, so that a busy machine matters less. Not part of pass or fail. The targets are 4 ms in
the mean and 20 ms at the 99th percentile, on one idle core.
"""

from __future__ import annotations

import os
import sys
import time

# One thread: what several do for numpy's small arrays is spin. Before numpy comes in.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from filters.model import State, View
from testbed.components import catalogue
from testbed.components.initial_conditions import generators, places
from testbed.scenario.scenario import load

FIELDS = (
    "filter.kind=flow",
    "plant=lagged",
    "lags.source=airframe",
    "guidance.lookahead_m=10",
    "rates.filter_dt_s=0.05",
    "rates.record_dt_s=0.05",
    "start.heading_perturbation_deg=5",
    "start.height_perturbation_m=1",
)


def cost(seconds: float, seed: int = 2001) -> np.ndarray:
    """Milliseconds of each step of one flight."""
    s = load("paper-20-turn", [*FIELDS, f"seed={seed}"])
    start, goal = places(s, generators(seed)["start"])
    barrier = catalogue.barrier(s)
    chosen, nominal = catalogue.filter_(s, barrier, goal), catalogue.guidance(s, goal, barrier)
    plant, limits = catalogue.plant(s), catalogue.limits(s)
    still = np.zeros((s.vehicles, 3))
    plant.reset(start, np.random.default_rng(seed), still, np.full(s.vehicles, s.start.speed_mps))
    found = []
    for k in range(round(seconds / s.rates.filter_dt_s)):
        now: State = plant.state()
        view = View(now, plant.achieved())
        wanted = nominal(k * s.rates.filter_dt_s, view)
        begun = time.thread_time()
        decision = chosen(view, wanted, limits)
        found.append(1e3 * (time.thread_time() - begun))
        plant.step(decision.command, still, round(s.rates.filter_dt_s / s.rates.fdm_dt_s))
    return np.array(found)


if __name__ == "__main__":
    ms = cost(float(sys.argv[1]) if sys.argv[1:] else 30.0)
    print(f"{ms.size} steps: mean {ms.mean():.2f} ms, 99th percentile {np.percentile(ms, 99):.2f} ms")
