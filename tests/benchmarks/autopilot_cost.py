"""What autopilots and sensors cost in a JSBSim step, as ratios within one run.

    python tests/benchmarks/autopilot_cost.py

First what the airframe's own autopilot adds: the bare model has the same properties and no equations. The two
step in turns, so that both meet the machine's quiet moments, and anew each round, for where an instance lies
in memory can double its time; minima count. The target is at most 1.1. Then other autopilots and sensors
against it, as the table of docs/guide/autopilots.md has them: typical sensors take at most 1.15 times as
long, other autopilots no longer. Not part of pass or fail.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import timeit
from collections.abc import Sequence
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


# Sensors, and autopilots with and without them.
OTHERS = ("typical", "arduplane", "px4", "arduplane@typical", "px4@typical")


def ratios(base: str, others: Sequence[str] = OTHERS, rounds: int = 4, turns: int = 40) -> dict[str, float]:
    """Time of a step of `base`@other to that of `base`, in turns, instances made anew in every round."""
    named = [base, *(f"{base}@{other}" for other in others)]
    least = np.full(len(named), np.inf)
    for _ in range(rounds):
        fdms = [Fdm(load(name), 0.005, Origin()) for name in named]
        for fdm in fdms:
            fdm.start(LEVEL)
            fdm.command(20.0, 0.1, 0.0)
        for _ in range(turns):
            least = np.minimum(least, [timeit.timeit(fdm.executive.run, number=200) for fdm in fdms])
    return dict(zip(others, (least[1:] / least[0]).tolist(), strict=True))


if __name__ == "__main__":
    for name in names():
        with_, without = cost(name)
        print(f"{name}: {with_:.2f} us with, {without:.2f} us without, ratio added {with_ / without - 1:.2f}")
    for name in names():
        for other, ratio in ratios(name).items():
            print(f"{name}@{other}: {ratio:.2f} times {name}")
