"""Chooses how many processes step the aircraft of a run."""

from __future__ import annotations

import os

from testbed.scenario.scenario import Scenario

# What "auto" means in this process and those that it starts. A campaign's workers have it at 1: they share
# the processors among runs, which need not wait for one another.
VARIABLE = "TESTBED_FLEET_WORKERS"
# From which size on workers gain for certain (tests/benchmarks/gain.py): a step of 10 aircraft over 10
# periods, or of 20 over one, takes two processes 0.55 of what one takes. On an idle machine 2 aircraft gain
# too (0.65); on a busy one 5 took from 0.65 to 2, since each wait takes milliseconds. A turn counts as two
# periods more: by then the aircraft has left the processor's cache. In the run: starting a worker takes 0.4
# s of a processor, and a period 8 us.
TURN, PERIODS_PER_STEP, PERIODS_PER_RUN = 2, 80, 200_000
# Tasks that want a processor, for each that there is, above which a second process would be waited for in
# every step: it gets its turn some milliseconds later.
BUSY = 1.25


def fleet_workers(s: Scenario) -> int:
    """Processes that step the aircraft of `s`, this one among them: at most one a vehicle."""
    if s.rates.workers != "auto":
        return min(s.rates.workers, s.vehicles)
    said = os.environ.get(VARIABLE, "")
    if said.isdecimal() and int(said) > 0:
        return min(int(said), s.vehicles)
    per_step = s.vehicles * (s.rates.fdm_steps + TURN)
    if per_step < PERIODS_PER_STEP or per_step * s.filter_steps < PERIODS_PER_RUN:
        return 1
    if os.name != "posix" or os.getloadavg()[0] > BUSY * processors():
        return 1
    return min(processors(), s.vehicles)


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
