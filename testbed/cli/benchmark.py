"""`testbed benchmark`: flies filters on plants in sets of encounters and compares them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import JsonOption, WorkersOption, show_study
from testbed.errors import UserError

EXAMPLES = (
    "Examples: testbed benchmark field --n 2 --out runs/trial;"
    " testbed benchmark mine.toml --out runs/mine --minutes 15"
)


def benchmark(
    file: Annotated[str, typer.Argument(help="a benchmark that comes with the package, or a TOML file")],
    out: Annotated[
        Path | None, typer.Option("--out", help="folder to write, or to go on in; default runs/NAME")
    ] = None,
    n: Annotated[int | None, typer.Option("--n", help="encounters of each set at most, for a trial")] = None,
    minutes: Annotated[
        float | None, typer.Option("--minutes", help="stop after so long; the same command goes on")
    ] = None,
    search: Annotated[
        int | None,
        typer.Option("--search", help="try the file's candidates first, on so many encounters of each set"),
    ] = None,
    only: Annotated[
        str, typer.Option("--only", help="fly the runs of these filters in this call, as in none,flow")
    ] = "",
    again: Annotated[
        int | None,
        typer.Option("--again", help="keep runs of earlier code if so many of each cell, flown again, agree"),
    ] = None,
    as_it_is: Annotated[
        bool, typer.Option("--as-it-is", help="fly nothing: write the page of what is flown so far")
    ] = False,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fly every filter on every plant in every set of encounters, and tabulate loss, intervention and cost.

    All filters fly the same encounters. Interrupted, the same command goes on. No ranking is claimed that
    exact paired tests, counted together, do not carry.
    """
    from testbed.studies.benchmark.search import search as try_all
    from testbed.studies.benchmark.study import benchmark as fly

    for name, value in (("--n", n), ("--search", search), ("--again", again)):
        if value is not None and value < 1:
            raise UserError(f"{name} {value}: give at least 1")
    if n is not None and search is not None:
        raise UserError("--n and --search: a search has its own number; give one of the two")
    if only and search is not None:
        raise UserError("--only and --search: a search flies all filters; give one of the two")
    if minutes is not None and not minutes > 0:
        raise UserError(f"--minutes {minutes:g}: give more than 0")
    stem = Path(file).stem
    where = out or Path("runs") / (stem if search is None else f"{stem}-search")
    if search is not None:
        show_study(try_all(file, where, search, workers, minutes, again), as_json)
        return
    named = [name.strip() for name in only.split(",") if name.strip()]
    show_study(fly(file, where, workers, n, minutes, as_it_is, named, again), as_json)
