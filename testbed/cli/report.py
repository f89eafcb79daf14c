"""`testbed report`: writes one self-contained page of what other commands wrote."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import JsonOption

EXAMPLE = "Examples: testbed report runs/demo; testbed report runs/head-on runs/ladder --out study.html"


def report(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="folders that commands wrote, in one page together")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", help="file to write; default DIR/report.html of the first folder")
    ] = None,
    open_: Annotated[bool, typer.Option("--open", help="show it in the browser")] = False,
    as_json: JsonOption = False,
) -> None:
    """Write one HTML page: verdict, scorecard, playback, ledger, figures, settings. It needs no network.

    Runs, comparisons, ladders, remedies, margins, answers, sweeps, searches, ledgers, exported tables and
    campaigns each have their page.
    """
    from testbed.report.page import PAGE_FILE, write
    from testbed.studies.pages import KINDS

    file = write(folders, out or folders[0] / PAGE_FILE, KINDS)
    print(json.dumps({"report": str(file)}) if as_json else f"report: {file}")
    if open_:
        typer.launch(file.resolve().as_uri())
