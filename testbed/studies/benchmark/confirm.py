"""Keeps runs of earlier code where some of them, flown again, give the same rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from testbed.campaigns.display import say
from testbed.campaigns.journal import Journal, Row
from testbed.studies.benchmark.benchmark import Plan, fly_some
from testbed.studies.benchmark.flight import Flight

# Between rows that are the same: sums may have been taken in another order.
TOLERANCE = 1e-6


def confirm(made: Plan, journal: Journal, n: int, workers: int | None = None) -> None:
    """Keep a filter's runs on a plant that earlier code flew, if samples flown again give the same rows.

    n  runs drawn of each set; one row that differs, and none of the filter's runs on the plant is kept
    """
    earlier = _earlier(made, journal)
    groups: dict[tuple[str, str], dict[str, list[Flight]]] = {}
    for f in made.flights():
        if Plan.key(f) not in journal.entries and f.id in earlier:
            groups.setdefault((f.filter, f.plant), {}).setdefault(f.set, []).append(f)
    # Another code draws others.
    rng = np.random.default_rng(int(made.code, 16))
    drawn = {
        group: [of[k] for of in sets.values() for k in rng.permutation(len(of))[:n]]
        for group, sets in groups.items()
    }
    fly_some([f for of in drawn.values() for f in of], journal, workers)
    for group, sets in groups.items():
        again = [(f, journal.rows[Plan.key(f)]) for f in drawn[group]]
        differ = [f.encounter for f, row in again if not same(earlier[f.id], row)]
        name = " on ".join(group)
        if differ:
            say(f"{name}: {len(differ)} of {len(again)} differ, {differ[0]} first; its runs are flown anew")
            continue
        say(f"{name}: {len(again)} flown again are the same; {sum(map(len, sets.values()))} runs are kept")
        for f in (f for of in sets.values() for f in of if Plan.key(f) not in journal.entries):
            journal.keep(Plan.key(f), earlier[f.id])


def kept(made: Plan, journal: Journal, rows: Sequence[Row]) -> dict[str, Any]:
    """How many of `rows` earlier code flew, which code, and how many runs of their groups both codes flew."""
    old = [r for r in rows if r["code"] != made.code]
    groups = {(r["filter"], r["plant"]) for r in old}
    new = {r["id"] for r in rows if r["code"] == made.code and (r["filter"], r["plant"]) in groups}
    both = new & _earlier(made, journal).keys()
    return {"runs": len(old), "codes": sorted({r["code"] for r in old}), "again": len(both)}


def _earlier(made: Plan, journal: Journal) -> dict[str, Row]:
    """A run's id -> the last row of other code."""
    return {row["id"]: row for row in journal.rows.values() if row["code"] != made.code}


def same(first: Row, second: Row) -> bool:
    """Whether two runs have one row, to 1e-6 of each number; what code flew them is left out."""
    return _told(first) == _told(second) and all(
        math.isclose(value, second[name], rel_tol=TOLERANCE, abs_tol=TOLERANCE)
        for name, value in first.items()
        if isinstance(value, float)
    )


def _told(row: Mapping[str, Any]) -> dict[str, Any]:
    return {k: float if isinstance(v, float) else v for k, v in row.items() if k != "code"}
