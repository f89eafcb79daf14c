"""What a machine's caches cost: the same JSBSim steps with nothing of ours, warm and after a sweep.

An aircraft is a quarter of a megabyte. Between two filter steps a program touches its own memory, which
drives aircraft out of a core's cache whatever that program is. Here nothing runs but JSBSim's `run()`; memory
twice as large as the core's cache is written between the turns, and only the steps are timed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aircraft.airframe import load
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start
from benchmarks.clock import clock

# Where the system says how large a core's second-level cache is; what it is where it does not.
_SAID, _USUAL = Path("/sys/devices/system/cpu/cpu0/cache/index2/size"), 1 << 20


def second_level() -> int:
    """Bytes of the second-level cache of a core."""
    try:
        return int(_SAID.read_text(encoding="ascii").strip().removesuffix("K")) * 1024
    except (OSError, ValueError):
        return _USUAL


def swept(vehicles: int, periods: int, turns: int = 60) -> float:
    """Seconds of one `run()` of that many X8s, `periods` each in turn, after the cache was written over."""
    airframe, origin = load("x8"), Origin()
    fleet = [Fdm(airframe, 0.005, origin) for _ in range(vehicles)]
    for k, fdm in enumerate(fleet):
        fdm.start(Start(50.0 * k, 0.0, 0.0, 0.0, 20.0))
    steps, dirt = [fdm.executive.run for fdm in fleet], np.zeros(2 * second_level() // 8)
    best = float("inf")
    for _ in range(turns):
        dirt += 1.0
        began = clock()
        for step in steps:
            for _ in range(periods):
                step()
        best = min(best, clock() - began)
    return best / (vehicles * periods)
