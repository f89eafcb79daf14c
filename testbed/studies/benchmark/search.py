"""Tries settings of filters before a benchmark, all filters by the same search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.campaigns.folder import locked
from testbed.campaigns.journal import Journal
from testbed.errors import UserError
from testbed.records.store import write_json
from testbed.report.settings import said
from testbed.studies.benchmark import table
from testbed.studies.benchmark.benchmark import fly_all, plan, rows
from testbed.studies.benchmark.confirm import confirm
from testbed.studies.benchmark.file import Benchmark, load, shortened
from testbed.studies.common.found import Found

FILE, JOURNAL = "search.json", "journal.jsonl"
# Of the search's encounters: the benchmark's own are others.
SEEDS_APART = 1000


def tried(b: Benchmark, n: int) -> Benchmark:
    """The benchmark that flies every candidate: on the last plant, `n` encounters of each set of two."""
    filters = {
        f"{name} {k}": fields
        for name in b.filters
        if name in b.candidates
        for k, fields in enumerate(settings_of(b, name), 1)
    }
    if not filters:
        raise UserError(f"{b.name}: has no [candidates] to search among")
    last = list(b.plants)[-1]
    sets = {name: s for name, s in b.sets.items() if not s.generate or s.vehicles == 2}
    changed = {
        "filters": filters,
        "plants": {last: b.plants[last]},
        "sets": sets,
        "candidates": {},
        "share": {},
    }
    changed |= {"seed": b.seed + SEEDS_APART, "reference": "", "without": ""}
    return shortened(b.model_copy(update=changed), n)


def settings_of(b: Benchmark, name: str) -> list[dict[str, Any]]:
    """What is tried of a filter: its own settings, and each candidate in their place."""
    kind = {"filter.kind": b.filters[name].get("filter.kind")}
    return [b.filters[name], *(kind | more for more in b.candidates[name])]


def search(
    source: str,
    out: Path,
    n: int,
    workers: int | None = None,
    minutes: float | None = None,
    again: int | None = None,
) -> Found:
    """Fly the candidates of a benchmark, and write which of each filter is best to out/search.json.

    Best is what loses fewest runs; of equals, what alters least. `again` as `study.benchmark` has it.
    """
    b, folder = load(source)
    made = plan(tried(b, n), folder)
    out.mkdir(parents=True, exist_ok=True)
    with locked(out):
        journal = Journal(out / JOURNAL)
        if again is not None:
            confirm(made, journal, again, workers)
        done = fly_all(made, journal, workers, minutes)
        found = table.pooled(rows(made, journal), {name: 2 for name in made.sets})
        listed = chosen(b, found)
        write_json(out / FILE, {"benchmark": b.name, "encounters": n, "seed": made.benchmark.seed,
                                "complete": done, "rows": listed})  # fmt: skip
    lines = (
        ["chosen: fewest lost, then least time altered"]
        if done
        else ["not finished; the same command goes on"]
    )
    return Found(out, f"{b.name}: settings tried on {list(b.plants)[-1]}", [shown(r) for r in listed], lines)


def chosen(b: Benchmark, found: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row per candidate, the best of each filter marked."""
    of = {r["filter"]: r for r in found if r["runs"]}
    why = {r["filter"]: r["why"] for r in found if not r["runs"]}
    kept = ("runs", "lost", "altered", "nmac", "arrived")
    made = []
    for name in b.candidates:
        tried_ = settings_of(b, name)
        labels = [f"{name} {k}" for k in range(1, len(tried_) + 1)]
        known = [label for label in labels if label in of]
        best = min(known, key=lambda x: (of[x]["lost"] / of[x]["runs"], of[x]["altered"]), default=None)
        for label, fields in zip(labels, tried_, strict=True):
            row = {"filter": name, "fields": fields, "chosen": label == best}
            numbers = {c: of[label][c] for c in kept} if label in of else {"why": why.get(label, "")}
            made.append(row | numbers)
    return made


def shown(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row as a person reads it."""
    settings = {k.removeprefix("filter."): v for k, v in row["fields"].items() if k != "filter.kind"}
    numbers = {"lost": "not flown", "time altered": "", "all arrived": ""}
    if row.get("runs"):
        numbers = {
            "lost": f"{row['lost']} of {row['runs']}",
            "time altered": f"{100 * row['altered']:.0f} %",
            "all arrived": f"{row['arrived']}",
        }
    named = said(settings) if settings else "as it is by default"
    return {"filter": row["filter"], "settings": named, **numbers, "chosen": "x" if row["chosen"] else ""}
