"""Hours of flying: memory flat, no file handle left open, no slowdown. `make soak`; prints what it measured.

TESTBED_SOAK=0.02 tries the tests themselves on a fiftieth of the work.
"""

from __future__ import annotations

import os
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

pytestmark = [
    pytest.mark.soak,
    pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory and handles are read in /proc"),
]
SHARE = float(os.environ.get("TESTBED_SOAK", "1"))
PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6


def memory_mb(process: int | str = "self") -> float:
    """Resident memory."""
    return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * PAGE_MB


def handles(process: int | str = "self") -> int:
    return len(os.listdir(f"/proc/{process}/fd"))


def family(process: int) -> list[int]:
    """A process and all below it."""
    found = [process]
    for parent in found:
        for task in Path(f"/proc/{parent}/task").glob("*/children"):
            try:
                found += map(int, task.read_text().split())
            except OSError:
                continue
    return found


@dataclass
class Gauge:
    """Samples along a long piece of work; the first fifth is warming up."""

    samples: list[tuple[float, float, int]] = field(default_factory=list)

    def sample(self, done: float, megabytes: float, open_files: int) -> None:
        self.samples.append((done, megabytes, open_files))

    def steady(self, what: str) -> None:
        """Print, and assert that neither memory nor handles grow after the warming up."""
        _, memory, files = np.array(self.samples[len(self.samples) // 5 :]).T
        quarter = max(1, len(memory) // 4)
        early, late = np.median(memory[:quarter]), np.median(memory[-quarter:])
        print(f"\n{what}: memory {early:.0f} MB, later {late:.0f} MB, most {memory.max():.0f} MB")
        print(f"{what}: open files {files[:quarter].max():.0f}, later {files[-quarter:].max():.0f}")
        # healthy within 5 MB; a block of rows that stayed would be 20 MB an hour
        assert late < early + 15
        assert files[-quarter:].max() <= files[:quarter].max()


def test_an_hour_of_twenty_aircraft(tmp_path: Path) -> None:
    duration = round(3600 * SHARE)
    s = load(
        "paper-20-turn",
        [
            "plant=jsbsim", f"duration_s={duration}", "filter.kind=limited", "rates.filter_dt_s=0.05",
            "rates.record_dt_s=0.5", "checks.manoeuvre_instants=0", "limits.zeta_max_mps=1",
        ],
    )  # fmt: skip
    gauge, minutes, began = Gauge(), [], [time.process_time()]
    step_s = max(1.0, duration / 60)

    def progress(t: float, whole: float) -> None:
        if t >= step_s * (len(minutes) + 1) - 1e-9:
            now = time.process_time()
            minutes.append(now - began[0])
            began[0] = now
            gauge.sample(t, memory_mb(), handles())

    result = run(s, tmp_path / "hour", progress=progress)
    ended = result.manifest["ended_early"]
    print(f"\nended early: {ended}; {len(result.vehicles)} vehicle rows, {len(result.pairs)} pair rows")
    assert ended is None
    half = len(minutes) // 2
    early, late = np.median(minutes[2:half]), np.median(minutes[half:])
    print(f"{sum(minutes):.0f} s of CPU; a sixtieth took {early:.2f} s in the first half, {late:.2f} s later")
    gauge.steady("an hour of twenty aircraft")
    assert late < 1.25 * early


CAMPAIGN = """
name = "soak"
scenario = "paper-2-turn"
seeds = {seeds}
plants = ["unicycle", "jsbsim"]
[set]
duration_s = 10.0
filter_dt_s = 0.05
record_dt_s = 1.0
"checks.manoeuvre_instants" = 0
lookahead_m = 10.0
heading_perturbation_deg = 5.0
"""


def test_two_thousand_runs(tmp_path: Path) -> None:
    from testbed.campaigns.executor import executor
    from testbed.campaigns.runner import fly_all, prepare
    from testbed.campaigns.view import View

    runs = 2 * max(20, round(1000 * SHARE))
    file = tmp_path / "soak.toml"
    file.write_text(CAMPAIGN.format(seeds=runs // 2))
    plan = prepare(str(file), tmp_path / "campaign")
    gauge, over, began = Gauge(), threading.Event(), time.monotonic()

    def watch() -> None:
        while not over.wait(0.5 if SHARE < 1 else 5.0):
            try:
                below = family(os.getpid())
                if len(below) > 2:
                    open_files = sum(map(handles, below))
                    gauge.sample(time.monotonic() - began, sum(map(memory_mb, below)), open_files)
            except OSError:  # one of them has just ended
                continue

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    with executor(2, None) as pool:
        state = fly_all(plan, tmp_path / "campaign", pool, View())
    over.set()
    watcher.join()
    assert state.complete and len(state.entries) == runs
    assert {entry["row"]["status"] for entry in state.entries.values()} == {"flown"}
    walls = pd.Series([entry["timing"]["wall_s"] for entry in state.entries.values()])
    assert len(walls) == runs
    # Unicycles and aircraft alternate: pairs of runs are alike.
    alike = walls.to_numpy()[: runs // 2 * 2].reshape(-1, 2).sum(axis=1)
    third = len(alike) // 3
    early, late = np.median(alike[third : 2 * third]), np.median(alike[2 * third :])
    print(f"\n{runs} runs in {time.monotonic() - began:.0f} s; a pair took {early:.2f} s, later {late:.2f} s")
    gauge.steady("a campaign with its workers")
    assert late < 1.25 * early
