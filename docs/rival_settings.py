"""Finds the settings of every filter by one search: a small grid, flown in 20 encounters on two plants.

    python docs/rival_settings.py [KIND ...]

Two unicycles and two X8s fly encounters 1 to 20 (head-on, crossing and converging in turn, drawn
as `testbed encounters generate KIND --seed K --miss 5` draws them). The best setting loses the fewest of the
40, then misses the fewest goals, then alters the least. What is found goes to
docs/guide/data/rivals/KIND.csv; a setting that is there already is not flown again.
"""

from __future__ import annotations

import csv
import itertools
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import testbed
from testbed.claims.registry import GOAL, INTERVENTION, SEPARATION
from testbed.encounters.generating import Settings, generate
from testbed.encounters.scenarios import Choices, made
from testbed.scenario.scenario import Scenario
from testbed.scenario.variants import changed

FOLDER = Path(__file__).parent / "guide" / "data" / "rivals"
SEEDS = range(1, 21)
MEETING = ("head-on", "crossing", "converging")
PLANTS: dict[str, dict[str, Any]] = {
    "unicycle": {"plant": "unicycle"},
    "X8": {"plant": "jsbsim", "airframes": ["x8"]},
}
# filter.kind -> the values that are tried of each field; every combination is flown.
GRIDS: dict[str, list[dict[str, list[Any]]]] = {
    "none": [{}],
    "centralised": [
        {"filter.cost": ["raw", "range"], "alpha.coefficient": [1.0], "remedy.ds_buffer_m": [0.5]},
    ],
    "collision-cone": [{"filter.decay_per_s": [1.0, 3.0], "remedy.ds_buffer_m": [0.5]}],
    "optimal-decay": [
        {"filter.decay_weight": [0.01, 1.0], "alpha.coefficient": [1.0], "remedy.ds_buffer_m": [0.5]}
    ],
    "velocity-obstacles": [
        {"filter.horizon_s": [5.0], "filter.response_s": [1.0, 2.0], "remedy.ds_buffer_m": [0.0, 0.5]},
        {"filter.horizon_s": [10.0], "filter.response_s": [1.0], "remedy.ds_buffer_m": [0.0, 0.5]},
    ],
}
RESULTS = ("lost", "late", "altered")
COLUMNS = ("setting", "best", "n", *(f"{what}_{plant}" for plant in PLANTS for what in RESULTS))


def settings(kind: str) -> Iterator[dict[str, Any]]:
    """Every setting of the kind's grid, as fields of a scenario."""
    for grid in GRIDS[kind]:
        for values in itertools.product(*grid.values()):
            yield dict(zip(grid, values, strict=True))


def encounter(seed: int) -> Scenario:
    """The tuning encounter of that seed, flown to 5 s after it would have met, and 7 s more."""
    [found] = generate(MEETING[(seed - 1) % len(MEETING)], seed, 1, Settings(miss_m=5.0))
    # Goals lie as far behind the meeting as it is away; half of that way is enough.
    nearer = [
        replace(a, goal=a.start + 0.75 * (a.goal - a.start)) for a in found.aircraft if a.goal is not None
    ]
    way = max(float(((a.goal - a.start) ** 2).sum() ** 0.5) / a.speed for a in nearer if a.goal is not None)
    ended = replace(found, aircraft=tuple(nearer), end=way + 7.0)
    return made(ended, Choices("filter", "goal", matched=False)).scenario()


def flown(kind: str, setting: dict[str, Any]) -> dict[str, Any]:
    """A row of the table."""
    row: dict[str, Any] = {"setting": words(setting), "n": len(SEEDS)}
    for plant, fields in PLANTS.items():
        lost, late, altered = 0, 0, 0.0
        for seed in SEEDS:
            s = changed(
                encounter(seed),
                {**fields, "filter.kind": kind, "rates.record_dt_s": 1.0, "seed": seed, **setting},
            )
            run = testbed.run(s, force=True)
            lost += run.guarantee(SEPARATION.id)["verdict"] != "holds"
            late += run.guarantee(GOAL.id)["verdict"] != "holds"
            altered += float(run.guarantee(INTERVENTION.id)["value"]) / len(SEEDS)
        row |= {f"lost_{plant}": lost, f"late_{plant}": late, f"altered_{plant}": round(altered, 4)}
    return row


def words(setting: dict[str, Any]) -> str:
    """As `--set` takes it."""
    return " ".join(f"{name}={value}" for name, value in setting.items())


def score(row: dict[str, Any]) -> tuple[float, ...]:
    """Smaller is better."""
    return tuple(sum(float(row[f"{what}_{plant}"]) for plant in PLANTS) for what in RESULTS)


def main(kinds: list[str]) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    for kind in kinds or list(GRIDS):
        file = FOLDER / f"{kind}.csv"
        rows = list(csv.DictReader(file.open(encoding="utf-8"))) if file.is_file() else []
        known = {row["setting"] for row in rows}
        for setting in settings(kind):
            if words(setting) not in known:
                rows.append(flown(kind, setting))
                write(file, rows)


def write(file: Path, rows: list[dict[str, Any]]) -> None:
    """The rows with the best marked."""
    best = min(rows, key=score)
    for row in rows:
        row["best"] = int(row is best)
    with file.open("w", newline="", encoding="utf-8") as out:
        table = csv.DictWriter(out, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main(sys.argv[1:])
