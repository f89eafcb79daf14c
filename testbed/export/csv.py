"""Writes a run as CSV tables: one observation per row, the unit in each column's name."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pandas as pd

from testbed.export.events import Event, events
from testbed.records.run import (
    AIRCRAFT_COLUMNS,
    DECLARED_COLUMNS,
    FENCE_COLUMNS,
    LEFT_COLUMNS,
    PAIR_COLUMNS,
    VEHICLE_COLUMNS,
    WIND_COLUMNS,
    Run,
)
from testbed.records.store import write_json

MARK = "export.json"
EVENT_COLUMNS = {
    "t_s": ("s", "time since the start"),
    "kind": ("", "the guarantee, or what happened"),
    "vehicles": ("", "vehicles concerned, counted from 1, joined by -"),
    "text": ("", "what happened, in words"),
}


def write(run: Run, folder: Path) -> list[Event]:
    """Write vehicles.csv, pairs.csv, events.csv and columns.csv below `folder`; returns the events.

    And fences.csv, of a run with fences.

    Numbers have all their digits: read back they are equal to the run's.
    """
    found = events(run)
    rows = [asdict(e) | {"vehicles": "-".join(map(str, e.vehicles))} for e in found]
    tables = {
        "vehicles": run.vehicles,
        "pairs": run.pairs,
        **({"fences": run.fences} if len(run.fences) else {}),
        "events": pd.DataFrame(rows, columns=list(EVENT_COLUMNS)),
    }
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False, lineterminator="\n")
    known = {
        "vehicles": VEHICLE_COLUMNS | AIRCRAFT_COLUMNS | WIND_COLUMNS | LEFT_COLUMNS,
        "pairs": PAIR_COLUMNS | DECLARED_COLUMNS,
        "fences": FENCE_COLUMNS,
        "events": EVENT_COLUMNS,
    }
    said = [
        (name, c, *known[name].get(c, (_unit(c), "recorded by the plant")))
        for name, table in tables.items()
        for c in table.columns
    ]
    pd.DataFrame(said, columns=["table", "column", "unit", "meaning"]).to_csv(
        folder / "columns.csv", index=False, lineterminator="\n"
    )
    write_json(folder / MARK, {"run": run.manifest, "guarantees": run.guarantees})
    return found


def _unit(column: str) -> str:
    """The unit of a column that only its plant knows, such as a surface's: by the end of its name."""
    units = {"rad": "rad", "m": "m", "mps": "m/s", "radps": "rad/s", "s": "s", "mps2": "m/s^2"}
    return units.get(column.rpartition("_")[2], "")
