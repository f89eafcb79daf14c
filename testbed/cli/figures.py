"""`testbed figures`: redraws the paper's figures and compares them with the published points."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import JsonOption, OverwriteOption, SetOption, WorkersOption, show

EXAMPLE = "Example: testbed figures --out figures"


def figures(
    out: Annotated[Path, typer.Option("--out", help="folder to write")],
    plant: Annotated[str, typer.Option("--plant", help="unicycle, lagged or jsbsim")] = "unicycle",
    kink: Annotated[bool, typer.Option("--kink", help="fly the kink study instead (some minutes)")] = False,
    onset: Annotated[bool, typer.Option("--onset", help="study instead when overriding begins")] = False,
    seeds: Annotated[int, typer.Option("--seeds", help="number of headings in the kink study")] = 20,
    workers: WorkersOption = None,
    set_: SetOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Redraw the paper's figures 2, 3 and 6, with errors at the published points; or fly another study."""
    from testbed.report.tables import plain_table
    from testbed.studies.paper.paper import make

    what = [name for name, asked in (("onset", onset), ("kink", kink)) if asked] or ["paper"]
    book = make(
        out,
        what,
        plant=plant,
        overrides=set_ or [],
        seeds=seeds,
        workers=workers,
        overwrite=overwrite,
    )
    if as_json:
        from testbed.records.checksums import plain

        print(json.dumps(plain(book.summary()), indent=2))
        return
    for title, rows in book.tables.items():
        show(plain_table(title, rows))
    print(f"{len(book.files)} files in {out}")
