"""Writes a benchmark as a page of the guide, in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.report.folder_files import json_of
from testbed.report.settings import said
from testbed.studies.benchmark import cost, page


def text(folder: Path, figure: str, before: str = "") -> str:
    """The page of a benchmark's folder.

    figure  address of the drawing, as the page names it
    before  what stands below the title
    """
    data = json_of(folder / page.MARK)
    b = data["benchmark"]
    blocks = [
        f"# {b['description'].partition('.')[0]}",
        before.strip(),
        f"{data['runs']} runs: {len(b['filters'])} filters on {len(b['plants'])} plants in {len(b['sets'])} sets of"
        " encounters. A run is **lost** if two vehicles, one of them under the filter, come closer than Ds, or if it"
        f" ends before its end. {page.HOW} Filters stand in the file's order, which says nothing.",
        f"![Runs lost over steps altered]({figure})",
        "## All sets of one size together",
        _pooled(data["pooled"]),
        "## Which filters lose fewer runs than which",
        _sure(data),
        "## Every set",
        *_cells(data["cells"]),
        "## Milliseconds a step",
        _cost(folder, b),
        "## Worst encounters",
        _worst(data["worst"]),
        "## What was flown",
        _flown(data),
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table; columns in the order in which rows have them."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    if not rows:
        return "None."
    lines = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    lines += [
        "| " + " | ".join(str(row.get(c, "")).replace("|", "/") for c in columns) + " |" for row in rows
    ]
    return "\n".join(lines)


def _pooled(rows: Sequence[Mapping[str, Any]]) -> str:
    return markdown([{"vehicles" if k == "set" else k: v for k, v in r.items()} for r in page.shown(rows)])


def _sure(data: Mapping[str, Any]) -> str:
    found = data["comparisons"]
    lines = [
        "Every two filters on every plant, encounter by encounter: exact paired tests, which by Holm's rule err in at"
        f" most 5 % all together. {sum(c['sure'] for c in found)} of {len(found)} are sure. Of two filters that are"
        " not listed here neither is shown to lose fewer.",
        "",
    ]
    groups: dict[tuple[str, str, str], list[str]] = {}
    for c in found:
        if c["sure"]:
            first = c["only_second"] > c["only_first"]
            better, worse = (c["first"], c["second"]) if first else (c["second"], c["first"])
            few, many = sorted((c["only_first"], c["only_second"]))
            groups.setdefault((c["fleet"], c["plant"], better), []).append(f"{worse} ({few} against {many})")
    rows = [
        {
            "vehicles": fleet,
            "plant": plant,
            "filter": name,
            "loses fewer than (lost by the one alone)": ", ".join(of),
        }
        for (fleet, plant, name), of in groups.items()
    ]
    return "\n".join(lines) + markdown(rows)


def _cells(cells: Sequence[Mapping[str, Any]]) -> list[str]:
    found = []
    for set_ in dict.fromkeys(c["set"] for c in cells):
        rows = [
            {k: v for k, v in r.items() if k != "set"}
            for r in page.shown([c for c in cells if c["set"] == set_])
        ]
        found += [f"### {set_}", markdown(rows)]
    return found


def _cost(folder: Path, b: Mapping[str, Any]) -> str:
    rows = json_of(folder / cost.FILE)["rows"]
    sizes = sorted({r["vehicles"] for r in rows})
    of = {(r["filter"], r["vehicles"]): r for r in rows}
    first = b["reference"] or next(iter(b["filters"]))

    def row(name: str) -> dict[str, Any]:
        made: dict[str, Any] = {"filter": name}
        for n in sizes:
            here, there = of.get((name, n), {}), of.get((first, n), {})
            if "median_ms" in here and "median_ms" in there:
                times = here["median_ms"] / there["median_ms"]
                made[f"{n} vehicles: median, 95 % [ms]"] = f"{here['median_ms']:.3f}, {here['most_ms']:.3f}"
                made[f"{n}: times {first}"] = f"{times:.2g}"
        return made

    note = "Processor time of a step of the whole fleet in one encounter; the numbers are of one machine."
    slow = [
        r["filter"] for r in map(row, b["filters"]) if any(_slow(v) for k, v in r.items() if "times" in k)
    ]
    if slow:
        note += f" More than ten times as long as {first}: {', '.join(slow)}."
    return f"{note}\n\n{markdown([row(name) for name in b['filters']])}"


def _slow(times: str) -> bool:
    return float(times) > 10.0


def _worst(listed: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        {
            "set": w["set"],
            "encounter": w["encounter"],
            "plant": w["plant"],
            "lost by": ", ".join(w["lost_by"]) or "nobody",
            "nearest": f"{w['nearest']}, {w['distance_m']:.2f} m",
        }
        for w in listed
    ]
    return (
        "Of each set the encounter that most filters lost, or that came nearest. The folder's `report.html` plays"
        f" them, all filters together.\n\n{markdown(rows)}"
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
