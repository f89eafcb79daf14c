"""Flies a benchmark into its folder, and writes what it found there.

benchmark.json  the benchmark, its cells, comparisons, worst encounters and provenance
journal.jsonl   a line per finished run
runs.csv        a row per run
cells.csv       a row per set, plant and filter
cost.json       ms per step: the only numbers that depend on the machine
loss.*          the figure
worst/          run folders and scenario files of the worst encounters
report.html     the page
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.campaigns.folder import locked
from testbed.campaigns.journal import Journal
from testbed.components.versions import versions
from testbed.errors import UserError, nearest, short
from testbed.records.checksums import plain
from testbed.records.store import write_json
from testbed.report.page import attach
from testbed.studies.benchmark import cost, figures, table, worst
from testbed.studies.benchmark.benchmark import Plan, fly_all, plan, rows
from testbed.studies.benchmark.confirm import confirm, kept
from testbed.studies.benchmark.file import load, shortened
from testbed.studies.common.found import Found

MARK, JOURNAL = "benchmark.json", "journal.jsonl"


def benchmark(
    source: str,
    out: Path,
    workers: int | None = None,
    n: int | None = None,
    minutes: float | None = None,
    as_it_is: bool = False,
    only: Sequence[str] = (),
    again: int | None = None,
) -> Found:
    """Fly a benchmark, or go on with it; write tables, figure and page once all is flown.

    n         encounters of each set at most; None: as the file says
    minutes   after which no more is flown in this call; None: to the end
    as_it_is  fly nothing, and write tables, figure and page of what is flown
    only      filters whose runs are flown in this call; empty: all
    again     how many runs of each cell are flown again where earlier code flew them, to keep the others
    Raises   UserError for a mistake in the file, or a folder that holds something else
    """
    b, folder = load(source)
    for name in only:
        if name not in b.filters:
            raise UserError(f"--only: no filter {short(name)!r}; {nearest(name, b.filters)}")
    made = plan(shortened(b, n) if n is not None else b, folder)
    _check(out, b.name)
    out.mkdir(parents=True, exist_ok=True)
    with locked(out):
        journal = Journal(out / JOURNAL)
        if not as_it_is:
            if again is not None:
                confirm(made, journal, again, workers)
            fly_all(made, journal, workers, minutes, only)
        return _written(made, journal, out, as_it_is)


def _check(out: Path, name: str) -> None:
    """UserError if the folder holds anything but this benchmark."""
    if not out.exists() or not any(out.iterdir()):
        return
    if not (out / JOURNAL).is_file():
        raise UserError(f"{out} holds no benchmark (no {JOURNAL}); give another --out")
    if (out / MARK).is_file():
        theirs = json.loads((out / MARK).read_text(encoding="utf-8"))["benchmark"]["name"]
        if theirs != name:
            raise UserError(f"{out} belongs to the benchmark {theirs!r}; give another --out")


def _written(made: Plan, journal: Journal, out: Path, as_it_is: bool) -> Found:
    import pandas as pd

    b, flown = made.benchmark, rows(made, journal)
    vehicles = {name: len(of[0].data["vehicle"]) for name, of in made.sets.items()}
    total = made.size
    with_page = as_it_is or len(flown) == total
    if not flown:
        raise UserError(f"{out}: no run is flown; give more --minutes, and no --as-it-is")
    found = table.cells(flown, b.without)
    pooled = table.pooled(flown, vehicles, b.without)
    compared = table.comparisons(flown, vehicles, b.without)
    shown = worst.worst(made, flown) if with_page else []
    if with_page:
        worst.fly(made, shown, out)
        cost.costs(made, out)
    data = {
        "benchmark": b.model_dump(mode="json"),
        "complete": len(flown) == total,
        "runs": len(flown),
        "of": total,
        "vehicles": vehicles,
        "sources": {name: of[0].data["description"] for name, of in made.sets.items()},
        "cells": found,
        "pooled": pooled,
        "comparisons": [_compared(c) for c in compared],
        "worst": shown,
        "earlier": kept(made, journal, flown),
        "code": made.code,
        "versions": versions(),
        "airframes": made.airframes,
    }
    write_json(out / MARK, plain(data))
    if with_page:
        from testbed.studies.benchmark.page import part

        pd.DataFrame(flown).to_csv(out / "runs.csv", index=False)
        pd.DataFrame(found).to_csv(out / "cells.csv", index=False)
        figures.loss(pooled, out)
        attach(out, out.name, part)
    return Found(out, f"{b.name}: {len(flown)} of {total} runs", _printed(pooled), _lines(data, out), data)


def _compared(c: table.Comparison) -> dict[str, Any]:
    pair = c.pair
    return {
        "fleet": c.fleet,
        "plant": c.plant,
        "first": c.first,
        "second": c.second,
        "encounters": pair.runs,
        "only_first": pair.only_first,
        "only_second": pair.only_second,
        "p_value": pair.p_value,
        "sure": c.sure,
    }


def _printed(pooled: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [
        {
            "fleet": r["set"],
            "plant": r["plant"],
            "filter": r["filter"],
            "lost": f"{r['lost']}/{r['runs']}",
            "95 % interval": f"{100 * r['lost_low']:.1f}-{100 * r['lost_high']:.1f} %",
            "altered": f"{100 * r['altered']:.0f} %",
            "all arrived": f"{r['arrived']}/{r['runs']}",
        }
        for r in pooled
    ]


def _lines(data: Mapping[str, Any], out: Path) -> list[str]:
    sure = [c for c in data["comparisons"] if c["sure"]]
    lines = [
        f"{len(sure)} of {len(data['comparisons'])} comparisons of two filters are sure"
        " (exact paired tests, 5 % for all together)"
    ]
    if not data["complete"]:
        lines.append(f"{data['runs']} of {data['of']} runs are flown; the same command goes on")
        print(lines[-1], file=sys.stderr)
    return lines
