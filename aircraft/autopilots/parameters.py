"""Lists an autopilot's parameters and gains: value, default, unit, usual range, what each does."""

from __future__ import annotations

from typing import Any

from aircraft.airframes.schema import Airframe
from aircraft.equations.catalogue import of_airframe, values_of


def table(airframe: Airframe) -> list[dict[str, Any]]:
    """One row for each parameter that the equations declare, then one for each gain of airframe.toml."""
    mine, values = of_airframe(airframe), values_of(airframe)
    rows = []
    for p in mine.parameters.values():
        span = "" if p.low is None or p.high is None else f"{p.low:g} to {p.high:g}"
        rows.append(
            {
                "parameter": p.name,
                "value": values[p.name],
                "default": p.default,
                "unit": p.unit,
                "usual": span,
                "what it does": p.meaning,
            }
        )
    needed = mine.needed()
    for section, names in airframe.gains.items():
        for name, value in names.items():
            if f"{section}_{name}" in needed:
                rows.append(_gain(f"{section}.{name}", value))
    return rows


def _gain(name: str, value: float) -> dict[str, Any]:
    return {"parameter": name, "value": value, "default": "", "unit": "", "usual": "", "what it does": ""}
