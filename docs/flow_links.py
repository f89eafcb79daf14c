"""Flies the flow filter with the ladder's noise, latency and loss, and writes docs/guide/flow-links.md.

    python docs/flow_links.py two [SEEDS]      # two X8s, one departure of the ladder after the other
    python docs/flow_links.py twenty [SEEDS]   # twenty vehicles on the lagged plant, each departure alone
    python docs/flow_links.py fleet [SEEDS]    # twenty X8s in JSBSim, none and all three departures
    python docs/flow_links.py page             # the page, of what has been flown

A run that is in docs/guide/data/flow-links.csv is not flown again.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from flow_rows import append, flown

import testbed
from testbed.scenario.scenario import load
from testbed.statistics import rate

GUIDE = Path(__file__).parent / "guide"
DATA, PAGE = GUIDE / "data" / "flow-links.csv", GUIDE / "flow-links.md"
COLUMNS = ("table", "case", "seed", "vehicles", "distance_m", "h_m", "flow_m", "arrived", "ended")
FIRST_SEED = 2001
COMMON = (
    'filter.kind="flow"', "guidance.lookahead_m=10", "rates.filter_dt_s=0.05", "rates.record_dt_s=1",
    "manoeuvre_instants=0", "start.lateral_perturbation_m=10", "start.heading_perturbation_deg=5",
    "start.height_perturbation_m=1",
)  # fmt: skip
LAGGED = ('plant="lagged"', 'lags.source="airframe"')
NOISE = ("sensing.position_noise_m=0.5", "sensing.course_noise_deg=1", "sensing.speed_noise_mps=0.3")
LATENCY, LOSS = ("network.latency_s=0.1",), ("network.loss=0.1",)
# In 5 m/s of wind gamma at 16 m/s cannot be flown.
TWO = ("duration_s=30", "filter.margin_m=2", "barrier.v_mps=19")
STEPS = {
    "lagged plant": LAGGED,
    "6-DOF": ('plant="jsbsim"',),
    "wind": ("wind.speed_mps=5",),
    "gusts": ('gusts.intensity="moderate"',),
    "noise": NOISE,
    "latency": LATENCY,
    "loss": LOSS,
}
FLEET = ('plant="jsbsim"', "duration_s=40", "filter.margin_m=2")
TWENTY = ("duration_s=40", *LAGGED)
ALONE = {"none": (), "noise": NOISE, "latency": LATENCY, "loss": LOSS, "all three": NOISE + LATENCY + LOSS}


def cases(table: str) -> dict[str, tuple[str, tuple[str, ...]]]:
    """case -> built-in scenario and what is set in it."""
    found: dict[str, tuple[str, tuple[str, ...]]] = {}
    if table == "two":
        said: tuple[str, ...] = (*COMMON, *TWO)
        for step, more in STEPS.items():
            said = (*said, *more)
            found[step] = ("paper-2-turn", said)
        return found
    if table == "fleet":
        return {name: ("paper-20-turn", (*COMMON, *FLEET, *ALONE[name])) for name in ("none", "all three")}
    for margin in (0, 2):
        for name, more in ALONE.items():
            if margin == 0 or name in ("noise", "all three"):
                found[f"{name}, m = {margin} m"] = (
                    "paper-20-turn", (*COMMON, *TWENTY, f"filter.margin_m={margin}", *more),
                )  # fmt: skip
    return found


def fly(table: str, case: str, seed: int) -> dict[str, Any]:
    """One row of the data; a start that cannot be flown in this air has no distance."""
    name, said = cases(table)[case]
    row: dict[str, Any] = {"table": table, "case": case, "seed": seed}
    try:
        run = testbed.run(load(name, [*said, f"seed={seed}"]))
    except testbed.UserError as error:
        if "cannot fly steadily" not in str(error):
            raise
        return {**row, "ended": "not flown"}
    value = {v.id: v.value for v in run.guarantees}
    added = run.guarantee("intervention")["detail"]["path_added_m"]
    return {
        **row,
        "vehicles": len(added),
        "distance_m": value["separation"],
        "h_m": value["safe-set"],
        "flow_m": value["monitor-flow_clear"],
        "arrived": len([a for a in added if a is not None]),
        "ended": run.manifest["ended_early"] or "",
    }


def add(table: str, seeds: int) -> None:
    """Fly what is missing of a table, seed by seed over all cases."""
    known = {(r["table"], r["case"], r["seed"]) for r in flown(DATA)}
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for case in cases(table):
            if (table, case, str(seed)) in known:
                continue
            row = fly(table, case, seed)
            append(DATA, COLUMNS, row)
            print(row, flush=True)


TITLES = {
    "two": "Two X8s head-on, m = 2 m, gamma at 19 m/s: each line adds to the one above",
    "twenty": "Twenty on the lagged plant, 40 s, gamma at 16 m/s: each departure alone",
    "fleet": "Twenty X8s in JSBSim, calm, straight to the antipodes, 40 s, m = 2 m, gamma at 16 m/s",
}
HEAD = (
    "case", "flown", "not flown", "lost", "95 % interval [%]", "least distance [m]", "h < 0", "least h [m]",
    "least clearance on the flow [m]", "arrived",
)  # fmt: skip


HEADING = """\
# The flow filter with noise, late and lost packets

