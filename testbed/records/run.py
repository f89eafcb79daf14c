"""Defines a finished run and the columns of its tables: name, unit and meaning of everything recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from testbed.records import shown
from testbed.records.verdict import Verdict

if TYPE_CHECKING:
    import pandas as pd

Columns = dict[str, np.ndarray]

# name -> (unit, meaning): one row per recorded time and vehicle, and one per recorded time and pair.
VEHICLE_COLUMNS: dict[str, tuple[str, str]] = {
    "t_s": ("s", "time since the start"),
    "vehicle": ("", "vehicle, counted from 1"),
    "x_m": ("m", "east"),
    "y_m": ("m", "north"),
    "z_m": ("m", "height above the shared origin"),
    "theta_rad": ("rad", "course, counter-clockwise from east"),
    "v_mps": ("m/s", "ground speed achieved"),
    "omega_radps": ("rad/s", "course rate achieved"),
    "zeta_mps": ("m/s", "climb rate achieved"),
    "v_nominal_mps": ("m/s", "ground speed the nominal controller asks for"),
    "omega_nominal_radps": ("rad/s", "course rate the nominal controller asks for"),
    "zeta_nominal_mps": ("m/s", "climb rate the nominal controller asks for"),
    "v_command_mps": ("m/s", "ground speed commanded from this instant on"),
    "omega_command_radps": ("rad/s", "course rate commanded from this instant on"),
    "zeta_command_mps": ("m/s", "climb rate commanded from this instant on"),
    "override": ("", "the filter altered the nominal input"),
    "qp_status": ("", "solved, infeasible, iteration_limit, or none where no QP was solved for it"),
}
AIRCRAFT_COLUMNS: dict[str, tuple[str, str]] = {
    "roll_rad": ("rad", "bank, right wing down positive"),
    "pitch_rad": ("rad", "pitch attitude, nose up positive"),
    "heading_rad": ("rad", "heading, counter-clockwise from east"),
    "alpha_rad": ("rad", "angle of attack"),
    "beta_rad": ("rad", "sideslip, wind from the right positive"),
    "airspeed_mps": ("m/s", "true airspeed"),
    "throttle": ("", "throttle position, 0 to 1"),
    "load_factor": ("", "normal load factor"),
    "limited_v": ("", "the autopilot limits speed"),
    "limited_omega": ("", "the autopilot limits the turn rate"),
    "limited_zeta": ("", "the autopilot limits the climb rate"),
}
WIND_COLUMNS: dict[str, tuple[str, str]] = {
    "wind_east_mps": ("m/s", "the air's motion over the ground at the vehicle, east; only in runs with wind"),
    "wind_north_mps": ("m/s", "the same, north"),
    "wind_up_mps": ("m/s", "the same, up"),
}
LEFT_COLUMNS: dict[str, tuple[str, str]] = {
    "left": ("", "it has left and is neither seen nor judged; only in runs whose vehicles may leave"),
}
PAIR_COLUMNS: dict[str, tuple[str, str]] = {
    "t_s": ("s", "time since the start"),
    "i": ("", "vehicle, counted from 1"),
    "j": ("", "vehicle, counted from 1, above i"),
    "distance_m": ("m", "distance"),
    "h_m": ("m", "the unmodified barrier at the true state (m^2 in its squared form)"),
    "h_filter_m": ("m", "the filter's own h; nan where the filter has none"),
    "hdot_predicted_mps": ("m/s", "L_g h u of the unicycle under the commands"),
    "hdot_realised_mps": ("m/s", "change of h_m over the filter period that follows, per second"),
    "residual_v_mps": ("m/s", "realised minus predicted hdot, the part of the ground speeds' errors"),
    "residual_omega_mps": ("m/s", "the part of the turn rates' errors, as headings turned"),
    "residual_zeta_mps": ("m/s", "the part of the climb rates' errors"),
    "residual_course_mps": ("m/s", "the part of courses turning otherwise than headings"),
}
# One row per recorded time, fence and vehicle that it is for; only in runs with fences.
FENCE_COLUMNS: dict[str, tuple[str, str]] = {
    "t_s": ("s", "time since the start"),
    "fence": ("", "fence, counted from 1"),
    "vehicle": ("", "vehicle, counted from 1"),
    "clearance_m": ("m", "signed distance to the fence less its margin; negative on its wrong side"),
    "h_m": ("m", "the fence's unmodified barrier at the true state"),
}

# Only in runs whose filter is a user's own and declares a barrier.
DECLARED_COLUMNS: dict[str, tuple[str, str]] = {
    "h_declared": ("", "the barrier that the user's filter declares, at the true state, in its own unit"),
    "alpha_declared": ("", "the alpha that it declares of that h; nan where it declares none"),
}

# Of PAIR_COLUMNS, the ones that only the motion after the instant tells; nan at the last one.
REALISED_COLUMNS = [name for name in PAIR_COLUMNS if name.startswith(("hdot_realised", "residual"))]


# Rows of a table that are handed to the sink at a time: some megabytes. Until then each step's rows are kept
# as they come; a vehicle's row has many columns, so fewer of them make a block.
BLOCK_ROWS = {"vehicles": 16_384, "pairs": 65_536, "fences": 65_536}


class Sink(Protocol):
    """Takes tables block by block."""

    def write(self, table: str, columns: Columns) -> None: ...


class MemorySink:
    """Keeps blocks in memory."""

    def __init__(self) -> None:
        self.blocks: dict[str, list[Columns]] = {table: [] for table in BLOCK_ROWS}

    def write(self, table: str, columns: Columns) -> None:
        self.blocks[table].append(columns)

    def tables(self) -> dict[str, Columns]:
        return {
            name: {c: np.concatenate([b[c] for b in blocks]) for c in blocks[0]} if blocks else {}
            for name, blocks in self.blocks.items()
            if blocks or name != "fences"
        }


class RowWriter:
    """Gathers rows and hands them to a sink in large blocks."""

    def __init__(self, sink: Sink) -> None:
        self.sink = sink
        self._rows: dict[str, list[Columns]] = {table: [] for table in BLOCK_ROWS}
        self._count = dict.fromkeys(BLOCK_ROWS, 0)

    def add(self, table: str, columns: Columns) -> None:
        self._rows[table].append(columns)
        self._count[table] += len(next(iter(columns.values())))
        if self._count[table] >= BLOCK_ROWS[table]:
            self.flush(table)

    def flush(self, table: str) -> None:
        rows = self._rows[table]
        if rows:
            self.sink.write(table, {c: np.concatenate([r[c] for r in rows]) for c in rows[0]})
        self._rows[table], self._count[table] = [], 0

    def close(self) -> None:
        for table in self._rows:
            self.flush(table)


def called(origin: Mapping[str, Any]) -> str:
    """What tables and titles call the part of an origin in a manifest: its name with its arguments."""
    given = ", ".join(f"{name}={value}" for name, value in origin.get("arguments", {}).items())
    return f"{origin['name']}({given})" if given else str(origin["name"])


def option(origin: Mapping[str, Any]) -> str:
    """How to give the part of an origin again: by `--parts` with its file, whose folder is not known."""
    if origin.get("package"):
        return f"give that part of package {origin['package']} again with --parts"
    if not origin.get("file") or "<" in origin["name"]:
        return "it is not in a file by name, so that only the Python program that made it can give it again"
    stem = str(origin["file"]).removesuffix(".py")
    return f"give --parts '{origin['file']}:{called(origin).removeprefix(stem + '.')}'"


@dataclass(repr=False)
class Run:
    """One finished run: settings, verdicts, tables. Printed it takes ten lines; a notebook shows it.

    manifest    schema version, resolved scenario, seeds, package versions, airframe hashes
    guarantees  one verdict per claim, in the order of `testbed.claims.registry`
    timing      wall time; the only thing that differs between equal runs
    path        folder that it was read from, if any
    tables      name -> columns, of a run kept in memory
    reader      name -> table, of a run whose tables are in files
    """

    manifest: dict[str, Any]
    guarantees: Sequence[Verdict]
    timing: dict[str, Any]
    path: Path | None = None
    tables: dict[str, Columns] = field(default_factory=dict)
    reader: Callable[[str], pd.DataFrame] | None = None

    def _frame(self, name: str) -> pd.DataFrame:
        import pandas as pd

        if self.tables.get(name):
            return pd.DataFrame(self.tables[name])
        if self.reader is None or f"{name}.parquet" not in self.manifest.get("files", {}):
            # A run of one vehicle has no pairs, and no table of them; one without fences none of fences.
            columns = FENCE_COLUMNS if name == "fences" else PAIR_COLUMNS
            return pd.DataFrame(columns=list(columns), dtype=float)
        return self.reader(name)

    @cached_property
    def vehicles(self) -> pd.DataFrame:
        """One row per recorded time and vehicle; columns in VEHICLE_, AIRCRAFT_ and WIND_COLUMNS."""
        return self._frame("vehicles")

    @cached_property
    def pairs(self) -> pd.DataFrame:
        """One row per recorded time and pair; columns in PAIR_COLUMNS and DECLARED_COLUMNS."""
        return self._frame("pairs")

    @cached_property
    def fences(self) -> pd.DataFrame:
        """One row per recorded time, fence and vehicle; columns in FENCE_COLUMNS."""
        return self._frame("fences")

    @property
    def scorecard(self) -> pd.DataFrame:
        """One row per claim, by id: verdict, value, unit, bound, margin, t_s, vehicles, why, source."""
        import pandas as pd

        first = ["number", "claim", "verdict", "value", "unit", "bound", "margin", "t_s", "vehicles", "why"]
        table = pd.DataFrame([v.to_json() for v in self.guarantees]).set_index("id")
        return table[first + [c for c in table.columns if c not in first]]

    def part(self, what: str) -> str | None:
        """Name of the user's own part flown as `what` (plant, filter, nominal, disturbance); None if none."""
        origin = self.manifest.get("parts", {}).get(what)
        return None if origin is None else called(origin)

    def __repr__(self) -> str:
        own = {what: called(origin) for what, origin in self.manifest.get("parts", {}).items()}
        return shown.text(self.manifest, self.guarantees, own)

    def _repr_html_(self) -> str:
        """What a notebook shows: a row per claim, the least distance over time, paths from above."""
        return shown.html(self.manifest, self.guarantees, self.vehicles, self.pairs)

    def guarantee(self, name: str) -> Verdict:
        """The verdict on the claim with that id; KeyError if there is none."""
        for verdict in self.guarantees:
            if verdict.id == name:
                return verdict
        raise KeyError(name)
