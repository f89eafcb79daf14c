"""Writes a benchmark as a page of the guide, in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.report.folder_files import json_of
from testbed.report.settings import said
from testbed.studies.benchmark import cost, page

Rows = Sequence[Mapping[str, Any]]


def text(folder: Path, figure: str, title: str, before: str = "", worst: str = "worst") -> str:
    """The page of a benchmark's folder.

    figure  address of the drawing, as the page names it
    before  what stands below the title
    worst   address of the folder of the worst encounters' scenario files
    """
    data = json_of(folder / page.MARK)
    b = data["benchmark"]
    runs = f"{data['runs']}" if data["complete"] else f"{data['runs']} of {data['of']}"
    counts = f"{len(b['filters'])} filters, {len(b['plants'])} plants, {len(b['sets'])} sets of encounters"
    blocks = [
        f"# {title}",
        before.strip(),
        f"{runs} runs: {counts}. All filters fly the same encounters from the same seeds.",
        f"{_numbers(data)} {_earlier(data)}".strip(),
        page.WHAT,
        f"{page.HOW} Filters stand in the file's order, which says nothing.",
        f"![Runs lost over the time in which commands are altered]({figure})",
        "## All sets of one size together",
        _pooled(data["pooled"]),
        "## Which filters lose fewer runs than which",
        _sure(data["comparisons"]),
        "## Every set",
        *_cells(data["cells"]),
        "## Milliseconds a step",
        _cost(folder, b),
        "## Worst encounters",
        _worst(data["worst"], worst),
        "## What was flown",
        _flown(data),
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def markdown(rows: Rows) -> str:
    """A table; columns in the order in which rows have them."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    if not rows:
        return "None."
    lines = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    for row in rows:
        cells = (str(row.get(c, "")).replace("|", "/") for c in columns)
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _pooled(rows: Rows) -> str:
    return markdown([{"fleet" if k == "set" else k: v for k, v in r.items()} for r in page.shown(rows)])


def _sure(found: Rows) -> str:
    groups: dict[tuple[str, str, str], list[str]] = {}
    for c in found:
        if c["sure"]:
            said = f"{c['second']} ({c['only_first']} : {c['only_second']})"
            groups.setdefault((c["fleet"], c["plant"], c["first"]), []).append(said)
    rows = [
        {"fleet": fleet, "plant": plant, "filter": name, "loses fewer than": ", ".join(of)}
        for (fleet, plant, name), of in groups.items()
    ]
    return (
        f"{page.TESTS} {sum(c['sure'] for c in found)} of {len(found)} are sure. In brackets: encounters that"
        f" only the better one lost, and only the other.\n\n{markdown(rows)}"
    )


def _cells(cells: Rows) -> list[str]:
    found = []
    for set_ in dict.fromkeys(c["set"] for c in cells):
        rows = page.shown([c for c in cells if c["set"] == set_])
        found += [f"### {set_}", markdown([{k: v for k, v in r.items() if k != "set"} for r in rows])]
    return found


def _cost(folder: Path, b: Mapping[str, Any]) -> str:
    first = b["reference"] or next(iter(b["filters"]))
    rows = cost.beside(json_of(folder / cost.FILE)["rows"], first)
    slow: dict[str, float] = {}
    for r in rows:
        if (r["times"] or 0.0) > 10.0:
            slow[r["filter"]] = max(r["times"], slow.get(r["filter"], 0.0))
    plant = next(iter(b["plants"]))
    note = (
        f"Processor time of a step of the whole fleet in one encounter on the plant {plant}, on one machine."
    )
    if slow:
        named = ", ".join(f"{name} ({times:.1f} times)" for name, times in slow.items())
        note += f" More than ten times as long as {first}: {named}."
    columns = {"filter": "filter", "vehicles": "vehicles", "median_ms": "median [ms]", "most_ms": "95 % [ms]"}
    columns["times"] = f"times {first}"

    def cell(value: Any) -> str:
        return f"{value:.3g}" if isinstance(value, float) else str(value or "")

    told = [{name: cell(r.get(k)) for k, name in columns.items()} for r in rows]
    return f"{note}\n\n{markdown(told)}"


