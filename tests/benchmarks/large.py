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
    for row in f["against_bare"]:
        n = row["workers"]
        what = f"20 X8s, filter 20 Hz, limited, on the wall, {n} worker{'s' * (n > 1)}"
        unit, between = "x its bare steps", (row["low"], row["high"])
        table.append(Row(what, row["value"], row["target"], unit, interval=between))
    at = {(row["vehicles"], row["workers"]): row for row in f["curve"]}
    if (100, 2) in at:
        one, two = at[100, 1], at[100, 2]
        interval = one["low"] / two["high"], one["high"] / two["low"]
        what = "100 X8s, 20 Hz, two workers over one"
        table.append(Row(what, one["value"] / two["value"], 1.7, "x", False, interval=interval))
    if (1000, 1) in at:
        share = 100 * at[1000, 1]["beyond_fdm"]
        table.append(Row("1,000 X8s at the density of traffic, beyond FDM, one worker", share, 35.0, "%"))
    table.append(Row("growth exponent of the filter step, 100 to 1,000", growth(f["filter"]), 1.15))
    u = f["unicycles"]
    what = f"1,000 unicycles, {u['duration_s']:g} s, filter 20 Hz"
    unit, between = "bare steps a vehicle-step", (u["low"], u["high"])
    table.append(Row(what, u["value"], 3.0, unit, interval=between))
    if "memory_city" in found:
        m = found["memory_city"]
        what = (
            f"memory of all processes, {m['vehicles']} X8s at the density of traffic, {m['duration_s']:g} s"
        )
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
        "| X8s | workers | bare steps a vehicle-step | 95 % interval | beyond FDM | start-up |",
        "|---|---|---|---|---|---|",
    ]
    for row in f["curve"]:
        noisy = " (noisy)" if row["noisy"] else ""
        interval = f"{row['low']:.2f} to {row['high']:.2f}{noisy}"
        lines.append(
            f"| {row['vehicles']} | {row['workers']} | {row['value']:.2f} | {interval} |"
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
