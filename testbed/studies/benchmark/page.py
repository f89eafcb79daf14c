"""Makes a benchmark's part of a page: tables with intervals, loss against intervention, worst encounters."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.measures.cylinders import SMALL_NMAC, SMALL_WELL_CLEAR
from testbed.measures.encounter_measures import DEFAULT_THRESHOLD
from testbed.report import playback, settings
from testbed.report.blocks import OPEN, Block, Note, Part, Playback, Section, Table
from testbed.report.folder_files import attached, json_of, pictures, text_of
from testbed.statistics import Rate
from testbed.studies.benchmark import cost, worst

MARK = "benchmark.json"
WHAT = (
    "**Lost** is a run in which two vehicles, one of them under the filter, come closer than Ds, or that ends"
    " before its end; **NMAC** one in which they come into each other's cylinder of"
    f" {SMALL_NMAC}, the small unmanned aircraft's near mid-air collision. A **risk ratio** is the rate with"
    " the filter over that without, encounter by encounter. **Time altered** is the share of vehicles' time"
    f" in which a command is altered by more than {100 * DEFAULT_THRESHOLD:g} % of its channel's range. A"
    f" **nuisance** is an intervention in an encounter that stays well clear ({SMALL_WELL_CLEAR}) without the"
    " filter. **Added** is the time to the goal beyond that alone, median of the runs in which somebody"
    " arrived."
)
HOW = (
    f"Intervals are 95 %: of rates {Rate.method}; of mean shares the union of a studentised bootstrap and"
    " Student's t; of risk ratios"
    " Clopper-Pearson of their two parts, added."
)


def part(folder: Path, title: str) -> Part:
    """A benchmark's part of a page."""
    data = json_of(folder / MARK)
    b = data["benchmark"]
    sure = [c for c in data["comparisons"] if c["sure"]]
    left = [] if data["complete"] else [f"{data['runs']} of {data['of']} runs are flown so far."]
    return Part(
        title=f"benchmark {b['name']}",
        what=f"{data['runs']} runs: {len(b['filters'])} filters on {len(b['plants'])} plants in"
        f" {len(b['sets'])} sets of encounters. {b['description']} Folder: {title}",
        # A benchmark compares; it has no verdict of its own.
        status=OPEN,
        headline=f"{len(sure)} of {len(data['comparisons'])} comparisons of two filters are sure",
        details=[
            *left,
            WHAT.replace("**", ""),
            f"All filters fly the same encounters from the same seeds. {HOW}",
            "Filters are in the file's order: the order says nothing.",
        ],
        sections=[
            Section("Loss against intervention", pictures(folder, ("loss",), CAPTION, None, [])),
            Section("Every cell", [Table(shown(data["cells"]), "Lost runs, altered steps, arrivals",
                                         downloads=attached(folder / "cells.csv"))]),
            Section("What is sure", _sure(data)),
            Section("Milliseconds a step", _cost(folder, b["reference"] or next(iter(b["filters"])))),
            *(_worst(folder, data["worst"])),
            Section("Settings and provenance", _settings(data)),
        ],
    )  # fmt: skip


TESTS = (
    "Every two filters on every plant, encounter by encounter over all sets of one size: exact binomial"
    " tests of the encounters that only one of them lost; by Holm's rule all of them together err in at"
    " most 5 %. Of two filters that are not listed neither is shown to lose fewer."
)
CAPTION = "Runs lost over the time in which commands are altered, with 95 % intervals"


def shown(cells: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The cells as a person reads them."""
    return [
        {"set": c["set"], "plant": c["plant"], "filter": c["filter"]}
        | ({"lost": f"not flown: {c['why']}"} if not c["runs"] else numbers(c))
        for c in cells
    ]


def numbers(c: Mapping[str, Any]) -> dict[str, str]:
    """The numbers of a cell with runs, each with its interval."""

    def percent(name: str) -> str:
        return f"[{100 * c[f'{name}_low']:.0f}, {100 * c[f'{name}_high']:.0f}] %"

    def ratio(name: str) -> str:
        if c.get(name) is None:
            return ""
        ends = (c[f"{name}_low"], c[f"{name}_high"])
        return f"{c[name]:.2g} [{', '.join('-' if x is None else f'{x:.2g}' for x in ends)}]"

    return {
        "lost": f"{c['lost']} of {c['runs']} {percent('lost')}",
        "risk ratio": ratio("ratio"),
        "NMAC": f"{c['nmac']} {percent('nmac')}",
        "NMAC ratio": ratio("nmac_ratio"),
        "least, median m": f"{c['least_m']:.1f}, {c['median_m']:.1f}" if c["least_m"] is not None else "",
        "time altered": f"{100 * c['altered']:.0f} {percent('altered')}",
        "nuisance": f"{c['nuisance']} of {c['nuisance_of']}" if c.get("nuisance_of") else "",
        "all arrived": f"{c['arrived']} {percent('arrived')}",
        "added s": f"{c['added_s']:+.1f}" if c["added_s"] is not None else "",
    }


def _sure(data: Mapping[str, Any]) -> list[Block]:
    rows = [
        {
            "fleet": c["fleet"],
            "plant": c["plant"],
            "loses fewer": c["first"],
            "than": c["second"],
            "lost by the one alone": c["only_first"],
            "by the other alone": c["only_second"],
            "encounters": c["encounters"],
            "p": c["p_value"],
        }
        for c in data["comparisons"]
        if c["sure"]
    ]
    return [Note(TESTS), Table(rows, "Comparisons that are sure")]


def _cost(folder: Path, first: str) -> list[Block]:
    file = folder / cost.FILE
    rows = cost.beside(json.loads(text_of(file))["rows"], first) if file.is_file() else []
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
