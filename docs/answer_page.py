"""Writes the tables of docs/guide/answer.md from the runs in docs/guide/data/answer.

    python docs/answer_page.py

The runs are those of `testbed answer`; the page's text outside the marked tables is written by hand.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from testbed.studies.answer.answer import markdown
from testbed.studies.answer.cells import COLUMNS, Cell
from testbed.studies.answer.design import (
    DESIGN,
    EVADING,
    FASTER,
    FLOW,
    KEPT,
    LAGS,
    NONE,
    RANGE,
    SLEWED,
    SMOOTHED,
    Block,
)

if TYPE_CHECKING:
    import pandas as pd

GUIDE = Path(__file__).parent / "guide"
PAGE, DATA = GUIDE / "answer.md", GUIDE / "data" / "answer" / "answer.csv"
FIRST = (
    Cell("unicycle", 2, "swap", "calm", NONE, "straight"),
    Cell("x8", 2, "swap", "calm", NONE, "straight"),
    Cell("rascal", 2, "swap", "calm", NONE, "straight"),
    Cell("x8", 2, "swap", "calm", LAGS, "straight"),
    Cell("rascal", 2, "swap", "calm", LAGS, "straight"),
    Cell("x8@px4@typical", 2, "swap", "calm", LAGS, "straight"),
    Cell("x8@px4@typical", 2, "swap", "calm", FLOW, "straight"),
    Cell("rascal@px4@typical", 2, "swap", "calm", FLOW, "straight"),
    Cell("x8", 20, "swap", "calm", NONE, "straight"),
    Cell("x8", 20, "swap", "calm", RANGE, "straight"),
    Cell("rascal", 20, "swap", "calm", RANGE, "straight"),
    *(Cell(a, 20, "swap", air, KEPT, EVADING) for a in ("x8", "rascal") for air in ("calm", "windy")),
    Cell("x8", 20, "swap", "calm", FASTER, "roundabout"),
    Cell("x8", 50, "swap", "calm", FASTER, "roundabout"),
    Cell("unicycle", 20, "random", "calm", SMOOTHED, "straight"),
    *(Cell(a, 20, "random", "calm", remedy, EVADING) for remedy in (KEPT, SLEWED) for a in ("x8", "rascal")),
)
SHORT = "| fleet | remedy; guidance | runs that lose Ds | 95 % | runs with h < 0 | vehicles that arrive |"


def tables(kept: pd.DataFrame) -> dict[str, str]:
    """What stands between the marks of the page, by their names."""
    rows = {Cell(*(getattr(r, name) for name in COLUMNS)): r for r in kept.itertuples()}
    lines = [SHORT, "|---" * 6 + "|"]
    for r in (rows[cell] for cell in FIRST if cell in rows):
        lines.append(
            f"| {r.number} {r.vehicle}, {r.mission}, {r.weather} | {r.remedy}; {r.guidance}"
            f" | {r.lost} of {r.runs} | {100 * r.rate_low:.1f} to {100 * r.rate_high:.1f} %"
            f" | {r.h_below_0} of {r.runs}"
            f" | {r.arrived_share * r.number * r.runs:.0f} of {r.number * r.runs} |"
        )
    return {"first": "\n".join(lines) + "\n", "cells": "\n".join(_block(b, kept) for b in DESIGN)}


def _block(block: Block, kept: pd.DataFrame) -> str:
    mine = [Cell(*key) in block.cells for key in kept[COLUMNS].itertuples(index=False)]
    missing = len(block.cells) - sum(mine)
    note = f" {missing} of its {len(block.cells)} cells have not been flown." if missing else ""
    return f"**{block.why}.**{note}\n" + (f"\n{markdown(kept[mine])}" if any(mine) else "")


def written(page: str, made: dict[str, str]) -> str:
    """The page with its marked tables replaced. ValueError if a mark is missing."""
    for name, text in made.items():
        mark = re.compile(rf"(<!-- table: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        page, count = mark.subn(lambda found, text=text: f"{found[1]}\n{text}\n{found[2]}", page)  # type: ignore[misc]
        if count != 1:
            raise ValueError(f"{PAGE}: {count} tables marked {name}")
    return page


def main(asked: Sequence[str]) -> int:
    import pandas as pd

    if asked:
        print(__doc__)
        return 2
    PAGE.write_text(written(PAGE.read_text("utf-8"), tables(pd.read_csv(DATA))), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
