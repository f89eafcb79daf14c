"""Writes docs/guide/field.md from the folders of `testbed benchmark field` and its search.

testbed benchmark field --search 3 --out runs/field-search
testbed benchmark field --out runs/field
python docs/field_page.py runs/field runs/field-search
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from testbed.studies.benchmark import cost, guide, search, worst
from testbed.studies.benchmark.page import MARK

GUIDE = Path(__file__).parent / "guide"
DATA = GUIDE / "data" / "field"
TITLE = "The field: filters of several authors on one scale"
BEFORE = """
Made by `testbed benchmark field` and `python docs/field_page.py runs/field runs/field-search`; how it works
stands in [benchmarks](benchmark.md), what the rivals are in [rivals](rivals.md). Every cell is a row of
[data/field/cells.csv](data/field/cells.csv).

Encounters of the first four sets come from small files of our own making, one in each format that
[`testbed encounters import`](encounters.md) reads, perturbed from a seed: an aircraft that crosses and climbs
(`crossing`, NASA DAIDALUS), two that converge along legs (`converging`, BlueSky), one that turns across the
own path or passes it (`turning`, a trajectory table in feet and knots, misses of up to 60 m), and an
overtaking (`overtaking`, CSV). In `twenty`, twenty vehicles cross a square of 0.2 km² on courses drawn
evenly. All vehicles fly under the filter. Ds is 5 m: who keeps it exactly may still come into the
near-mid-air-collision cylinder, which is three times as wide.
"""


def page() -> str:
    """The page, of what lies in docs/guide/data/field."""
    before = f"{BEFORE.strip()}\n\n{where_lost()}"
    return f"{guide.text(DATA, 'figures/field-loss.svg', TITLE, before, 'data/field/worst')}\n{tried()}"


def where_lost() -> str:
    """In which sets each filter lost runs on the last plant."""
    data = json.loads((DATA / MARK).read_text(encoding="utf-8"))
    b = data["benchmark"]
    plant = list(b["plants"])[-1]
    lost: dict[str, list[str]] = {name: [] for name in b["filters"] if name != b["without"]}
    for c in data["cells"]:
        if c["plant"] == plant and c["filter"] in lost and c["lost"]:
            lost[c["filter"]].append(f"{c['lost']} of {c['runs']} in {c['set']}")
    none = " and ".join(name for name, said in lost.items() if not said)
    which = "; ".join(f"{name} {', '.join(said)}" for name, said in lost.items() if said)
    return (
        f"**Where runs were lost** on {plant}: {which}; {none or 'no filter'} none. Why a filter fails stands"
        " with each rival in [rivals](rivals.md). Who loses nothing may still let few arrive: see the column."
    )


def tried() -> str:
    """The chapter on the search for settings."""
    data = json.loads((DATA / search.FILE).read_text(encoding="utf-8"))
    said = (
        f"Settings were searched for alike, those of the rivals and ours: four of each filter, in"
        f" {data['encounters']} encounters of each set of two on the X8, from seed {data['seed']}: no"
        " encounter of the field was tuned on. Chosen is what lost fewest runs, and of equals what"
        " altered least; arrivals do not count. So few encounters tell only what is far worse."
    )
    return f"## Settings tried\n\n{said}\n\n{guide.markdown([search.shown(r) for r in data['rows']])}\n"


def main(asked: list[str]) -> int:
    if len(asked) != 2:
        print(__doc__)
        return 2
    flown, searched = map(Path, asked)
    DATA.mkdir(parents=True, exist_ok=True)
    for file in (flown / MARK, flown / cost.FILE, flown / "cells.csv", searched / search.FILE):
        shutil.copy(file, DATA / file.name)
    shutil.rmtree(DATA / worst.FOLDER, ignore_errors=True)
    (DATA / worst.FOLDER).mkdir()
    for file in (flown / worst.FOLDER).glob("*.toml"):
        shutil.copy(file, DATA / worst.FOLDER / file.name)
    shutil.copy(flown / "loss.svg", GUIDE / "figures" / "field-loss.svg")
    (GUIDE / "field.md").write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
