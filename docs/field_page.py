"""Writes docs/guide/field.md from a folder of `testbed benchmark field` and one of its search.

testbed benchmark field --search 4 --out runs/field-search
testbed benchmark field --out runs/field
python docs/field_page.py runs/field runs/field-search
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from testbed.studies.benchmark import guide, search

GUIDE = Path(__file__).parent / "guide"
DATA = GUIDE / "data" / "field"
TITLE = "The field: filters of several authors on one scale"
BEFORE = """
Made by `testbed benchmark field` and `python docs/field_page.py runs/field runs/field-search`; how it works
stands in [benchmarks](benchmark.md). Every cell is a row of [data/field/cells.csv](data/field/cells.csv).

Encounters of the first four sets come from small files of our own making, one in each format that
[`testbed encounters import`](encounters.md) reads, perturbed from a seed: an aircraft that crosses and climbs
(`crossing`, NASA DAIDALUS), two that converge along legs (`converging`, BlueSky), one that turns across the
own path or passes it (`turning`, a trajectory table in feet and knots, misses of up to 60 m), and an
overtaking (`overtaking`, CSV). In `twenty`, twenty vehicles cross a square of 0.2 km² on courses drawn
evenly. All vehicles fly under the filter.
"""


def tried(folder: Path) -> str:
    """The chapter on the search for settings."""
    data = json.loads((folder / search.FILE).read_text(encoding="utf-8"))
    said = (
        f"Settings were searched for alike: four of each filter, in {data['encounters']} encounters of each"
        f" set of two on the X8, from seed {data['seed']}. Chosen is what lost fewest runs, and of equals"
        " what altered least."
    )
    return f"## Settings tried\n\n{said}\n\n{guide.markdown([search.shown(r) for r in data['rows']])}\n"


def main(asked: list[str]) -> int:
    if not asked:
        print(__doc__)
        return 2
    folder = Path(asked[0])
    DATA.mkdir(parents=True, exist_ok=True)
    for name in ("cells.csv", "cost.json"):
        shutil.copy(folder / name, DATA / name)
    shutil.copy(folder / "loss.svg", GUIDE / "figures" / "field-loss.svg")
    text = guide.text(folder, "figures/field-loss.svg", TITLE, BEFORE)
    if asked[1:]:
        text += "\n" + tried(Path(asked[1]))
        shutil.copy(Path(asked[1]) / search.FILE, DATA / search.FILE)
    (GUIDE / "field.md").write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
