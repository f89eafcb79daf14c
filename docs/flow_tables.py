"""Flies the flow filter on fresh seeds, for docs/guide/flow-measured.md.

    python docs/flow_tables.py lagged          # twenty vehicles on the lagged plant, 10 seeds, both airframes
    python docs/flow_tables.py ring            # around the roundabout: 20 and 50
    python docs/flow_tables.py pairs [SEEDS [AUTOPILOT ...]]   # two X8s, head-on and crossing
    python docs/flow_tables.py slowed FOLDER [SEEDS]   # the same of an airframe of your own
    python docs/flow_page.py                   # the page, of what has been flown

A run that is in docs/guide/data/flow.csv is not flown again. Fleets in JSBSim are cells of `testbed answer`.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from flow_rows import append, flown

import testbed
from testbed.scenario.scenario import load

DATA = Path(__file__).parent / "guide" / "data" / "flow.csv"
COLUMNS = (
    "table", "case", "seed", "vehicles", "distance_m", "h_m", "flow_m", "arrived", "last_s",
    "path_added_m", "ended",
)  # fmt: skip
FIRST_SEED = 2001
COMMON = (
    'filter.kind="flow"', "guidance.lookahead_m=10", "rates.filter_dt_s=0.05", "rates.record_dt_s=1",
    "manoeuvre_instants=0", "start.lateral_perturbation_m=10", "start.heading_perturbation_deg=5",
    "start.height_perturbation_m=1",
)  # fmt: skip
LAGGED = ('plant="lagged"', 'lags.source="airframe"', "duration_s=40", "filter.margin_m=0")
JSBSIM = ('plant="jsbsim"', "filter.margin_m=2")
ON_THE_RING = (*(c for c in COMMON if "lookahead" not in c), 'guidance.kind="roundabout"', "filter.kappa=0.5")
RINGS = {
    20: ("duration_s=30",),
    50: ("vehicles=50", "duration_s=35", "start.lateral_perturbation_m=5"),
}
FLOWN = {"ArduPlane": "x8@arduplane", "PX4": "x8@px4", "inverting": "x8"}
MEETINGS = {"head-on": ("paper-2-turn", "duration_s=30"), "crossing": ("crossing", "duration_s=30")}


def cases(table: str) -> dict[str, tuple[str, tuple[str, ...]]]:
    """case -> built-in scenario and what is set in it."""
    if table == "ring":
        return {
            f"{n} {a}": ("paper-20-turn", (*ON_THE_RING, *JSBSIM, f'airframes=["{a}"]', *RINGS[n]))
            for n, a in ((20, "x8"), (50, "x8"))
        }
    if table == "lagged":
        return {a: ("paper-20-turn", (*COMMON, *LAGGED, f'airframes=["{a}"]')) for a in ("x8", "rascal")}
    return {
        f"{how}, {meeting}": (name, (*COMMON, *JSBSIM, f'airframes=["{airframe}"]', *more))
        for how, airframe in FLOWN.items()
        for meeting, (name, *more) in MEETINGS.items()
    }


def fly(table: str, case: str, seed: int) -> dict[str, Any]:
    """One row of the data."""
    name, said = cases(table)[case]
    run = testbed.run(load(name, [*said, f"seed={seed}"]))
    value = {v.id: v.value for v in run.guarantees}
    added = run.guarantee("intervention")["detail"]["path_added_m"]
    home = [a for a in added if a is not None]
    return {
        "table": table,
        "case": case,
        "seed": seed,
        "vehicles": len(added),
        "distance_m": value["separation"],
        "h_m": value["safe-set"],
        "flow_m": value["monitor-flow_clear"],
        "arrived": len(home),
        "last_s": run.guarantee("goal")["detail"].get("last_passed_s"),
        "path_added_m": max(home) if len(home) == len(added) else None,
        "ended": run.manifest["ended_early"] or "",
    }


def add(table: str, seeds: int, only: str = "") -> None:
    """Fly what is missing of a table, seed by seed over all cases, or over those that begin with `only`."""
    known = {(r["table"], r["case"], r["seed"]) for r in flown(DATA)}
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for case in cases(table):
            if (table, case, str(seed)) in known or not case.startswith(only):
                continue
            begun = time.monotonic()
            row = fly(table, case, seed)
            append(DATA, COLUMNS, row)
            print(
                f"{table} {case} {seed}: {row['distance_m']:.3f} m, {time.monotonic() - begun:.0f} s",
                flush=True,
            )


def main(asked: list[str]) -> int:
    if asked[:1] == ["lagged"]:
        add("lagged", 10)
    elif asked[:1] == ["ring"]:
        add("ring", 20, "20 ")
        add("ring", 5, "50 ")
    elif asked[:1] == ["pairs"]:
        if asked[2:]:  # only these autopilots
            for name in set(FLOWN) - set(asked[2:]):
                del FLOWN[name]
        add("pairs", int(asked[1]) if asked[1:] else 50)
    elif asked[:1] == ["slowed"] and asked[1:]:
        FLOWN.clear()
        FLOWN["slowed inverting"] = asked[1]
        add("pairs", int(asked[2]) if asked[2:] else 50)
    else:
        print(__doc__)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
