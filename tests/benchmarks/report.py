"""From the measurements to docs/guide/performance.md: every row against its target."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import large
from benchmarks.runs import KINDS
from benchmarks.steps import exponent
from testbed.report.style import PAGE, drawing

GUIDE = Path(__file__).parents[2] / "docs" / "guide"
PAGE_FILE = GUIDE / "performance.md"
DATA = GUIDE / "data" / "performance.json"
TABLE = GUIDE / "data" / "performance.csv"
FIGURE = GUIDE / "figures" / "performance-split.png"
TEMPLATE = Path(__file__).parent / "performance.md.in"

# The authors' C++ program, on the same kind of machine: bare steps per vehicle-step.
AUTHORS = 13.0


@dataclass(frozen=True)
class Row:
    """One target: `value` in `unit`, to be at most (or at least) `target`.

    interval  of the value, where it was measured several times
    """

    what: str
    value: float
    target: float
    unit: str = ""
    at_most: bool = True
    why: str = ""
    interval: tuple[float, float] | None = None

    @property
    def holds(self) -> bool:
        return self.value <= self.target if self.at_most else self.value >= self.target

    def __str__(self) -> str:
        return f"{self.what}: {_number(self.value)} {self.unit} ({self.sign} {self.target:g}) {self.verdict}"

    @property
    def sign(self) -> str:
        return "<=" if self.at_most else ">="

    @property
    def noisy(self) -> bool:
        """Whether the interval reaches over the target: more measurements would be needed."""
        return self.interval is not None and self.interval[0] <= self.target <= self.interval[1]

    @property
    def verdict(self) -> str:
        said = "meets it" if self.holds else "**misses it**"
        return f"noisy: {said}, but the interval reaches over the target" if self.noisy else said

    @property
    def measured(self) -> str:
        """The value, with its interval."""
        if self.interval is None:
            return _number(self.value)
        return f"{_number(self.value)} ({_number(self.interval[0])} to {_number(self.interval[1])})"


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def rows(found: dict[str, Any]) -> list[Row]:
    """The targets of the project, with what was measured."""
    table = []
    for name, r in found["runs"].items():
        parts = ", ".join(f"{kind} {r['parts'][kind]:.2f}" for kind in KINDS)
        if r["in_turn"]:
            parts += f". Of FDM, JSBSim's own steps took {r['parts']['JSBSim']:.2f}."
        interval = tuple(r["interval"]) if "interval" in r else None
        row = Row(f"{name}: flight", r["ratio"], r["target"], "x its bare steps", why=parts)
        table.append(replace(row, interval=interval))
    table += large.rows(found)
    fresh = found["fresh"]["times"]
    table.append(Row("the same filter steps, faster than a fresh OSQP each", fresh, 8.0, "x", False))
    for mode, targets in (("limited", {20: 65, 100: 650}), ("centralised", {20: 330, 50: 2700})):
        for cost in found[mode]:
            if cost["vehicles"] in targets:
                what = f"filter step, {mode}, {cost['vehicles']} vehicles active"
                target = targets[cost["vehicles"]]
                why = "numpy's calls on few numbers, then the solver's; more on a busy machine"
                table.append(Row(what, cost["bare_steps"], target, "bare steps", why=why))
    # 10 us of the machine on which this step of the paper's filter takes 36 us.
    for role, steps in found.get("border", {}).items():
        what = f"the border's checks of an own {role}, 2 vehicles"
        table.append(Row(what, steps, 0.278, "steps of the paper's filter"))
    between = [c for c in found["limited"] if c["vehicles"] in (20, 100)]
    table.append(Row("growth exponent in k, limited, 20 to 100", exponent(between), 2.0))
    failed = sum(c["unsolved"] for c in found["centralised"])
    table.append(Row("centralised QPs unsolved", failed, 0.0, "vehicles"))
    m = found["memory"]
    what = f"memory, {m['vehicles']} X8s, {m['duration_s']:g} s"
    table.append(Row(f"{what}: peak", m["peak_mb"], 600.0, "MB"))
    table.append(Row(f"{what}: growth in its last third", m["growth_mb_per_min"], 10.0, "MB/min"))
    table.append(Row("`testbed --help`", found["starting"]["help_s"], 0.35, "s"))
    table.append(Row("`import filters`", found["starting"]["import_s"], 0.25, "s"))
    if found["campaign"]:
        two = found["campaign"]["campaigns"][-1]
        cores = f"the two workers had {two['cores']:.2f} cores between them"
        table.append(Row("campaign, 2 workers over 1", two["speedup"], 1.8, "x", False, why=cores))
    return table


def write(found: dict[str, Any]) -> None:
    """The page, its data and its figure."""
    DATA.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    table = rows(found)
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["what", "value", "unit", "bound", "target", "holds"])
        for r in table:
            bound = "at most" if r.at_most else "at least"
            out.writerow([r.what, f"{r.value:.4g}", r.unit, bound, f"{r.target:g}", r.holds])
    _figure(found["split"])
    PAGE_FILE.write_text(page(found, table), encoding="utf-8")


def page(found: dict[str, Any], table: list[Row]) -> str:
    lines = [f"| {r.what} | {r.measured} {r.unit} | {r.sign} {r.target:g} | {r.verdict} |" for r in table]
    misses = [f"- {r.what}: {r.why.rstrip('.')}." for r in table if not r.holds and r.why]
    m, versions = found["machine"], found["machine"]["versions"]
    names = ", ".join(f"{name} {versions[name]}" for name in ("python", "jsbsim", "numpy", "daqp", "osqp"))
    bare = found["bare_us"]
    starts = [
        f"| {name} | {r['ratio']:.2f} | {r['start_s']:.2f} s | {r['with_start']:.2f} |"
        for name, r in found["runs"].items()
    ]
    kinds = [
        f"| {row['vehicles']} | " + " | ".join(_number(row[kind]) for kind in KINDS) + " |"
        for row in found["split"]
    ]
    unicycle = found["runs"]["paper-20-turn on unicycles"]
    at_100 = found["split"][-1]
    whole = sum(at_100[kind] for kind in KINDS)
    return TEMPLATE.read_text(encoding="utf-8").format(
        machine=f"{m['processor']}, {m['cores']} cores, {m['system']}; {names}",
        load=m["load"],
        bare=f"{median(bare):.1f}",
        bare_least=f"{min(bare):.1f}",
        bare_most=f"{max(bare):.1f}",
        table="\n".join(lines),
        misses="\n".join(misses) or "None.",
        starts="\n".join(starts),
        kinds="\n".join(kinds),
        kind_names=" | ".join(KINDS),
        rules="---|" * len(KINDS),
        unicycle=f"{unicycle['ratio']:.1f}",
        authors=f"{AUTHORS:g}",
        authors_times=f"{AUTHORS / unicycle['ratio']:.1f}",
        fresh=f"{found['fresh']['fresh']:.0f}",
        ours=f"{found['fresh']['ours_mean']:.1f}",
        fresh_times=f"{found['fresh']['times']:.0f}",
        apart=f"{found['fresh']['apart']:.0e}",
        largest=at_100["vehicles"],
        fdm_share=f"{100 * at_100['FDM'] / whole:.0f}",
        bounds="\n".join(_bounds(found)),
        cache=found["machine"]["cache_kb"],
        fleets=large.text(found),
        gain=large.gain(found["fleets"]),
        cluster=large.cluster(found.get("cluster")),
        city=large.city(found["memory_city"]),
        run_s=_number(one := _one(found)),
        million_days=_number(1e6 * one / 86400),
    )


def _bounds(found: dict[str, Any]) -> list[str]:
    """Rows: what aircraft and program take alone, and what they cost each other through the cache."""
    rows = []
    for name, r in found["runs"].items():
        if r.get("program"):
            alone = r["in_turn"] + r["program"]
            numbers = r["in_turn"], r["swept"], r["program"], alone, r["ratio"] - alone, r["ratio"]
            rows.append(f"| {name} | " + " | ".join(f"{x:.2f}" for x in numbers) + f" | {r['target']:g} |")
    return rows


def _one(found: dict[str, Any]) -> float:
    """Seconds of a short run of two X8s, with its start."""
    short = found["runs"]["2 X8s, filter 20 Hz, centralised"]
    us = median(found["bare_us"])
    return float(short["start_s"] + short["ratio"] * 2 * 4000 * 1e-6 * us)


def _figure(split: list[dict[str, float]]) -> None:
    """Cost of a filter step against the number of vehicles, by kind, with the slopes of k and k^2."""
    with drawing() as pyplot:
        figure, axes = pyplot.subplots(figsize=(0.6 * PAGE, 3.2))
        k = [row["vehicles"] for row in split]
        for kind, mark in zip(KINDS, "osd^v", strict=True):
            axes.loglog(k, [row[kind] for row in split], marker=mark, markersize=3.5, label=kind)
        first = split[0]["FDM"]
        axes.loglog(k, [first * n / k[0] for n in k], color="0.6", linestyle=":", linewidth=0.8)
        axes.set_xlabel("vehicles k")
        axes.set_ylabel("bare steps per filter step")
        axes.set_xticks(k, [str(n) for n in k])
        axes.minorticks_off()
        axes.set_title("X8s meeting, filter at 20 Hz")
        axes.legend()
        figure.tight_layout()
        figure.savefig(FIGURE, dpi=160)
