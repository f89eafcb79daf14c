"""Flies the flow filter on fresh seeds and writes the tables of docs/guide/flow-measured.md.

    python docs/flow_tables.py lagged          # twenty vehicles on the lagged plant, 10 seeds, both airframes
    python docs/flow_tables.py pairs [SEEDS]   # two X8s, head-on and crossing, under three autopilots
    python docs/flow_tables.py slowed FOLDER [SEEDS]   # the same of an airframe of your own
    python docs/flow_tables.py page            # the page, of what has been flown

A run that is in docs/guide/data/flow.csv is not flown again.
"""

from __future__ import annotations

import csv
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import testbed
from testbed.scenario.scenario import load
from testbed.statistics import rate

GUIDE = Path(__file__).parent / "guide"
DATA = GUIDE / "data" / "flow.csv"
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
FLOWN = {"ArduPlane": "x8@arduplane", "PX4": "x8@px4", "inverting": "x8"}
MEETINGS = {"head-on": ("paper-2-turn", "duration_s=30"), "crossing": ("crossing", "duration_s=30")}


def cases(table: str) -> dict[str, tuple[str, tuple[str, ...]]]:
    """case -> built-in scenario and what is set in it."""
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


def flown() -> list[dict[str, str]]:
    """The rows there are."""
    if not DATA.exists():
        return []
    with DATA.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def add(table: str, seeds: int) -> None:
    """Fly what is missing of a table, seed by seed over all cases."""
    known = {(r["table"], r["case"], r["seed"]) for r in flown()}
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for case in cases(table):
            if (table, case, str(seed)) in known:
                continue
            begun = time.monotonic()
            row = fly(table, case, seed)
            new = not DATA.exists()
            with DATA.open("a", encoding="utf-8", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                if new:
                    writer.writeheader()
                writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})
            print(
                f"{table} {case} {seed}: {row['distance_m']:.3f} m, {time.monotonic() - begun:.0f} s",
                flush=True,
            )


TITLES = {
    "lagged": "Twenty vehicles on the lagged plant, 40 s, m = 0",
    "pairs": "Two X8s in JSBSim, 30 s, m = 2 m",
}
HEAD = (
    "case", "runs", "lost", "interval [%]", "least distance [m]", "least h [m]",
    "least clearance on the flow [m]", "arrived", "last at [s]", "path added, median and most [m]",
)  # fmt: skip


def page() -> str:
    """The page, in Markdown."""
    lines = [
        "# What the flow filter was measured at",
        "",
        "Seeds from 2001 on, on which nobody tuned, all in calm air. Lost is a run with less than Ds between",
        "two vehicles, or one that ended early; intervals are 95 %. h is the paper's, at the true state; the",
        "path added is that of the vehicle that flew most.",
        "",
        "Remade by `python docs/flow_tables.py lagged`, `... pairs 50`, `... slowed FOLDER 8`, `... page`;",
        "every run is a row of [data/flow.csv](data/flow.csv). FOLDER is the X8's with turn, climb and speed",
        "bandwidths of 3.6, 0.8 and 0.6 rad/s in airframe.toml, identified anew.",
        "",
    ]
    for table, title in TITLES.items():
        rows = [r for r in flown() if r["table"] == table]
        if rows:
            lines += [f"## {title}", "", "| " + " | ".join(HEAD) + " |", "|---" * len(HEAD) + "|"]
            named = dict.fromkeys(r["case"] for r in rows)
            lines += [_line(case, [r for r in rows if r["case"] == case]) for case in named]
            lines.append("")
    return "\n".join(lines)


def _line(case: str, rows: list[dict[str, str]]) -> str:
    def numbers(column: str) -> list[float]:
        return [float(r[column]) for r in rows if r[column]] or [float("nan")]

    lost = rate([float(r["distance_m"]) < 5.0 or bool(r["ended"]) for r in rows])
    arrived, all_ = sum(int(r["arrived"]) for r in rows), sum(int(r["vehicles"]) for r in rows)
    added = numbers("path_added_m")
    cells = (
        case,
        len(rows),
        lost.count,
        f"{100 * lost.low:.1f} to {100 * lost.high:.1f}",
        f"{min(numbers('distance_m')):.2f}",
        f"{min(numbers('h_m')):.2f}",
        f"{min(numbers('flow_m')):.3f}",
        f"{arrived} of {all_}",
        f"{max(numbers('last_s')):.1f}",
        f"{np.median(added):.1f}, {max(added):.1f}",
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def main(asked: list[str]) -> int:
    if asked[:1] == ["page"]:
        (GUIDE / "flow-measured.md").write_text(page(), encoding="utf-8")
    elif asked[:1] == ["lagged"]:
        add("lagged", 10)
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
