"""The report's rows and text on large fleets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from benchmarks.report import Row


def rows(found: dict[str, Any]) -> list[Row]:
    """Targets of large fleets, with what was measured."""
    from benchmarks.report import Row

    f, table = found["fleets"], []
    program = found["runs"]["20 X8s, filter 20 Hz, limited"].get("program", 0.0)
    alone = {(row["vehicles"], row["periods"]): row for row in f.get("gain", ())}.get((20, 10))
    for row in f["against_bare"]:
        n = row["workers"]
        what = f"20 X8s, filter 20 Hz, limited, on the wall, {n} worker{'s' * (n > 1)}"
        unit, between, why = "x its bare steps", (row["low"], row["high"]), ""
        if alone is not None:
            plant = alone["one_us" if n == 1 else "two_us"] / (200 * row["bare_us"])
            why = f"the plant alone takes {plant:.2f}, the same flight without aircraft {program:.2f}: in all"
            why += f" {plant + program:.2f}"
        table.append(Row(what, row["value"], row["target"], unit, why=why, interval=between))
    at = {(row["vehicles"], row["workers"]): row for row in f["curve"]}
    if (100, 2) in at:
        one, two = at[100, 1], at[100, 2]
        interval = one["low"] / two["high"], one["high"] / two["low"]
        what = "100 X8s, 20 Hz, two workers over one"
        shares = " and ".join(
            f"{row['value'] * (1.0 - row['beyond_fdm']):.2f} of {row['value']:.2f}" for row in (one, two)
        )
        why = f"of the flight by one and by two the FDM took {shares} bare steps a vehicle-step; the rest is"
        why += " one process's"
        table.append(Row(what, one["value"] / two["value"], 1.7, "x", False, why, interval))
    if (1000, 1) in at:
        share = 100 * at[1000, 1]["beyond_fdm"]
        table.append(Row("1,000 X8s at the density of traffic, beyond FDM, one worker", share, 35.0, "%"))
    table.append(Row("growth exponent of the filter step, 100 to 1,000", growth(f["filter"]), 1.15))
    u = f["unicycles"]
    what = f"1,000 unicycles, {u['duration_s']:g} s, filter 20 Hz"
    unit, between = "bare steps a vehicle-step", (u["low"], u["high"])
    table.append(Row(what, u["value"], 3.0, unit, interval=between))
    m = found["memory_city"]
    what = f"memory of all processes, {m['vehicles']} X8s at the density of traffic, {m['duration_s']:g} s"
    table.append(Row(f"{what}: peak", m["peak_mb"], 1500.0, "MB"))
    table.append(Row(f"{what}: growth in its last third", m["growth_mb_per_min"], 30.0, "MB/min"))
    return table


def growth(steps: list[dict[str, float]]) -> float:
    """The power of the number of vehicles by which the filter step grows, first row to last."""
    first, last = steps[0], steps[-1]
    return math.log(last["us"] / first["us"]) / math.log(last["vehicles"] / first["vehicles"])


def text(found: dict[str, Any]) -> str:
    """The curve to 1,000, and what else was measured of large fleets."""
    f = found["fleets"]
    lines = [
        "| X8s | workers | bare steps a vehicle-step | interval (95 %) | aircraft alone | not FDM | start |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in f["curve"]:
        noisy = " (noisy)" if row["noisy"] else ""
        interval = f"{row['low']:.2f} to {row['high']:.2f}{noisy}"
        alone = f"{row['in_turn']:.2f}" if row.get("in_turn") else ""
        lines.append(
            f"| {row['vehicles']} | {row['workers']} | {row['value']:.2f} | {interval} | {alone} |"
            f" {100 * row['beyond_fdm']:.0f} % | {row['start_s']:.2f} s |"
        )
    steps = ", ".join(f"{row['us'] / 1000:.2f} ms for {row['vehicles']}" for row in f["filter"])
    u = f["unicycles"]
    return "\n".join(
        [
            *lines,
            "",
            f"A filter step by near pairs takes {steps}. 1,000 unicycles take {u['whole']:.2f} bare steps a",
            f"vehicle-step over {u['duration_s']:g} s, files included.",
        ]
    )


NONE = "Not measured in this run."


def gain(f: dict[str, Any]) -> str:
    """From which size on a fleet gains by a second process."""
    lines = ["| X8s | FDM periods a step | one process | two | two over one | range |"]
    lines.append("|---|---|---|---|---|---|")
    for row in f.get("gain", ()):
        one, two = row["one_us"] / 1000, row["two_us"] / 1000
        ratio = f"{row['value']:.2f} | {row['low']:.2f} to {row['high']:.2f}"
        lines.append(f"| {row['vehicles']} | {row['periods']} | {one:.2f} ms | {two:.2f} ms | {ratio} |")
    return "\n".join(lines) if "gain" in f else NONE


def cluster(c: dict[str, Any] | None) -> str:
    """What a cluster adds for a campaign of fleets; None: Dask is not installed."""
    if c is None:
        return NONE
    one, two = (row["wall_s"] for row in c["cluster"])
    return f"""A campaign of {c["fleets"]} fleets of {c["vehicles"]} X8s that fly {c["duration_s"]:g} s took
{one:.1f} s on a local Dask cluster of one worker and {two:.1f} s on one of two: {c["speedup"]:.2f} times
as fast. The same flights one after the other, each stepped by two processes, took
{c["within_s"]:.1f} s, their starts counted."""


def city(m: dict[str, Any]) -> str:
    """Memory and time of a large fleet by thirds of its flight, and what ten minutes would take."""
    if "thirds_mb" not in m:
        return NONE
    added = ", ".join(f"{mb:.0f}" for mb in m["thirds_mb"])
    took = ", ".join(f"{s:.0f}" for s in m["thirds_wall_s"])
    minutes = 10 * m["thirds_wall_s"][2] / (m["duration_s"] / 3)
    peak = m["peak_mb"] + max(0.0, m["growth_mb_per_min"]) * (10 - m["duration_s"] / 60)
    return f"""{m["vehicles"]:,} X8s at the density of traffic flew {m["duration_s"]:g} s by two processes.
The thirds of the flight took {took} s on the wall and added {added} MB. Ten minutes were not flown; at
the last third's pace and growth they take {minutes:.0f} minutes and {peak / 1000:.1f} GB."""
