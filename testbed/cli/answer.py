"""`testbed answer`: flies fleets, missions, weather, remedies and guidance, and tabulates what survives."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbed.cli.common import (
    JsonOption,
    OutOption,
    OverwriteOption,
    SetOption,
    WorkersOption,
    count,
    show_study,
)
from testbed.errors import UserError

if TYPE_CHECKING:
    from testbed.studies.answer.cells import Cell

EXAMPLE = "Example: testbed answer --airframes x8 --vehicles 2 --seeds 20"


def answer(
    cells: Annotated[
        str | None, typer.Option("--cells", help="cells of the page by number, as 3 or 1,4-7; see --list")
    ] = None,
    list_: Annotated[
        bool, typer.Option("--list", help="list the cells with runs and reasons, and fly nothing")
    ] = False,
    airframes: Annotated[
        str | None,
        typer.Option("--airframes", help="by name or folder, with commas between; unicycle too"),
    ] = None,
    vehicles: Annotated[str | None, typer.Option("--vehicles", help="2, 20, 50, with commas between")] = None,
    missions: Annotated[
        str | None, typer.Option("--missions", help="swap, streams, random, with commas between")
    ] = None,
    weather: Annotated[str | None, typer.Option("--weather", help="calm, windy or both")] = None,
    guidance: Annotated[
        str | None,
        typer.Option("--guidance", help="straight, layers, roundabout, with commas between"),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="fly this remedy; may be repeated")
    ] = None,
    set_: SetOption = None,
    add: Annotated[
        list[Path] | None,
        typer.Option("--add", help="take over the runs of this answer's folder; may be repeated"),
    ] = None,
    out: OutOption = None,
    seeds: Annotated[
        int | None, typer.Option("--seeds", help="runs of each cell; by default as the page has it, or 20")
    ] = None,
    fleet_seeds: Annotated[
        int | None, typer.Option("--fleet-seeds", help="runs of cells of 20 and 50; default: --seeds")
    ] = None,
    first_seed: Annotated[int, typer.Option("--first-seed", help="the seed of the first run")] = 2001,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fly the answer's cells, or all combinations of what you name, and tabulate what survives.

    Without --airframes, --vehicles, --missions, --weather, --guidance and --only the cells of the guide's
    page are flown, or those of --cells. With any of them every combination is flown; what is not named is
    unicycle, x8 and rascal, 2, swap, calm and windy, straight, and the remedies none, lags and flow.
    """
    from testbed.studies.answer import cells as made
    from testbed.studies.answer import design

    axes = _axes(airframes, vehicles, missions, weather, guidance, only)
    if axes and cells is not None:
        raise UserError("--cells: it chooses among the page's cells; leave out the other choices, or --cells")
    asked = made.product(axes) if axes else design.chosen(cells) if cells else list(design.CELLS)
    runs = {}
    for cell in asked:
        n = fleet_seeds if fleet_seeds is not None and cell.number > 2 else seeds
        n = design.CELLS.get(cell, 20) if n is None else count(n)
        runs[cell] = range(first_seed, first_seed + n)
    if list_:
        _list(runs)
        return
    from testbed.studies.answer.study import answer as find

    where = out or Path("runs") / "answer"
    show_study(find(runs, where, workers, overwrite, set_ or [], add or []), as_json)


def _axes(
    airframes: str | None,
    vehicles: str | None,
    missions: str | None,
    weather: str | None,
    guidance: str | None,
    only: list[str] | None,
) -> dict[str, Sequence[Any]]:
    """The values of each axis, if any was named; else nothing."""
    from testbed.studies.answer import cells as made
    from testbed.studies.answer.design import FLOW, LAGS, NONE

    def several(text: str | None, default: str) -> list[str]:
        return [part.strip() for part in (default if text is None else text).split(",") if part.strip()]

    if not any((airframes, vehicles, missions, weather, guidance, only)):
        return {}
    numbers = {str(n): n for n in made.NUMBERS}
    for text in (counts := several(vehicles, "2")):
        if text not in numbers:
            raise UserError(f"--vehicles {text}: give 2, 20 or 50, or several with commas between")
    return {
        "number": [numbers[text] for text in counts],
        "mission": several(missions, "swap"),
        "vehicle": several(airframes, "unicycle,x8,rascal"),
        "weather": several(weather, "calm,windy"),
        "remedy": only or [NONE, LAGS, FLOW],
        "guidance": several(guidance, "straight"),
    }


def _list(runs: dict[Cell, range]) -> None:
    """Prints the cells, with their number on the page where they have one."""
    from testbed.studies.answer import design

    numbers = {cell: k for k, cell in enumerate(design.CELLS, 1)}
    reasons = {block.cells[0]: block.why for block in design.DESIGN}
    for cell, seeds in runs.items():
        if cell in reasons:
            print(f"\n{reasons[cell]}:")
        print(f"{numbers.get(cell, ''):>4}  {cell}: {len(seeds)} runs")
    print(f"\n{len(runs)} cells, {sum(map(len, runs.values()))} runs")
