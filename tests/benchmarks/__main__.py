"""Measure everything and write the report: docs/guide/performance.md, its data and its figure.

    cd tests && python -m benchmarks            # all of it, some minutes
    cd tests && python -m benchmarks --quick    # shorter, for a look; the report is not written

Every number is a ratio within this one run. Not part of pass or fail.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

# One thread: what several do for numpy's small arrays is spin. Before numpy comes in.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks import border, cluster, fleets, gain, machine, memory, report, runs, starting, steps
from benchmarks.clock import BareStep
from benchmarks.runs import progress

SPLIT = (2, 5, 10, 20, 50, 100)
LIMITED, CENTRALISED = (5, 10, 20, 50, 100), (5, 10, 20, 50)


def measure(quick: bool) -> dict[str, Any]:
    """All measurements, as plain data."""
    bare = BareStep()
    found: dict[str, Any] = {"machine": machine.describe()}
    with tempfile.TemporaryDirectory() as place:
        found["runs"] = {}
        for name in runs.RUNS:
            progress(f"whole run: {name}")
            found["runs"][name] = runs.whole_run(name, bare, Path(place), 1 if quick else 2)
        found["fleets"] = fleets.measure(quick, bare, Path(place), progress)
        progress("the plant by one process and by two")
        found["fleets"]["gain"] = gain.measure(quick)
        progress("a campaign of fleets on a cluster of one worker and of two")
        found["cluster"] = cluster.measure(Path(place), 5.0 if quick else 40.0)
    moments, goes = (4, 3) if quick else (20, 10)
    for mode, sizes in (("limited", LIMITED), ("centralised", CENTRALISED)):
        found[mode] = []
        for k in sizes:
            progress(f"filter step, {mode}, {k} vehicles")
            found[mode].append(steps.step_cost(k, mode, bare, moments, goes))
    progress("the border of own parts")
    found["border"] = border.cost(2)
    progress("filter steps beside a fresh OSQP per vehicle")
    found["fresh"] = steps.against_fresh_osqp(bare, 10 if quick else 100)
    found["split"] = []
    for k in SPLIT[:4] if quick else SPLIT:
        progress(f"split by kind, {k} X8s")
        found["split"].append(runs.split(k, bare, 2.0 if quick else 12.0))
    progress("start-up")
    found["starting"] = starting.measure()
    found["campaign"] = _campaign(quick)
    vehicles, seconds = (10, 5.0) if quick else (100, 60.0)
    progress(f"memory: {vehicles} X8s, {seconds:g} s")
    found["memory"] = memory.measure(vehicles, seconds) | {"vehicles": vehicles, "duration_s": seconds}
    vehicles, seconds = (50, 5.0) if quick else (1000, 60.0)
    progress(f"memory: {vehicles} X8s at the density of traffic, {seconds:g} s")
    found["memory_city"] = memory.measure(vehicles, seconds, True) | {
        "vehicles": vehicles,
        "duration_s": seconds,
    }
    found["bare_us"] = [1e6 * b for b in bare.measured]
    return found


def _campaign(quick: bool) -> dict[str, Any] | None:
    """Two workers over one; None where that measurement does not exist."""
    if importlib.util.find_spec("benchmarks.campaign") is None:
        return None
    from benchmarks import campaign

    progress("campaign: one worker, two workers")
    return dict(campaign.measure(*((8, 5.0) if quick else (40, 20.0))))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="shorter and noisier; prints the rows only")
    parser.add_argument("--from-data", action="store_true", help="write the report again from its data")
    asked = parser.parse_args()
    found = json.loads(report.DATA.read_text(encoding="utf-8")) if asked.from_data else measure(asked.quick)
    for row in report.rows(found):
        print(row)
    if not asked.quick:
        report.write(found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
