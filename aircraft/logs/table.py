"""Reads flight logs from CSV tables, such as the vehicles.csv that `testbed export` writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aircraft.logs.record import FlightLog, LogError, Signal, digest, grid_of, wrapped

_COMMANDS = ("v_command_mps", "omega_command_radps", "zeta_command_mps")
_RESPONSES = ("v_mps", "theta_rad", "zeta_mps")
_WIND = ("wind_east_mps", "wind_north_mps")


def read(path: Path, vehicle: int | None = None) -> FlightLog:
    """The flight of a table with columns t_s, v_command_mps, omega_command_radps, zeta_command_mps, v_mps,
    theta_rad (course) and zeta_mps; wind_east_mps and wind_north_mps if known.

    Angles may be in degrees under names that say so: omega_command_degps, theta_deg. Instead of the course
    the table may have the course rate, omega_radps. A command holds from its row on.
    vehicle  which one of a table with a column `vehicle`; needed where there are several
    Raises   LogError naming the column
    """
    import pandas as pd

    try:
        table = pd.read_csv(path, skipinitialspace=True)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise LogError(f"is no CSV table: {error}") from None
    columns = {str(name).strip(): table[name] for name in table.columns}
    if "vehicle" in columns:
        columns = _chosen(columns, vehicle)
    elif vehicle not in (None, 1):
        raise LogError(f"there is no column vehicle, so no vehicle {vehicle}")

    def numbers(name: str) -> Any:
        if name in columns:
            return _numbers(name, columns[name])
        degrees = name.replace("_radps", "_degps").replace("_rad", "_deg")
        if degrees in columns:
            return np.radians(_numbers(degrees, columns[degrees]))
        raise LogError(f"there is no column {name}; it has {', '.join(columns)}")

    t = numbers("t_s")
    if not np.all(np.diff(t[np.isfinite(t)]) > 0):
        raise LogError("t_s does not increase from row to row")
    asked = [Signal.of(name, t, numbers(name)) for name in _COMMANDS]
    v, zeta = (Signal.of(name, t, numbers(name)) for name in ("v_mps", "zeta_mps"))
    notes: list[str] = []
    if "theta_rad" in columns or "theta_deg" in columns:
        course = wrapped(t, numbers("theta_rad"))
    else:
        rate = Signal.of("omega_radps", t, numbers("omega_radps"))
        turned = np.cumsum(0.5 * (rate.x[1:] + rate.x[:-1]) * np.diff(rate.t))
        course = Signal(rate.t, np.concatenate([[0.0], turned]))
        notes.append("no course in the table: it is the integral of omega_radps, begun at 0")
    grid = grid_of(*asked, v, course, zeta)
    wind = np.zeros((grid.size, 2))
    if all(name in columns for name in _WIND):
        each = [Signal.of(name, t, numbers(name)) for name in _WIND]
        wind = np.stack([np.interp(grid, s.t, s.x) for s in each], axis=-1)
    else:
        notes.append("no wind in the table: taken as calm")
    command = np.stack([s.held(grid) for s in asked], axis=-1)
    return FlightLog(
        path.name,
        "csv",
        digest(path),
        grid,
        command,
        v.linear(grid),
        course.linear(grid),
        zeta.linear(grid),
        wind,
        tuple(notes),
    )


def _numbers(name: str, column: Any) -> Any:
    import pandas as pd

    found = pd.to_numeric(column, errors="coerce")
    wrong = found.isna() & column.notna()
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        raise LogError(f"column {name}, row {row + 1}: {column.iloc[row]!r} is no number")
    return found.to_numpy(dtype=float)


def _chosen(columns: dict[str, Any], vehicle: int | None) -> dict[str, Any]:
    number = columns["vehicle"]
    there = sorted(set(number.dropna().astype(int)))
    if vehicle is None and len(there) > 1:
        raise LogError(f"it holds {len(there)} vehicles; choose one: --vehicle {there[0]}")
    chosen = there[0] if vehicle is None else vehicle
    if chosen not in there:
        raise LogError(f"there is no vehicle {chosen}; it holds {', '.join(map(str, there))}")
    return {name: column[number == chosen] for name, column in columns.items()}
