"""Writes docs/guide/flow-measured.md from the flights of docs/flow_tables.py and of the answer's cells.

python docs/flow_page.py
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from testbed.statistics import rate
from testbed.studies.answer.answer import markdown, table
from testbed.studies.answer.cells import COLUMNS, Cell
from testbed.studies.answer.design import EVADING, FASTER, KEPT, RANGE, SLEWED, SMOOTHED

GUIDE = Path(__file__).parent / "guide"
PAGE = GUIDE / "flow-measured.md"
TITLES = {
    "lagged": "Twenty vehicles on the lagged plant, 40 s, m = 0",
    "pairs": "Two X8s in JSBSim, 30 s, m = 2 m",
    "ring": "Around the roundabout in JSBSim, twenty for 30 s, fifty for 35 s, m = 2 m, kappa = 0.5",
}
BOTH, D_SAFE_M = ("x8", "rascal"), 5.0
LAYERS = [Cell(a, 20, "swap", air, KEPT, EVADING) for a in BOTH for air in ("calm", "windy")]
WEIGHTED = [Cell(a, 20, "swap", "calm", RANGE, "straight") for a in BOTH]
RANDOM = [Cell(a, 20, "random", "calm", remedy, EVADING) for remedy in (SLEWED, KEPT) for a in BOTH]
UNICYCLES = Cell("unicycle", 20, "random", "calm", SMOOTHED, "straight")
RINGS = [Cell("x8", n, "swap", "calm", FASTER, "roundabout") for n in (20, 50)]
FLEETS = [*WEIGHTED, *LAYERS, *RINGS, *RANDOM, UNICYCLES]
HEAD = (
    "case", "runs", "lost", "95 % [%]", "least distance [m]", "least h [m]",
    "least clearance on the flow [m]", "arrived", "last at [s]", "path added, median and most [m]",
)  # fmt: skip
TEXT = """\
# What the flow filter was measured at

Seeds from 2001 on, on which nobody tuned. Lost is a run with less than Ds between two vehicles, or one that
ended early; intervals are 95 %, Clopper-Pearson. h is the paper's, at the true state; the clearance on the
flow is the filter's own h, its claim F1 ([flow.md](flow.md)); the path added is that of the vehicle that flew
most.

Remade by `python docs/flow_tables.py lagged`, `... pairs 300 ArduPlane PX4`, `... slowed FOLDER 8` and
`testbed answer` ([answer.md](answer.md)); then `python docs/flow_page.py`. Every run is a row of
[data/flow.csv](data/flow.csv) or [data/answer/runs.csv](data/answer/runs.csv). FOLDER is the X8's with turn,
climb and speed bandwidths of 3.6, 0.8 and 0.6 rad/s in airframe.toml, identified anew.

## Against what was asked of it

