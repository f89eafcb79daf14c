"""What a campaign adds to its runs, and what a second worker brings: two X8s head-on, 6-DOF.

    python tests/benchmarks/campaign.py [--runs 40] [--duration 20] [--json]

Bare is `simulate.run` in a loop. The campaign's time is that from its first run to its last on workers that
are up, journal and fsync included; start-up and the tables at the end are given apart. Where `cores` is well
below the number of workers, others used the machine, and only the CPU columns mean anything.
Not part of pass or fail. The targets: 1.8 times the throughput with two workers on two cores, and an overhead
of less than 10 % or 30 ms a run.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import psutil

from testbed.campaigns import file
from testbed.campaigns.bases import bases
from testbed.campaigns.folder import journal
from testbed.campaigns.plan import Plan, expand
from testbed.campaigns.processes import Processes
from testbed.campaigns.runner import fly_all, prepare
from testbed.campaigns.view import View
from testbed.scenario.scenario import parse
from testbed.simulation.simulate import run

TEXT = """
name = "benchmark"
scenario = "paper-2-turn"
seeds = {seeds}
first_seed = {first}
plants = ["jsbsim"]
[set]
duration_s = {duration}
"guidance.lookahead_m" = 10
"rates.filter_dt_s" = 0.05
"rates.record_dt_s" = {duration}
"checks.manoeuvre_instants" = 0
"start.lateral_perturbation_m" = 10
"start.heading_perturbation_deg" = 5
"""


def measure(runs: int = 40, duration_s: float = 20.0, workers: tuple[int, ...] = (1, 2)) -> dict[str, Any]:
    """Seconds per run, wall and CPU: bare, and with each number of workers."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "benchmark.toml"
        path.write_text(TEXT.format(seeds=runs, first=1, duration=duration_s), encoding="utf-8")
        campaign, here = file.load(str(path))
        bare = _bare(expand(campaign, bases(campaign, here)), min(runs, 20))
        rows = [_campaign(Path(place), runs, duration_s, count) | {"workers": count} for count in workers]
    for row in rows:
        row["overhead_ms"] = 1e3 * (row["wall_s_per_run"] * row["workers"] - bare["wall_s_per_run"])
        row["overhead_cpu_ms"] = 1e3 * (row["cpu_s_per_run"] - bare["cpu_s_per_run"])
        row["throughput_per_s"] = 1.0 / row["wall_s_per_run"]
        row["speedup"] = rows[0]["wall_s_per_run"] / row["wall_s_per_run"]
    return {"runs": runs, "duration_s": duration_s, "bare": bare, "campaigns": rows}


def _bare(plan: Plan, count: int) -> dict[str, float]:
    scenarios = [parse(plan.data(r)) for r in plan.runs[:count]]
    run(scenarios[0], force=True)
    wall, cpu = time.perf_counter(), time.process_time()
    for s in scenarios:
        run(s, force=True)
    spent = {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}
    return {f"{name}_per_run": value / count for name, value in spent.items()}


def _campaign(place: Path, runs: int, duration_s: float, workers: int) -> dict[str, float]:
    def prepared(name: str, seeds: int, first: int) -> tuple[Plan, Path]:
        path = place / f"{name}-{workers}.toml"
        path.write_text(TEXT.format(seeds=seeds, first=first, duration=duration_s), encoding="utf-8")
        return prepare(str(path), place / path.stem), place / path.stem

    with Processes(workers) as pool:
        warm, timed = prepared("warm", 4 * workers, 10_000), prepared("timed", runs, 1)
        began = time.time()
        fly_all(*warm, pool, View())
        up = min(e["timing"]["ended_unix_s"] for e in journal(warm[1]).entries.values())
        cpu, start = _cpu(pool), time.time()
        fly_all(*timed, pool, View())
        last = max(e["timing"]["ended_unix_s"] for e in journal(timed[1]).entries.values())
        finished, cpu = time.time() - last, _cpu(pool) - cpu
    return {
        "wall_s_per_run": (last - start) / runs,
        "cpu_s_per_run": cpu / runs,
        "cores": cpu / (last - start),
        "first_run_after_s": up - began,
        "tables_s": finished,
    }


def _cpu(pool: Processes) -> float:
    """CPU seconds of the workers and of this process."""
    spent = [psutil.Process(pid).cpu_times() for pid in [None, *pool.pids]]
    return sum(t.user + t.system for t in spent)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--runs", type=int, default=40)
    options.add_argument("--duration", type=float, default=20.0, help="simulated seconds")
    options.add_argument("--json", action="store_true")
    asked = options.parse_args()
    found = measure(asked.runs, asked.duration)
    if asked.json:
        print(json.dumps(found, indent=2))
        return
    bare = found["bare"]
    print(f"bare: {bare['wall_s_per_run']:.3f} s a run, {bare['cpu_s_per_run']:.3f} s CPU")
    for r in found["campaigns"]:
        print(
            f"{r['workers']} workers: {r['throughput_per_s']:.2f} runs/s, {r['speedup']:.2f} times one's;"
            f" {r['cores']:.2f} cores;"
            f" overhead {r['overhead_ms']:.1f} ms a run, {r['overhead_cpu_ms']:.1f} ms CPU;"
            f" first run after {r['first_run_after_s']:.1f} s, tables {r['tables_s']:.1f} s"
        )


if __name__ == "__main__":
    main()
