"""What a cluster adds for a campaign of fleets: four fleets of X8s, a local Dask cluster of 1 and 2 workers.

Beside it the same four flights one after the other, each stepped by two processes (`rates.workers`).
"""

from __future__ import annotations

import importlib.util
import time
from pathlib import Path
from typing import Any

from testbed.campaigns.executor import executor
from testbed.campaigns.folder import journal
from testbed.campaigns.plan import Plan
from testbed.campaigns.runner import fly_all, prepare
from testbed.campaigns.view import View
from testbed.scenario.scenario import parse
from testbed.simulation.simulate import run

FLEETS, VEHICLES = 4, 20
TEXT = """
name = "fleets"
scenario = "paper-20-turn"
seeds = {seeds}
first_seed = {first}
plants = ["jsbsim"]
[set]
duration_s = {duration}
"guidance.lookahead_m" = 10
"rates.filter_dt_s" = 0.05
"rates.record_dt_s" = {duration}
"checks.manoeuvre_instants" = 0
"start.lateral_perturbation_m" = 5
"""


def measure(place: Path, duration_s: float) -> dict[str, Any] | None:
    """Seconds on the wall of the campaign by workers of the cluster, and without; None without Dask."""
    if importlib.util.find_spec("distributed") is None:
        return None
    rows = [{"workers": k, "wall_s": _on_cluster(place, k, duration_s)} for k in (1, 2)]
    return {
        "fleets": FLEETS,
        "vehicles": VEHICLES,
        "duration_s": duration_s,
        "cluster": rows,
        "speedup": rows[0]["wall_s"] / rows[1]["wall_s"],
        "within_s": _one_by_one(place, duration_s),
    }


def _prepared(place: Path, name: str, seeds: int, first: int, duration_s: float) -> tuple[Plan, Path]:
    file = place / f"{name}.toml"
    file.write_text(TEXT.format(seeds=seeds, first=first, duration=duration_s), encoding="utf-8")
    return prepare(str(file), place / name), place / name


def _on_cluster(place: Path, workers: int, duration_s: float) -> float:
    """From the first run to the end of the last one, on workers that are up."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        with executor(cluster=cluster.scheduler_address) as pool:
            fly_all(*_prepared(place, f"warm-{workers}", 4 * workers, 10_000, 0.5), pool, View())
            timed = _prepared(place, f"timed-{workers}", FLEETS, 1, duration_s)
            began = time.time()
            fly_all(*timed, pool, View())
        return float(max(e["timing"]["ended_unix_s"] for e in journal(timed[1]).entries.values()) - began)


def _one_by_one(place: Path, duration_s: float) -> float:
    """The same flights in this process, each stepped by two."""
    plan, _ = _prepared(place, "within", FLEETS, 1, duration_s)
    scenarios = [parse(plan.data(planned)) for planned in plan.runs]
    began = time.time()
    for s in scenarios:
        run(s.model_copy(update={"rates": s.rates.model_copy(update={"workers": 2})}), force=True)
    return time.time() - began