What should be reached was written down before these seeds were flown.
"""


def page(flown: pd.DataFrame, answer: pd.DataFrame) -> str:
    """The page, in Markdown.

    flown   runs of docs/flow_tables.py
    answer  runs of `testbed answer`
    """
    lines = [TEXT, "| what | must show | measured | reached |", "|---|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in _aims(flown, answer)]
    for name, title in TITLES.items():
        rows = flown[flown.table == name]
        lines += ["", f"## {title}", "", f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
        lines += [_line(case, of) for case, of in rows.groupby("case", sort=False)]
    cells = table(answer)
    kept = cells[[Cell(*key) in FLEETS for key in cells[COLUMNS].itertuples(index=False)]]
    lines += ["", "## Fleets in JSBSim", ""]
    lines += [
        "120 s, fifty 60 s. All cells, and what the columns are: [answer.md](answer.md).",
        "",
        markdown(kept),
    ]
    return "\n".join(lines)


def _aims(flown: pd.DataFrame, answer: pd.DataFrame) -> Iterator[tuple[str, str, str, str]]:
    """What, what it must show, what was measured, and whether that was reached."""
    for cell in WEIGHTED:
        if not (of := _runs(answer, cell)).empty:
            share = of.arrived_share.mean()
            yield (
                f"{cell}",
                "95 % of vehicles arrive",
                f"{100 * share:.1f} %, {len(of)} runs",
                _met(share >= 0.95),
            )
    for case, of in flown[flown.table == "lagged"].groupby("case", sort=False):
        least, share = min(of.h_m.min(), of.flow_m.min()), of.arrived.sum() / of.vehicles.sum()
        yield (
            f"20 {case} on the lagged plant; flow; straight",
            "h and the clearance on the flow >= -0.02 m, 99 % arrive within 40 s",
            f"{least:.3f} m, {100 * share:.1f} %, {len(of)} runs",
            _met(least >= -0.02 and share >= 0.99),
        )
    for cells, arrive in ((LAYERS, 0.99), (RANDOM, 0.95)):
        for cell in cells:
            if not (of := _runs(answer, cell)).empty:
                lost, kept = int((of.distance_verdict != "holds").sum()), (of.h_m >= 0).mean()
                share = of.arrived_share.mean()
                yield (
                    f"{cell}",
                    f"20 runs: none loses Ds, h >= 0 in 95 %, {100 * arrive:.0f} % of vehicles arrive",
                    f"{lost} of {len(of)} lost, h >= 0 in {100 * kept:.0f} %, {100 * share:.2f} % arrive",
                    _met(lost == 0 and kept >= 0.95 and share >= arrive, len(of) >= 20),
                )
    for case, of in flown[flown.table == "ring"].groupby("case", sort=False):
        metres, by, n = (12, 30, 20) if case.startswith("20") else (7, 35, 5)
        home = of.arrived.sum() == of.vehicles.sum()
        yield (
            f"{case}, swap, calm; {FASTER}; roundabout",
            f"least distance {metres} m, all arrive within {by} s, {n} runs",
            f"{of.distance_m.min():.2f} m, {of.arrived.sum()} of {of.vehicles.sum()} arrive, the last at"
            f" {of.last_s.max():.1f} s, {len(of)} runs",
            _met(of.distance_m.min() >= metres and home and len(of) >= n),
        )
    for case, of in flown[flown.table == "pairs"].groupby("case", sort=False):
        if case.startswith(("ArduPlane", "PX4")):
            lost = _lost(of)
            yield (
                f"2 x8, {case}; flow; straight",
                "0 of 300 lost",
                f"{sum(lost)} of {len(of)} lost, path added {of.path_added_m.median():.1f} m (median)",
                _met(not any(lost) and len(of) >= 300),
            )


def _runs(answer: pd.DataFrame, cell: Cell) -> pd.DataFrame:
    return answer[(answer[COLUMNS] == list(cell)).all(axis=1)]


def _met(reached: bool, enough: bool = True) -> str:
    return ("yes" if enough else "yes, in fewer runs than asked for") if reached else "**no**"


def _lost(rows: pd.DataFrame) -> list[bool]:
    return [d < D_SAFE_M or isinstance(end, str) for d, end in zip(rows.distance_m, rows.ended, strict=True)]


def _line(case: object, rows: pd.DataFrame) -> str:
    lost = rate(_lost(rows))
    cells = (
        case,
        len(rows),
        lost.count,
        f"{100 * lost.low:.1f} to {100 * lost.high:.1f}",
        f"{rows.distance_m.min():.2f}",
        f"{rows.h_m.min():.2f}",
        f"{rows.flow_m.min():.3f}",
        f"{rows.arrived.sum()} of {rows.vehicles.sum()}",
        f"{rows.last_s.max():.1f}",
        f"{rows.path_added_m.median():.1f}, {rows.path_added_m.max():.1f}",
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def main(asked: list[str]) -> int:
    if asked:
        print(__doc__)
        return 2
    flown, answer = pd.read_csv(GUIDE / "data/flow.csv"), pd.read_csv(GUIDE / "data/answer/runs.csv")
    PAGE.write_text(page(flown, answer), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
