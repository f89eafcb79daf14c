"""Reads a run folder without the code that wrote it."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from testbed.errors import UserError
from testbed.verification.near_table import recorded_below, spread

Array = np.ndarray


@dataclass(frozen=True)
class Recorded:
    """One run: T recorded instants, N vehicles, P pairs.

    entries    what the run says of its claims, in its order
    t          (T,) s
    vehicles   column -> (T, N)
    pairs      column -> (T, P), pairs in the order (1, 2), (1, 3), ... (N - 1, N)
    fences     column -> (T, K), by fence and then by vehicle; empty without fences
    i, j       (P,) vehicles of each pair, from 0
    changed    files whose checksum is not the manifest's, manifest and timing by their own
    timing     the wall time, which no verdict uses
    left_s     (N,) s, when each left; inf for never; None where nobody leaves
    near       (T, P) which pairs are recorded, P being those that may matter; None where all are
    """

    manifest: dict[str, Any]
    scenario: dict[str, Any]
    ended: str | None
    entries: list[dict[str, Any]]
    t: Array
    vehicles: dict[str, Array]
    pairs: dict[str, Array]
    i: Array
    j: Array
    changed: list[str]
    timing: dict[str, Any]
    fences: dict[str, Array] = field(default_factory=dict)
    left_s: Array | None = None
    near: Array | None = None

    @cached_property
    def guarantees(self) -> dict[str, dict[str, Any]]:
        """The entries by id."""
        return {e["id"]: e for e in self.entries}

    def gone(self, t: Array) -> Array:
        """(S, N) who has left by the times t (S,)."""
        if self.left_s is None:
            return np.zeros((len(t), self.scenario["vehicles"]), dtype=bool)
        return np.asarray(t[:, None] >= self.left_s - 1e-9)

    def apart(self, after: float = 0.0) -> Array:
        """(T, P) pairs of which one has left, by so many seconds after the recorded instants."""
        gone = self.gone(self.t + after)
        return np.asarray(gone[:, self.i] | gone[:, self.j])

    @property
    def present(self) -> Array:
        """(T, N) who has not left."""
        return ~self.gone(self.t)

    @property
    def complete(self) -> bool:
        """Whether every filter step was recorded."""
        return self._ratio("filter_dt_s") == 1

    @property
    def every_step(self) -> bool:
        """Whether every step of the flight dynamics was recorded."""
        return self._ratio("fdm_dt_s") == 1

    @cached_property
    def flew_on(self) -> bool:
        """Whether the vehicles flew on after the last decision, and no row is at its end.

        So ends a run whose next decision failed: the fault names a step after the last one that was decided.
        """
        told = re.search(r"(?:in step (\d+) )?at ([\d.]+) s; run stopped$", self.ended or "")
        if told is None or not len(self.t):
            return False
        due = round(float(told[2]) / self.scenario["rates"]["filter_dt_s"])
        deciding = self.ended is not None and self.ended.startswith(("deciding failed:", "judged before"))
        return due > 0 and (deciding or (told[1] is not None and int(told[1]) == due))

    def _ratio(self, name: str) -> int:
        rates = self.scenario["rates"]
        return round(rates["record_dt_s"] / rates[name])

    @property
    def parts(self) -> dict[str, dict[str, str | None]]:
        """Parts of the run that were not the scenario's: what -> name, file, SHA-256 of the source."""
        return dict(self.manifest.get("parts", {}))

    @property
    def declared(self) -> list[str]:
        """Which of barrier, alpha and constraints a user's filter declares; none without a barrier."""
        return list(self.manifest.get("declared", []))

    def channels(self, suffix: str) -> Array:
        """(T, N, 3): v, omega and zeta achieved (""), wanted ("_nominal") or commanded ("_command")."""
        names = (f"v{suffix}_mps", f"omega{suffix}_radps", f"zeta{suffix}_mps")
        return np.stack([self.vehicles[c] for c in names], axis=-1)

    @cached_property
    def rates(self) -> Array:
        """(T, N, 3) achieved."""
        return self.channels("")

    @cached_property
    def command(self) -> Array:
        """(T, N, 3)"""
        return self.channels("_command")

    @cached_property
    def position(self) -> Array:
        """(T, N, 3) m"""
        return np.stack([self.vehicles[c] for c in ("x_m", "y_m", "z_m")], axis=-1)

    @property
    def velocity(self) -> Array:
        """(T, N, 3) m/s, along the course."""
        v, theta, zeta = (self.vehicles[c] for c in ("v_mps", "theta_rad", "zeta_mps"))
        return np.stack([v * np.cos(theta), v * np.sin(theta), zeta], axis=-1)


