"""Tabulates the measures of encounters, cell by cell: as they are, or with a filter against without."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from testbed.errors import UserError
from testbed.measures.encounter_comparison import Row, compared, lost, paired, plain
from testbed.measures.encounter_measures import Settings
from testbed.statistics import RiskRatio, mean, quantile, rate
from testbed.studies.risk.folders import Flown, cells, partner

# Of the bootstrap.
SEED = 1


def alone(flown: list[Flown], settings: Settings) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Per cell what its runs show: rows to print, and the same as data."""
    shown, data = [], []
    for label, runs in cells(flown).items():
        rows = [f.row for f in runs if f.row is not None]
        if not rows:
            continue
        found = _summary(rows, settings) | {"left_out": len(runs) - len(rows)}
        data.append({"cell": label, **plain(found)})
        lines = {"runs": str(len(rows))}
        for name in settings.cylinders:
            lines[f"{name}: runs that lost it"] = str(found[name])
            lines[f"{name}: depth, longest time of those"] = _severity(found, name)
        lines |= {
            "intervened": str(found["interventions"]),
            "lead before closest approach": f"{found['lead_s']} s",
            "arrived": "{:.0f} of {:.0f}".format(*found["arrived"]),
        }
        shown += _lines(label, lines)
    return shown, data


def _summary(rows: Sequence[Row], settings: Settings) -> dict[str, Any]:
    rng = np.random.default_rng(SEED)
    found: dict[str, Any] = {"runs": len(rows)}
    for name in settings.cylinders:
        gone = lost(rows, name, True)
        found[name] = rate(gone)
        for what in ("depth", "time_s"):
            values = [r[f"{name}_{what}"] for r, of in zip(rows, gone, strict=True) if of]
            found[f"{name}_{what}"] = mean(values, rng)
        found[f"{name}_undecided"] = sum(bool(r[f"{name}_undecided"]) for r in rows)
    found["interventions"] = rate([r["intervention_s"] is not None for r in rows])
    found["lead_s"] = quantile([r["lead_s"] for r in rows if r["lead_s"] is not None], 0.5)
    found["arrived"] = sum(r["arrived"] for r in rows), sum(r["with_goal"] for r in rows)
    return found


def against(
    flown: list[Flown], others: list[Flown], settings: Settings, nuisance: str
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[str]]:
    """Per cell with the filter against the runs without: rows to print, the same as data, remarks."""
    shown, data, notes = [], [], []
    for label, runs in cells(flown).items():
        beside = partner(runs[0].axes, others)
        keys, first, second, left_out = paired(_keyed(runs), _keyed(beside))
        groups = [dict(key).get("file") for key in keys] if any("file" in f.encounter for f in runs) else None  # type: ignore[call-overload]
        found = compared(first, second, np.random.default_rng(SEED), settings, groups, nuisance)
        data.append({"cell": label, "left_out": left_out, **plain(found)})
        lines = {"encounters": str(len(keys))}
        for name in settings.cylinders:
            ratio: RiskRatio = found[name]
            lines[f"{name}: lost with, without"] = f"{ratio.with_filter}, {ratio.without}"
            lines[f"{name}: risk ratio"] = _ratio(ratio)
            lines[f"{name}: unresolved, induced"] = f"{ratio.both}, {ratio.only_with}"
            lines[f"{name}: depth, time of those with"] = _severity(found, name)
            if ratio.note:
                notes.append(f"{label}, {name}: {ratio.note}")
        lines["intervened"] = str(found["interventions"])
        if "nuisance" in found:
            lines[f"intervened where {nuisance} is kept without"] = str(found["nuisance"])
            lines[f"did not where {nuisance} is lost without"] = str(found["missed"])
        lines |= {
            "lead before closest approach": f"{found['lead_s']} s",
            "path with less without": f"{found['path_added_m']} m",
            "time with less without": f"{found['flown_added_s']} s",
            "arrived with, without": "{:.0f}, {:.0f} of {:.0f}".format(
                found["arrived"][0], *found["arrived_without"]
            ),
        }
        shown += _lines(label, lines)
        if left_out:
            notes.append(f"{label}: {left_out} encounters are not in both, or were refused, and are left out")
        if any(found["undecided"]):
            a, b = found["undecided"]
            notes.append(f"{label}: {a} undecided runs with and {b} without count against the filter")
    return shown, data, notes


def _keyed(runs: list[Flown]) -> dict[Hashable, Row | None]:
    found: dict[Hashable, Row | None] = {}
    for f in runs:
        key = tuple((name, str(value)) for name, value in sorted(f.encounter.items()))
        if key in found:
            raise UserError(
                f"two runs of a cell are of encounter {dict(key)}; tell cells apart by --against COLUMN=VALUE"
            )
        found[key] = f.row
    return found


def _ratio(ratio: RiskRatio) -> str:
    """With the exact interval, or the bootstrap's where encounters come in groups."""
    interval = ratio.exact if np.isfinite(ratio.exact.low) else ratio.bootstrap
    if not np.isfinite(interval.low):
        return f"{ratio.value:.3g}"
    return f"{ratio.value:.3g} [{interval.low:.3g}, {interval.high:.3g}]"


def _severity(found: dict[str, Any], name: str) -> str:
    depth, time = found[f"{name}_depth"].value, found[f"{name}_time_s"].value
    return f"{depth:.2f}, {time:.2f} s" if np.isfinite(depth) else "none"


def _lines(label: str, lines: dict[str, str]) -> list[dict[str, Any]]:
    """Rows of a table; the cell is named once."""
    return [
        {"cell": label if not k else "", "": what, " ": value}
        for k, (what, value) in enumerate(lines.items())
    ]
