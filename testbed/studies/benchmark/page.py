"""Makes a benchmark's part of a page: tables with intervals, loss against intervention, worst encounters."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.report import playback, settings
from testbed.report.blocks import OPEN, Block, Note, Part, Playback, Section, Table, read_csv
from testbed.report.folder_files import attached, json_of, pictures, text_of
from testbed.statistics import Rate
from testbed.studies.benchmark import cost, worst

MARK = "benchmark.json"
HOW = (
    f"Intervals are 95 %: of rates {Rate.method}; of mean shares the union of a studentised bootstrap and"
    " Student's t."
)


def part(folder: Path, title: str) -> Part:
    """A benchmark's part of a page."""
    data = json_of(folder / MARK)
    b = data["benchmark"]
    sure = [c for c in data["comparisons"] if c["sure"]]
    return Part(
        title=f"benchmark {b['name']}",
        what=f"{data['runs']} runs: {len(b['filters'])} filters on {len(b['plants'])} plants in"
        f" {len(b['sets'])} sets of encounters. {b['description']} Folder: {title}",
        # A benchmark compares; it has no verdict of its own.
        status=OPEN,
        headline=f"{len(sure)} of {len(data['comparisons'])} comparisons of two filters are sure",
        details=[
            "A run is lost if two vehicles, one of them under the filter, come closer than Ds, or if it ends"
            " before its end. All filters fly the same encounters from the same seeds.",
            HOW + " Filters are in the file's order: the order says nothing.",
        ],
        sections=[
            Section("Loss against intervention", pictures(folder, ("loss",), CAPTION, None, [])),
            Section("Every cell", [Table(shown(data["cells"]), "Lost runs, altered steps, arrivals",
                                         downloads=attached(folder / "cells.csv"))]),
            Section("What is sure", _sure(data)),
            Section("Milliseconds a step", _cost(folder)),
            *(_worst(folder, data["worst"])),
            Section("Settings and provenance", _settings(data)),
        ],
    )  # fmt: skip


CAPTION = "Runs lost over steps altered, with 95 % intervals, by plant and size of fleet"


def shown(cells: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The cells as a person reads them."""
    return [
        {"set": c["set"], "plant": c["plant"], "filter": c["filter"]}
        | ({"lost": f"not flown: {c['why']}"} if not c["runs"] else numbers(c))
        for c in cells
    ]


def numbers(c: Mapping[str, Any]) -> dict[str, str]:
    """The numbers of a cell with runs, each with its interval."""

    def percent(low: float, high: float) -> str:
        return f"[{100 * low:.0f}, {100 * high:.0f}] %"

    return {
        "lost": f"{c['lost']} of {c['runs']} {percent(c['low'], c['high'])}",
        "least, median m": f"{c['least_m']:.1f}, {c['median_m']:.1f}" if c["least_m"] is not None else "",
        "steps altered": f"{100 * c['overridden']:.0f} {percent(c['overridden_low'], c['overridden_high'])}",
        "all arrived": f"{c['arrived']} {percent(c['arrived_low'], c['arrived_high'])}",
        "added s": f"{c['added_s']:+.1f}" if c["added_s"] is not None else "",
    }


def _sure(data: Mapping[str, Any]) -> list[Block]:
    rows = [
        {
            "fleet": c["fleet"],
            "plant": c["plant"],
            "loses fewer": c["first"] if c["only_second"] > c["only_first"] else c["second"],
            "than": c["second"] if c["only_second"] > c["only_first"] else c["first"],
            "lost by the one alone": min(c["only_first"], c["only_second"]),
            "by the other alone": max(c["only_first"], c["only_second"]),
            "encounters": c["encounters"],
            "p": c["p_value"],
        }
        for c in data["comparisons"]
        if c["sure"]
    ]
    said = (
        "Every two filters on every plant, encounter by encounter over all sets of one size: exact binomial"
        " tests of the encounters that only one of them lost; by Holm's rule all of them together err in at"
        " most 5 %. Of two filters that are not listed neither is shown to lose fewer."
    )
    return [Note(said), Table(rows, "Comparisons that are sure")]


def _cost(folder: Path) -> list[Block]:
    file = folder / cost.FILE
    rows = json.loads(text_of(file))["rows"] if file.is_file() else []
    return [Table(rows, "Processor time of a step of the whole fleet, in one encounter, on this machine")]


def _worst(folder: Path, listed: Sequence[Mapping[str, Any]]) -> list[Section]:
    sections = []
    for w in listed:
        runs = worst.runs(folder, w)
        if not runs:
            continue
        by = ", ".join(w["lost_by"]) or "nobody"
        said = (
            f"{w['encounter']} on {w['plant']}: lost by {by}; nearest under {w['nearest']},"
            f" {w['distance_m']:.2f} m. Flown again: testbed run worst/{w['set']}.toml"
        )
        sections.append(Section(f"Worst encounter: {w['set']}", [Note(said), Playback(playback.data(runs))]))
    return sections


def _settings(data: Mapping[str, Any]) -> list[Block]:
    b = data["benchmark"]
    rows = [{"what": f"filter {k}", "value": settings.said(v)} for k, v in b["filters"].items()]
    rows += [{"what": f"plant {k}", "value": settings.said(v)} for k, v in b["plants"].items()]
    for name, of in b["sets"].items():
        rows.append({"what": f"set {name}", "value": f"{of['n']} encounters. {data['sources'][name]}"})
    rows += [{"what": "every run", "value": settings.said(b["set"])}, {"what": "seed", "value": b["seed"]}]
    return [Table(rows, "What was flown"), *settings.of_study(data)]


def runs_of(folder: Path) -> list[dict[str, Any]]:
    """Every run's row."""
    return read_csv(text_of(folder / "runs.csv"))