def read(folder: Path) -> Recorded:
    """The run in `folder`.

    Raises UserError if files are missing or unreadable, or rows are missing, doubled or out of place.
    """
    manifest = _json(folder, "manifest.json")
    entries = _json(folder, "guarantees.json")
    try:
        s, n = _today(manifest["scenario"]), manifest["scenario"]["vehicles"]
        period = s["rates"]["record_dt_s"]
        instants = (
            round(s["duration_s"] / s["rates"]["filter_dt_s"]) // round(period / s["rates"]["filter_dt_s"])
            + 1
        )
    except (KeyError, TypeError):
        raise UserError(f"{folder} holds no run: its manifest has no scenario") from None
    except ArithmeticError:
        raise UserError(f"{folder} is malformed: its scenario's periods do not fit each other") from None
    i, j = np.triu_indices(n, 1)
    vehicles = _table(folder, "vehicles", n, {"vehicle": np.arange(n) + 1})
    pairs: dict[str, Array] = {}
    near = None
    try:
        below = recorded_below(manifest)
    except (KeyError, TypeError, ValueError):
        raise UserError(f"{folder} is malformed: near_pairs of its manifest says no h_m") from None
    if below is not None:
        i, j, pairs, near = spread(_columns(folder, "pairs"), s, below, vehicles, folder)
    elif i.size:
        pairs = _table(folder, "pairs", i.size, {"i": i + 1, "j": j + 1})
    fences = _fences(folder, s)
    t = vehicles["t_s"][:, 0]
    ended = manifest.get("ended_early")
    if len(t) != instants and not (ended and len(t) < instants):
        raise UserError(
            f"{folder}: {len(t)} instants recorded, {instants} expected: rows are missing or too many"
        )
    for name, table in (("vehicles", vehicles), ("pairs", pairs), ("fences", fences)):
        if table and (
            len(table["t_s"]) != len(t)
            or np.abs(table["t_s"] - period * np.arange(len(t))[:, None]).max(initial=0.0) > 1e-6
        ):
            raise UserError(f"{folder}: {name}.parquet has instants that are missing or out of place")
    changed = [
        name
        for name, told in manifest.get("files", {}).items()
        if hashlib.sha256((folder / name).read_bytes()).hexdigest() != told
    ]
    given = {"vehicles": vehicles, "pairs": pairs, "fences": fences}
    tables = [f"{name}.parquet" for name, table in given.items() if table]
    changed += [name for name in [*tables, "guarantees.json"] if name not in manifest.get("files", {})]
    if manifest.get("sha256") != _seal(manifest):
        changed.append("manifest.json")
    if s.get("airframes_folder"):  # said from the run's folder
        s = s | {"airframes_folder": str(folder / s["airframes_folder"])}
    timing = _json(folder, "timing.json")
    if timing.get("sha256") != _seal(timing):
        changed.append("timing.json")
    there = manifest, s, ended, entries, t, vehicles, pairs, i, j, changed, timing, fences
    return Recorded(*there, near=near)


def _fences(folder: Path, s: dict[str, Any]) -> dict[str, Array]:
    """The table of fences, of which a scenario without any has none."""
    who = [(k + 1, v) for k, fence in enumerate(s.get("fence", [])) for v in fenced_vehicles(s, fence)]
    if not who:
        return {}
    fence, vehicle = np.array(who).T
    return _table(folder, "fences", len(who), {"fence": fence, "vehicle": vehicle})


def fenced_vehicles(s: dict[str, Any], fence: dict[str, Any]) -> list[int]:
    """The vehicles, from 1, that a fence is for: those it lists, or all that are under the filter."""
    own = [k for k in range(1, s["vehicles"] + 1) if not s.get("vehicle") or _filtered(s["vehicle"][k - 1])]
    return sorted(fence["vehicles"]) or own


def _filtered(vehicle: dict[str, Any]) -> bool:
    return bool(vehicle.get("filter", True))


def _today(scenario: dict[str, Any]) -> dict[str, Any]:
    """A manifest's scenario as it is spelt today; older ones say [nominal] and its `controller`."""
    if "nominal" not in scenario:
        return scenario
    said = {name: value for name, value in scenario.items() if name != "nominal"}
    table = dict(scenario["nominal"])
    return said | {"guidance": {"kind": table.pop("controller")} | table}


def _seal(manifest: dict[str, Any]) -> str:
    """Checksum of all that a JSON file states beside it."""
    said = {key: value for key, value in manifest.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()


def _json(folder: Path, name: str) -> Any:
    try:
        return json.loads((folder / name).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{folder} holds no finished run (no {name})") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{folder} holds no finished run: {name}: {error}") from None


def _columns(folder: Path, name: str) -> dict[str, Array]:
    """The columns of a table, row by row."""
    import pyarrow
    import pyarrow.parquet as parquet

    try:
        table = parquet.ParquetFile(folder / f"{name}.parquet").read()
    except (OSError, pyarrow.ArrowException) as error:
        raise UserError(f"{folder}: {name}.parquet cannot be read: {error}") from None
    return {c: table[c].to_numpy(zero_copy_only=False) for c in table.column_names}


def _table(folder: Path, name: str, size: int, keys: dict[str, Array]) -> dict[str, Array]:
    flat = _columns(folder, name)
    rows = len(next(iter(flat.values()), ()))
    if rows % size:
        raise UserError(f"{folder}: {name}.parquet has {rows} rows, not a multiple of {size}")
    columns = {c: values.reshape(-1, size) for c, values in flat.items()}
    for key, wanted in keys.items():
        if not np.array_equal(columns[key], np.broadcast_to(wanted, columns[key].shape)):
            raise UserError(f"{folder}: {name}.parquet has rows that are missing or out of place")
    return columns
