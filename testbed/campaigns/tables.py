"""Writes a campaign's rows as runs.parquet and timings.parquet. Equal rows give equal bytes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from testbed.campaigns.folder import RUNS, TIMINGS, replace
from testbed.campaigns.plan import Plan, Planned
from testbed.measures.encounter_comparison import MEASURE


def write(path: Path, plan: Plan, flown: Sequence[Planned], entries: dict[str, dict[str, Any]]) -> None:
    """Both tables, a row per run in the plan's order."""
    _parquet(path / RUNS, runs(plan, flown, entries))
    timings = [{"id": r.id} | entries[r.id]["timing"] for r in flown]
    names = ("wall_s", "worker", "ended_unix_s")
    _parquet(path / TIMINGS, {"id": [t["id"] for t in timings]} | {n: [t[n] for t in timings] for n in names})


def runs(plan: Plan, flown: Sequence[Planned], entries: dict[str, dict[str, Any]]) -> dict[str, list[Any]]:
    """id, the axes' parameters, draws, the encounter's file, seed, status, reason, ended_early, vehicles
    arrived, measures (`measure_nmac_lost`, see `encounter_measures.columns`; truth is 1 or 0), and of each
    guarantee its value and verdict: `separation_value`, `separation_verdict`."""
    columns: dict[str, list[Any]] = {"id": [r.id for r in flown]}
    for name in plan.cells[0].parameters:
        columns[name] = _alike([plan.cells[r.cell].parameters[name] for r in flown])
    for name in plan.runs[0].draws:
        columns[name] = _alike([r.draws[name] for r in flown])
    if plan.campaign.encounters:
        columns["file"] = [plan.bases[r.base].file for r in flown]
    columns["seed"] = [r.seed for r in flown]
    rows = [entries[r.id]["row"] for r in flown]
    for name in ("status", "reason", "ended_early"):
        columns[name] = [row[name] for row in rows]
    if any("arrived" in row for row in rows):
        seen = [row.get("arrived") or [None, None, None] for row in rows]
        for k, name in enumerate(("arrived_value", "with_goal_value", "time_added_value")):
            columns[name] = [None if of[k] is None else float(of[k]) for of in seen]
    for name in dict.fromkeys(m for row in rows for m in row.get("measures", {})):
        columns[MEASURE + name] = [_number(row.get("measures", {}).get(name)) for row in rows]
    for guarantee in dict.fromkeys(g for row in rows for g in row["guarantees"]):
        seen = [row["guarantees"].get(guarantee, [None, None]) for row in rows]
        name = guarantee.replace("-", "_")
        columns[f"{name}_value"] = [value for value, _ in seen]
        columns[f"{name}_verdict"] = [verdict for _, verdict in seen]
    return columns


def _alike(values: list[Any]) -> list[Any]:
    """Numbers as floats and words as they are; anything else, or a mixture, as JSON text."""
    if all(isinstance(v, str) for v in values) or all(isinstance(v, bool) for v in values):
        return values
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        return [float(v) for v in values]
    return [v if isinstance(v, str) else json.dumps(v) for v in values]


def _number(value: bool | float | None) -> float | None:
    return None if value is None else float(value)


def _parquet(path: Path, columns: dict[str, list[Any]]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    def typed(name: str, values: list[Any]) -> Any:
        # A column without values needs a type too.
        if all(v is None for v in values):
            number = name.endswith("_value") or name.startswith(MEASURE)
            return pa.array(values, pa.float64() if number else pa.string())
        return pa.array(values)

    table = pa.table({name: typed(name, values) for name, values in columns.items()})
    replace(path, lambda partial: pq.write_table(table, partial, compression="zstd"))
