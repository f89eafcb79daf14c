"""`testbed export`: writes a run for Tacview, or as CSV."""

from __future__ import annotations

import json
import textwrap
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.cli.common import JsonOption, OverwriteOption
from testbed.errors import UserError

if TYPE_CHECKING:
    from testbed.export.events import Event
    from testbed.records.run import Run


class Format(StrEnum):
    acmi = "acmi"
    csv = "csv"


EXAMPLE = (
    "Examples: testbed export runs/demo/jsbsim --format acmi --out head-on.zip.acmi;"
    " testbed export runs/demo/jsbsim --format csv --out head-on"
)


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="a run folder")],
    format_: Annotated[
        Format, typer.Option("--format", help="acmi: one file for Tacview; csv: a folder of tables")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="file or folder to write; by default RUN.txt.acmi or RUN-csv, beside the run"
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """A run for other programs: a Tacview recording with attitudes and bookmarks, or tidy CSV."""
    flown = _run(run)
    default = run.resolve().name + (".txt.acmi" if format_ is Format.acmi else "-csv")
    where = out or run.resolve().parent / default
    found = (_acmi if format_ is Format.acmi else _csv)(flown, where, overwrite)
    if as_json:
        from dataclasses import asdict

        print(json.dumps({"file": str(where), "events": [asdict(e) for e in found]}, indent=2))
        return
    for event in found:
        line = f"{event.t_s:9.3f} s  {'-'.join(map(str, event.vehicles)):7} {event.text}"
        print(textwrap.fill(line, 80, subsequent_indent=" " * 21))
    print(f"written: {where}")


def _run(path: Path) -> Run:
    """The run at `path`, with its tables read; a folder of runs is named for what it is."""
    from testbed.records.store import MANIFEST, load

    inside = sorted(p.parent for p in path.glob(f"*/{MANIFEST}"))
    if inside and not (path / MANIFEST).is_file():
        raise UserError(f"{path} holds several runs; give one: " + ", ".join(map(str, inside[:5])))
    run = load(path)
    try:
        run.vehicles, run.pairs  # noqa: B018
    except (OSError, ValueError) as error:
        raise UserError(f"{path} is damaged: {error}") from None
    return run


def _acmi(run: Run, where: Path, overwrite: bool) -> list[Event]:
    from testbed.export import acmi

    if not where.name.endswith((".txt.acmi", ".zip.acmi")):
        raise UserError(f"--out {where}: Tacview opens names that end in .txt.acmi or .zip.acmi")
    if where.exists() and not (overwrite and where.is_file()):
        raise UserError(f"{where} exists; give another --out, or --overwrite")
    try:
        where.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=where.parent, prefix=".export-") as folder:
            found = acmi.write(run, Path(folder) / where.name)
            (Path(folder) / where.name).replace(where)
    except OSError as error:
        raise UserError(f"cannot write {where}: {error.strerror}") from None
    return found


def _csv(run: Run, where: Path, overwrite: bool) -> list[Event]:
    from testbed.export import csv
    from testbed.records.store import staged

    with staged(where, overwrite) as folder:
        return csv.write(run, folder)