The ladder's values: white noise of 0.5 m, 1 degree and 0.3 m/s at every step on what each vehicle
measures of itself and broadcasts; packets 0.1 s late; a tenth of them lost. Seeds from 2001 on. Lost is
a run with less than Ds = 5 m between two vehicles, or one that ended early; not flown is a start whose
gust at t = 0 leaves too little airspeed. h is the paper's, at the true state; h < 0 counts runs. The
clearance on the flow (F1) is that of the flows as they are, from measured poses: with noise it shows
the noise. Under the paper's filter two X8s lose Ds in 15 of 19 starts like the last two lines'
([ladder.md](ladder.md), look-ahead 10 m). What the theorem means here: [flow.md](flow.md).

**What survives:** Ds and the paper's h at the true state, in every run below, and nearly all arrive.
**What does not:** with late packets a period may use up more than kappa of a clearance (F2; how much
more is derived), and with noise neither F1 nor F2 can be told from what was measured. Few runs: the
intervals are wide.

Remade by `python docs/flow_links.py two 20`, `... twenty 4`, `... fleet 1`, `... page`; every run is a
row of [data/flow-links.csv](data/flow-links.csv).
"""


def page() -> str:
    """The page, in Markdown."""
    lines = [HEADING]
    for table, title in TITLES.items():
        rows = [r for r in flown(DATA) if r["table"] == table]
        if rows:
            lines += [f"## {title}", "", "| " + " | ".join(HEAD) + " |", "|---" * len(HEAD) + "|"]
            named = dict.fromkeys(r["case"] for r in rows)
            lines += [_line(case, [r for r in rows if r["case"] == case]) for case in named]
            lines.append("")
    return "\n".join(lines)


def _line(case: str, rows: list[dict[str, str]]) -> str:
    there = [r for r in rows if r["ended"] != "not flown"]
    lost = rate([float(r["distance_m"]) < 5.0 or bool(r["ended"]) for r in there])
    least = {k: min(float(r[k]) for r in there) for k in ("distance_m", "h_m", "flow_m")}
    cells = (
        case,
        len(there),
        len(rows) - len(there),
        lost.count,
        f"{100 * lost.low:.1f} to {100 * lost.high:.1f}",
        f"{least['distance_m']:.2f}",
        sum(float(r["h_m"]) < 0 for r in there),
        f"{least['h_m']:.2f}",
        f"{least['flow_m']:.2f}",
        f"{sum(int(r['arrived']) for r in there)} of {sum(int(r['vehicles']) for r in there)}",
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def main(asked: list[str]) -> int:
    if asked[:1] == ["page"]:
        PAGE.write_text(page(), encoding="utf-8")
    elif asked[:1] and asked[0] in TITLES:
        add(asked[0], int(asked[1]) if asked[1:] else {"two": 20, "twenty": 4, "fleet": 1}[asked[0]])
    else:
        print(__doc__)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
