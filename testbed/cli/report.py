"""`testbed report`: writes one self-contained page of what other commands wrote."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import JsonOption
from testbed.errors import UserError

EXAMPLE = (
    "Examples: testbed report runs/demo; testbed report runs/head-on runs/ladder --out study.html;"
    " testbed report runs/head-on --dossier --title 'Two X8s' --author 'A. Engineer' --date 2026-01-31"
)


def report(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="folders that commands wrote, in one page together")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", help="file to write; default DIR/report.html, or dossier.html, of the first"),
    ] = None,
    dossier: Annotated[
        bool,
        typer.Option("--dossier", help="a document for an authority, to be printed, instead of the page"),
    ] = False,
    title: Annotated[str | None, typer.Option("--title", help="of the dossier")] = None,
    author: Annotated[str | None, typer.Option("--author", help="who answers for the dossier")] = None,
    date: Annotated[str | None, typer.Option("--date", help="of the dossier, as 2026-01-31")] = None,
    open_: Annotated[bool, typer.Option("--open", help="show it in the browser")] = False,
    as_json: JsonOption = False,
) -> None:
    """Write one HTML page: verdict, scorecard, playback, ledger, figures, settings. It needs no network.

    Runs, comparisons, ladders, remedies, margins, answers, sweeps, searches, ledgers, exported tables,
    campaigns and benchmarks each have their page. With --dossier it is a document with a title, contents and
    chapters on results, aircraft, methods and what was not covered; print it to PDF from a browser.
    """
    from testbed.report.page import PAGE_FILE, write
    from testbed.studies.pages import KINDS

    given = {"--title": title, "--author": author, "--date": date}
    if not dossier:
        if said := [name for name, value in given.items() if value is not None]:
            raise UserError(f"{said[0]}: goes with --dossier")
        file = write(folders, out or folders[0] / PAGE_FILE, KINDS)
    else:
        from testbed.report.dossier import document

        if missing := [name for name, value in given.items() if value is None]:
            raise UserError(f"--dossier: give {' and '.join(missing)} too")
        heading = document.Heading(title or "", author or "", date or "")
        file = document.write(folders, out or folders[0] / document.FILE, heading, KINDS)
    print(json.dumps({"report": str(file)}) if as_json else f"report: {file}")
    if open_:
        typer.launch(file.resolve().as_uri())
