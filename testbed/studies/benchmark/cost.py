"""Measures how long filters take a step: the only numbers of a benchmark that depend on the machine."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from filters.barriers.pairs import Barrier
from filters.filter import Decision
from filters.model import Array, Command, Limits, View
from testbed.components import catalogue
from testbed.components.components import Parts
from testbed.errors import UserError
from testbed.records.store import write_json
from testbed.scenario.scenario import Scenario
from testbed.studies.benchmark.benchmark import Cell, Plan

FILE = "cost.json"
# A run's first steps include imports and first solutions.
WARM = 20


def measure(s: Scenario) -> dict[str, Any]:
    """Median and 95 % quantile [ms] of the processor time of a filter's step; empty where it is refused."""
    from testbed.simulation.simulate import run

    seconds: list[float] = []

    def timed(scenario: Scenario, barrier: Barrier, goal: Array) -> Any:
        own = catalogue.filter_(scenario, barrier, goal)

        def step(view: View, nominal: Command, limits: Limits) -> Decision:
            begun = time.thread_time()
            decision = own(view, nominal, limits)
            seconds.append(time.thread_time() - begun)
            return decision

        return step

    try:
        run(s, force=True, parts=Parts(filter=timed))
    except UserError:
        return {}
    kept = 1000.0 * np.array(seconds[WARM:] or seconds or [np.nan])
    return {"median_ms": float(np.median(kept)), "most_ms": float(np.quantile(kept, 0.95))}


def costs(made: Plan, folder: Path) -> list[dict[str, Any]]:
    """A row per filter and size of fleet, measured in the first encounter of a set, on the first plant.

    Kept in `folder`; what is there already, of the same code, is not measured again.
    """
    file = folder / FILE
    found = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    if found.get("code") != made.code:
        found = {"code": made.code, "rows": []}
    rows: list[dict[str, Any]] = found["rows"]
    there = {(r["filter"], r["vehicles"]) for r in rows}
    b = made.benchmark
    plant = next(iter(b.plants))
    for name in b.filters:
        for set_ in b.sets:
            s = made.scenarios[Cell(name, plant, set_)]
            if (name, s.vehicles) not in there:
                there.add((name, s.vehicles))
                flight = made.flight(Cell(name, plant, set_), 0)
                rows.append({"filter": name, "vehicles": s.vehicles} | measure(flight.scenario()))
                write_json(file, found)
    return rows


def beside(rows: Sequence[Mapping[str, Any]], first: str) -> list[dict[str, Any]]:
    """The rows with `times`, how many times as long a step takes as that of the filter `first`, or None."""
    of = {(r["filter"], r["vehicles"]): r.get("median_ms") for r in rows}
    found = []
    for r in rows:
        mine, theirs = r.get("median_ms"), of.get((first, r["vehicles"]))
        found.append({**r, "times": mine / theirs if mine and theirs else None})
    return found
