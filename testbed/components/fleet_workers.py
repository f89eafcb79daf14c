"""Chooses how many processes step the aircraft of a run."""

from __future__ import annotations

import os

from testbed.scenario.scenario import Scenario

# What "auto" means in this process and those that it starts. A campaign's workers have it at 1: they share
# the processors among runs, which need not wait for one another.
VARIABLE = "TESTBED_FLEET_WORKERS"
# Aircraft times FDM periods from which workers gain: between two filter steps, and in the run. One takes
# 9 us. Starting a worker takes 0.4 s of a processor (measured); 0.1 ms a filter step are allowed for waiting.
# From here on half of the aircraft's time is at least twice that.
PERIODS_PER_STEP, PERIODS_PER_RUN = 64, 200_000


def fleet_workers(s: Scenario) -> int:
    """Processes that step the aircraft of `s`, this one among them: at most one a vehicle."""
    if s.rates.workers != "auto":
        return min(s.rates.workers, s.vehicles)
    said = os.environ.get(VARIABLE, "")
    if said.isdecimal() and int(said) > 0:
        return min(int(said), s.vehicles)
    per_step = s.vehicles * s.rates.fdm_steps
    if os.name != "posix" or per_step < PERIODS_PER_STEP or per_step * s.filter_steps < PERIODS_PER_RUN:
        return 1
    return min(processors(), s.vehicles)


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
