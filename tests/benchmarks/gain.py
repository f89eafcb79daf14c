"""From which size on a fleet gains by a second process: the plant alone, on the clock on the wall.

What "auto" of `rates.workers` goes by; see `testbed.components.fleet_workers`. Nothing of a filter or of a
record is in here: the part of a run that processes share, and what their waiting for one another costs.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from aircraft.airframe import load
from aircraft.jsbsim.fleet import JsbsimFleet
from benchmarks.interval import median_of
from filters.model import Command, State

# (X8s, FDM periods between two filter steps)
SIZES = ((2, 10), (3, 10), (5, 10), (10, 10), (20, 10), (20, 1), (50, 1), (100, 1), (100, 10))
STEPS, GOES = 60, 5


def plant(vehicles: int, workers: int) -> JsbsimFleet:
    """X8s in a row, started, flown by so many processes."""
    fleet = JsbsimFleet([load("x8")] * vehicles, workers=workers)
    fleet.reset(State(50.0 * np.arange(vehicles), 0.0, 0.0, 0.0), np.random.default_rng(0))
    return fleet


def step_us(fleet: JsbsimFleet, periods: int, idle_s: float = 3e-4) -> float:
    """Microseconds on the wall of a step of so many periods, the median; `idle_s` pass between two."""
    n, samples = len(fleet), []
    level, still = Command(np.full(n, 20.0), np.zeros(n), np.zeros(n)), np.zeros((n, 3))
    for _ in range(STEPS):
        until = time.perf_counter() + idle_s
        while time.perf_counter() < until:  # as a filter, which leaves this processor no rest either
            pass
        began = time.perf_counter()
        fleet.step(level, still, periods)
        samples.append(1e6 * (time.perf_counter() - began))
    return median_of(samples[5:]).value


def measure(quick: bool = False) -> list[dict[str, Any]]:
    """Per size: a step by one process and by two [us], and their ratio, with its interval."""
    rows = []
    for vehicles, periods in SIZES[:3] if quick else SIZES:
        fleets = [plant(vehicles, workers) for workers in (1, 2)]
        goes = [[step_us(fleet, periods) for fleet in fleets] for _ in range(GOES)]
        for fleet in fleets:
            fleet.close()
        one, two = (median_of(each).value for each in zip(*goes, strict=True))
        ratio = median_of([b / a for a, b in goes])
        rows.append(
            {"vehicles": vehicles, "periods": periods, "one_us": one, "two_us": two, **ratio.to_json(1.0)}
        )
    return rows
