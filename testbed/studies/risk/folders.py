"""Reads the measures of encounters from run folders and campaign folders, and tells encounters apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.campaigns import folder as campaign
from testbed.errors import UserError, nearest
from testbed.measures.encounter_comparison import Row, rows_of
from testbed.measures.encounter_measures import Settings, measured
from testbed.records.store import MANIFEST, load

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Flown:
    """One run and its measures.

    axes       what its cell is called by: column -> value
    encounter  what tells it from the other runs of the cell: column -> value
    row        its measures; None where it was refused or failed
    """

    axes: Mapping[str, Any]
    encounter: Mapping[str, Any]
    row: Row | None

    def without(self, columns: set[str]) -> Flown:
        """The same without these axes."""
        return Flown({k: v for k, v in self.axes.items() if k not in columns}, self.encounter, self.row)


def read(path: Path, settings: Settings | None) -> tuple[list[Flown], Settings]:
    """The runs of a run folder, of a campaign's folder, or of a folder of run folders.

    settings  None: those that the campaign was measured by, or the defaults
    Raises    UserError where there is no run, or a campaign kept none and was measured otherwise
    """
    if (path / campaign.MANIFEST).is_file():
        return _campaign(path, settings)
    found = [path] if (path / MANIFEST).is_file() else sorted(p.parent for p in path.glob(f"*/{MANIFEST}"))
    if not found:
        raise UserError(f"{path} holds no run and no campaign")
    chosen, single = settings or Settings(), len(found) == 1
    flown = []
    for folder in found:
        run = load(folder)
        which = {} if single else {"run": folder.name}
        flown.append(Flown({}, which | {"seed": run.manifest["scenario"]["seed"]}, measured(run, chosen)))
    return flown, chosen


def _campaign(path: Path, settings: Settings | None) -> tuple[list[Flown], Settings]:
    import pandas as pd

    said = campaign.manifest(path)["campaign"].get("measures")
    by = None if said is None else Settings.of(said)
    if not (path / campaign.RUNS).is_file():
        raise UserError(f"{path} is not complete; go on with: testbed campaign resume {path}")
    table = pd.read_parquet(path / campaign.RUNS)
    rows: list[Row | None]
    if by is not None and (settings is None or settings.data() == by.data()):
        rows, chosen = rows_of(table), by
    else:
        chosen = settings or Settings()
        rows = [_kept(path, key, chosen, table.status[k]) for k, key in enumerate(table.id)]
    axes = _axes(table, campaign.manifest(path)["campaign"])
    own = [c for c in table.columns[1 : table.columns.get_loc("status")] if c not in axes]
    return [
        Flown({a: table[a][k] for a in axes}, {c: table[c][k] for c in own}, rows[k])
        for k in range(len(table))
    ], chosen


def _axes(table: pd.DataFrame, said: Mapping[str, Any]) -> list[str]:
    """The columns of a campaign's axes: those before its draws, files and seeds."""
    drawn = {"file", "seed", *said.get("random", {})}
    before = table.columns[1 : table.columns.get_loc("status")]
    drawn |= {c for c in before if any(c.endswith(f".{name}") for name in said.get("random", {}))}
    return [c for c in before if c not in drawn]


def _kept(path: Path, key: str, settings: Settings, status: str) -> Row | None:
    if status != "flown":
        return None
    if not (path / "runs" / key / MANIFEST).is_file():
        raise UserError(
            f"{path} keeps no run {key} and was not measured so; say [measures] in the campaign's file with"
            ' the same volumes, or keep = "all", and fly it again'
        )
    return measured(load(path / "runs" / key), settings)


def split(flown: list[Flown], text: str) -> tuple[list[Flown], list[Flown]]:
    """The other cells of a campaign, and those that COLUMN=VALUE names. Raises UserError for none."""
    name, _, value = text.partition("=")
    known = {axis for f in flown for axis in f.axes}
    match = [axis for axis in known if axis == name or axis.rpartition(".")[2] == name]
    if len(match) != 1:
        raise UserError(f"--against {text}: no axis {name!r}; {nearest(name, known)}")
    values = {str(f.axes[match[0]]) for f in flown}
    if value not in values:
        raise UserError(f"--against {text}: no cell has {match[0]} {value!r}; {nearest(value, values)}")
    there = [f for f in flown if str(f.axes[match[0]]) == value]
    return [f for f in flown if str(f.axes[match[0]]) != value], [f.without({match[0]}) for f in there]


def cells(flown: list[Flown]) -> dict[str, list[Flown]]:
    """Label -> runs, by axes; axes of one value for all are left out of the label."""
    varied = {a for f in flown for a in f.axes if len({str(g.axes.get(a)) for g in flown}) > 1}
    found: dict[str, list[Flown]] = {}
    for f in flown:
        label = ", ".join(f"{a.rpartition('.')[2]} {v}" for a, v in f.axes.items() if a in varied)
        found.setdefault(label or "all", []).append(f)
    return found


def partner(axes: Mapping[str, Any], others: list[Flown]) -> list[Flown]:
    """Of the runs without the filter, those whose axes agree with `axes` where they differ at all."""
    varied = {a for f in others for a in f.axes if len({str(g.axes.get(a)) for g in others}) > 1}
    return [f for f in others if all(str(f.axes[a]) == str(axes.get(a, f.axes[a])) for a in varied)]
