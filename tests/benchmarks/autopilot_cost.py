"""What the autopilot adds to a JSBSim step, as a ratio within one run.

    python tests/benchmarks/autopilot_cost.py

The bare model has the same properties and no equations. The two step in turns, so that both meet the
machine's quiet moments, and anew each round, for where an instance lies in memory can double its time;
minima count.
Not part of pass or fail. The target is at most 1.1.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import timeit
from pathlib import Path

import numpy as np

from aircraft.airframe import load
from aircraft.airframes.schema import names
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start

LEVEL = Start(0.0, 0.0, 0.0, 0.0, 20.0)


def cost(name: str, rounds: int = 8) -> tuple[float, float]:
    """Microseconds per period with the autopilot and without."""
    airframe = load(name)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / airframe.name
        shutil.copytree(airframe.folder, folder)
        silent = folder / "systems" / "autopilot.xml"
        silent.write_text(re.sub(r"<channel.*</channel>", "", silent.read_text(), flags=re.DOTALL))
        least = np.full(2, np.inf)
        for _ in range(rounds):
            flying, bare = Fdm(airframe, 0.005, Origin()), Fdm(load(folder), 0.005, Origin())
            flying.start(LEVEL)
            bare.trim(LEVEL)
            for _ in range(40):
                turn = [timeit.timeit(fdm.executive.run, number=200) for fdm in (flying, bare)]
                least = np.minimum(least, turn)
    return tuple(float(t / 200 * 1e6) for t in least)  # type: ignore[return-value]


if __name__ == "__main__":
    for name in names():
        with_, without = cost(name)
        print(f"{name}: {with_:.2f} us with, {without:.2f} us without, ratio added {with_ / without - 1:.2f}")
