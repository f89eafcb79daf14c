"""Reads the runs of earlier answers, to add more cells and seeds to them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from testbed.errors import UserError
from testbed.studies.answer.cells import COLUMNS, Cell

if TYPE_CHECKING:
    import pandas as pd


def added(
    folders: Sequence[Path], changes: list[str], airframes: Mapping[str, str]
) -> tuple[pd.DataFrame | None, dict[str, str]]:
    """The runs of the folders, and the checksums of all airframes.

    Raises  UserError for what is no answer, was flown with other settings or other files of an airframe, or
            is in two folders
    """
    import pandas as pd

    found, all_ = [], dict(airframes)
    for folder in folders:
        try:
            data = json.loads((folder / "answer.json").read_text(encoding="utf-8"))
            runs = pd.read_csv(folder / "runs.csv")
        except (OSError, ValueError) as error:
            raise UserError(f"--add {folder}: no folder of `testbed answer`: {error}") from None
        if missing := [name for name in ("seed", *COLUMNS) if name not in runs]:
            raise UserError(f"--add {folder}: runs.csv has no column {missing[0]}; fly its cells again")
        if data.get("set", []) != changes:
            was = " ".join(f"--set {item}" for item in data.get("set", [])) or "no --set"
            raise UserError(f"--add {folder}: it was flown with {was}; give the same here")
        for name, sha in data.get("airframes", {}).items():
            if all_.setdefault(name, sha) != sha:
                raise UserError(f"--add {folder}: {name} has other files now; fly its cells again")
        found.append(runs)
    if not found:
        return None, all_
    joined = pd.concat(found, ignore_index=True)
    if (again := joined.duplicated([*COLUMNS, "seed"])).any():
        run = joined[again].iloc[0]
        cell = Cell(**{name: run[name] for name in COLUMNS})
        raise UserError(f"--add: {cell}, seed {run.seed} is in two of the folders; leave one of them out")
    return joined, all_
