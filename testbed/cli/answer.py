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
    SetOption,
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
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="fly this remedy; may be repeated")
    ] = None,
    set_: SetOption = None,
    out: OutOption = None,
    seeds: SeedsOption = 50,
    fleet_seeds: Annotated[
        int | None,
        typer.Option("--fleet-seeds", help="seeds of fleets of 20; default a fifth of --seeds, at least 5"),
    ] = None,
    first_seed: Annotated[int, typer.Option("--first-seed", help="the seed of the first run")] = 1,
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
    each = {2: count(seeds), 20: max(5, seeds // 5) if fleet_seeds is None else count(fleet_seeds)}
    chosen = {fleets[v]: range(first_seed, first_seed + each[fleets[v]]) for v in asked}
    show_study(find(names, chosen, where, workers, overwrite, only or [], set_ or []), as_json)