def _numbers(data: Mapping[str, Any]) -> str:
    """How many encounters a cell has, and which cells have fewer than the file asks for."""
    b, sizes = data["benchmark"], data["vehicles"]
    there = {(c["filter"], c["plant"], c["set"]): c["runs"] + c["refused"] for c in data["cells"]}
    asked = {
        (name, plant, set_): max(1, round(b["share"].get(name, 1.0) * of["n"]))
        for name in b["filters"]
        for plant in b["plants"]
        for set_, of in b["sets"].items()
    }

    def listed(name: str) -> str:
        of = {sizes[set_]: n for (filter_, _, set_), n in asked.items() if filter_ == name}
        return " and ".join(f"{n} of {size} vehicles" for size, n in sorted(of.items()))

    full = next(name for name in b["filters"] if name not in b["share"])
    said = [f"Encounters of a cell: {listed(full)}", *(f"{name} {listed(name)}" for name in b["share"])]
    short = {cell: there.get(cell, 0) for cell, n in asked.items() if there.get(cell, 0) < n}
    if not short:
        return "; ".join(said) + "."
    ends: dict[tuple[int, int], list[int]] = {}
    for cell, n in short.items():
        ends.setdefault((asked[cell], sizes[cell[2]]), []).append(n)
    which = "; ".join(
        f"{len(of)} of {size} vehicles have at least {min(of)} of {n}" for (n, size), of in ends.items()
    )
    return f"{'; '.join(said)}; but {len(short)} of {len(asked)} cells have fewer so far: {which}."


def _earlier(data: Mapping[str, Any]) -> str:
    """Which runs earlier code flew, and how it was found that they are those of this code."""
    old = data["earlier"]
    if not old["runs"]:
        return ""
    return (
        f"{old['runs']} of the runs were flown by earlier code ({', '.join(old['codes'])}) and kept, because"
        f" {old['again']} runs of the same filters and plants, drawn at random and flown again by this code,"
        " gave the same rows to 1e-6 of each number."
    )


def _worst(listed: Rows, folder: str) -> str:
    rows = [
        {
            "set": f"[{w['set']}]({folder}/{w['set']}.toml)",
            "encounter": w["encounter"],
            "plant": w["plant"],
            "lost by": ", ".join(w["lost_by"]) or "nobody",
            "nearest": f"{w['nearest']}, {w['distance_m']:.2f} m",
        }
        for w in listed
    ]
    if not rows:
        return "None is recorded."
    first = listed[0]["set"]
    return (
        "Of each set the encounter that most filters lost; of equals the one that came nearest. Its scenario,"
        " with the filter under which it came nearest, is flown and played, in this page's folder, by"
        f" `testbed run {folder}/{first}.toml --out runs/worst --force` and"
        " `testbed report runs/worst --open`;"
        f" the benchmark's `report.html` plays all filters together.\n\n{markdown(rows)}"
    )


def _flown(data: Mapping[str, Any]) -> str:
    b = data["benchmark"]
    rows = [{"what": f"filter {k}", "settings": said(v)} for k, v in b["filters"].items()]
    rows += [{"what": f"plant {k}", "settings": said(v)} for k, v in b["plants"].items()]
    for name, of in b["sets"].items():
        source = data["sources"][name].partition("; limits")[0]
        rows.append({"what": f"set {name}", "settings": f"{of['n']} encounters, the first: {source}"})
    rows.append({"what": "every run", "settings": said(b["set"])})
    made = [f"seed {b['seed']}", f"code {data['code']}"]
    made += [f"{name} {version}" for name, version in data["versions"].items()]
    made += [f"airframe {name} {sha[:12]}" for name, sha in data["airframes"].items()]
    return f"{markdown(rows)}\n\nMade with {', '.join(made)}."
