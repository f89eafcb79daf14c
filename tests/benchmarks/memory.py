"""The memory of a long run of many aircraft, second by second, in a process of its own.

python -m benchmarks.memory VEHICLES SECONDS [city]    prints [[t_s, resident_mb, wall_s], ...] as JSON
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import psutil

from testbed.scenario import scenario
from testbed.scenario.scenario import Scenario
from testbed.simulation import simulate


def measure(vehicles: int = 100, duration_s: float = 60.0, city: bool = False) -> dict[str, Any]:
    """Peak, and growth per minute over the flight's last third [MB]: before, rows gather to be written.

    Also what each third of the flight added [MB], and how long it took on the wall [s].

    city  at the density of traffic, by two workers, whose memory counts; else on a circle
    """
    command = [sys.executable, "-m", "benchmarks.memory", str(vehicles), str(duration_s), *["city"] * city]
    out = subprocess.run(
        command, stdout=subprocess.PIPE, text=True, check=True, cwd=Path(__file__).parents[1]
    )
    samples = json.loads(out.stdout)
    last = len(samples) - 1
    ends = [samples[k * last // 3] for k in range(4)]
    (t0, before, _), (t1, after, _) = ends[2:]
    return {
        "peak_mb": max(mb for _, mb, _ in samples),
        "growth_mb_per_min": 60.0 * (after - before) / (t1 - t0),
        "thirds_mb": [b[1] - a[1] for a, b in pairwise(ends)],
        "thirds_wall_s": [b[2] - a[2] for a, b in pairwise(ends)],
        "samples": samples,
    }


def on_a_circle(vehicles: int, duration_s: float) -> Scenario:
    """X8s that meet; filter at 20 Hz."""
    return scenario.load(
        "paper-20-turn",
        [
            "plant=jsbsim",
            f"vehicles={vehicles}",
            f"duration_s={duration_s}",
            f"start.radius_m={10 * vehicles}",
            "filter_dt_s=0.05",
            "manoeuvre_instants=0",
            "rates.workers=1",
        ],
    )


def main(s: Scenario) -> None:
    """Fly `s` and print the memory of this process and those that it starts, second by second."""
    me, began = psutil.Process(), time.perf_counter()
    samples: list[tuple[float, float, float]] = []

    def note(t: float, end: float) -> None:
        if not samples or t >= samples[-1][0] + 1.0 or t == end:
            every = [me, *me.children()]
            resident = sum(process.memory_info().rss for process in every) / 2**20
            samples.append((t, resident, time.perf_counter() - began))

    with tempfile.TemporaryDirectory() as place:
        simulate.run(s, Path(place) / "run", force=True, progress=note)
    print(json.dumps(samples))


if __name__ == "__main__":
    size = int(sys.argv[1]), float(sys.argv[2])
    if sys.argv[3:] == ["city"]:
        from benchmarks.fleets import city

        main(city(size[0], "jsbsim", size[1], workers=2))
    else:
        main(on_a_circle(*size))
