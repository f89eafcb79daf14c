"""`testbed answer`: flies aircraft, weather and remedies, and tabulates whether the guarantee survives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import (
    JsonOption,
    OutOption,
    OverwriteOption,
    SeedsOption,
    WorkersOption,
    count,
    show_study,
)
from testbed.errors import UserError

EXAMPLE = "Example: testbed answer --airframes x8 --vehicles 2 --seeds 20"


def answer(
    airframes: Annotated[
        str, typer.Option("--airframes", help="airframes by name or folder, with commas between")
    ] = "x8,rascal",
    vehicles: Annotated[str, typer.Option("--vehicles", help="2, 20 or both")] = "2,20",
    out: OutOption = None,
    seeds: SeedsOption = 50,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fly aircraft in all weathers with all remedies, and tabulate whether the guarantee survives."""
    from testbed.studies.answer.answer import FLEETS
    from testbed.studies.answer.study import answer as find

    fleets = {str(n): n for n in FLEETS}
    asked = [v.strip() for v in vehicles.split(",")]
    if unknown := [v for v in asked if v not in fleets]:
        raise UserError(f"--vehicles {unknown[0]}: give 2, 20 or 2,20")
    names = [a.strip() for a in airframes.split(",") if a.strip()]
    where = out or Path("runs") / "answer"
    show_study(find(names, [fleets[v] for v in asked], count(seeds), where, workers, overwrite), as_json)
