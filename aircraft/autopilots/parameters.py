"""Lists an autopilot's parameters and gains: value, default, unit, usual range, what each does."""

from __future__ import annotations

from typing import Any

from aircraft.airframes.schema import Airframe
from aircraft.equations.catalogue import of_airframe, values_of
from aircraft.equations.units import unit_of


def table(airframe: Airframe) -> list[dict[str, Any]]:
    """One row for each parameter that the equations declare, then one for each gain of airframe.toml."""
    mine, values = of_airframe(airframe), values_of(airframe)
    rows = []
    for p in mine.parameters.values():
        rows.append(
            {
                "parameter": p.name,
                "value": values[p.name],
                "default": p.default,
                "unit": p.unit,
                "usual": _span(p.low, p.high),
                "what it does": p.meaning,
            }
        )
    needed = mine.needed()
    for section, names in airframe.gains.items():
        for name, value in names.items():
            full = f"{section}_{name}"
            if full in needed:
                known = mine.about(full)
                rows.append(
                    {
                        "parameter": f"{section}.{name}",
                        "value": value,
                        "default": "",
                        "unit": known.unit if known else unit_of(full),
                        "usual": _span(known.low, known.high) if known else "",
                        "what it does": known.meaning if known else "",
                    }
                )
    return rows


def _span(low: float | None, high: float | None) -> str:
    return "" if low is None or high is None else f"{low:g} to {high:g}"


def markdown(rows: list[dict[str, Any]]) -> str:
    """A table of `table`'s rows; the default only where some have one."""
    columns = [name for name in rows[0] if name != "default" or any(row["default"] != "" for row in rows)]
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    lines += [f"| {' | '.join(cell(row[name]) for name in columns)} |" for row in rows]
    return "\n".join(lines)


def cell(value: Any) -> str:
    """A value in a table: six digits of a number."""
    return f"{value:g}" if isinstance(value, float) else str(value)
