"""Commands about airframes: `aircraft list | check | copy`; others are in `describe` and `remaking`."""

from __future__ import annotations

import itertools
import json
import shlex
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbed.cli.common import show_named
from testbed.errors import UserError

if TYPE_CHECKING:
    from aircraft.airframes.schema import Airframe
    from aircraft.autopilots.parameter_files import ParameterFile

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Airframes: datasheets, checks, copies to start your own from.",
)

NameArg = Annotated[
    str,
    typer.Argument(
        metavar="NAME",
        help="an airframe (see: testbed aircraft list) or its folder; NAME@AUTOPILOT for another autopilot",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="print the result as JSON")]
OutOption = Annotated[Path | None, typer.Option("--out", help="folder to write")]
GainsOption = Annotated[
    Path | None, typer.Option("--gains", help="a gains file, as `testbed tune` writes it")
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="replace what an earlier run left there")]


@app.command(
    "list",
    short_help="The airframes that come with the testbed.",
    epilog="Example: testbed aircraft list --json",
)
def list_(as_json: JsonOption = False) -> None:
    """The airframes that come with the testbed, each under its own autopilot and under the others."""
    from aircraft.airframe import load
    from aircraft.airframes.schema import names
    from aircraft.equations.catalogue import names as autopilots

    rows = {}
    for name in names():
        own = load(name)
        rows[name] = f"{own.title}; autopilot: {own.autopilot}"
        rows |= {f"{name}@{o}": f"{own.title}; autopilot: {o}" for o in autopilots() if o != own.autopilot}
    show_named(rows, as_json)


@app.command(
    short_help="Whether an airframe's folder is sound.",
    epilog="Examples: testbed aircraft check x8; testbed aircraft check my-wing;"
    " exit code 0 clean, 1 findings, 2 bad input",
)
def check(
    name: NameArg,
    as_json: JsonOption = False,
) -> None:
    """Lint an airframe: files, properties, inertia, controls, thrust, stall, trim; with remedies."""
    from aircraft.airframes.schema import folder_of
    from aircraft.check.check import NOT_SEEN
    from aircraft.check.check import check as lint

    path = folder_of(name)
    try:
        findings = lint(path)
    except NotADirectoryError as error:
        raise UserError(str(error)) from None
    if as_json:
        from dataclasses import asdict

        print(json.dumps([asdict(f) for f in findings], indent=2))
    else:
        for finding in findings:
            print(finding)
        count = f"{len(findings)} finding{'s' if len(findings) > 1 else ''} in {path}"
        print(count if findings else f"{path} is clean")
        print(textwrap.fill(f"not checked: {NOT_SEEN}", 80))
    if findings:
        raise typer.Exit(1)


@app.command(short_help="A copy to start your own from.", epilog="Example: testbed aircraft copy x8 my-wing")
def copy(
    name: NameArg,
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="the new airframe's; its name is the last part")
    ],
    autopilot: Annotated[
        str | None,
        typer.Option("--autopilot", metavar="AUTOPILOT", help="the copy's own autopilot, as NAME@AUTOPILOT"),
    ] = None,
    param_file: Annotated[
        Path | None,
        typer.Option(
            "--param-file", help="the autopilot's parameters: ArduPilot's .param, QGroundControl's .params"
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Copy an airframe to start your own from: its model, gains and sources in a new folder."""
    from aircraft.airframe import copy as copied
    from aircraft.airframes.naming import split

    if autopilot is not None:
        name = f"{split(name)[0]}@{autopilot}"
    airframe = airframe_of(name)
    try:
        given = _given(airframe, param_file)
        made = copied(name, folder, given.on_defaults if given else None)
    except (FileExistsError, FileNotFoundError, ValueError) as error:
        raise UserError(str(error)) from None
    except OSError as error:
        raise UserError(f"cannot write {folder}: {error.strerror}") from None
    files = sorted(str(p.relative_to(made)) for p in made.rglob("*") if p.is_file())
    if as_json:
        said = {"parameters": vars(given) | {"path": str(given.path)}} if given else {}
        print(json.dumps({"folder": str(folder), "files": files} | said, indent=2))
        return
    if given:
        _show_given(given)
    print(f"{folder}: {', '.join(files)}")
    print(f"next: edit them, then: testbed aircraft check {folder}")


def _given(airframe: Airframe, path: Path | None) -> ParameterFile | None:
    """What a parameter file gives the airframe's autopilot."""
    from aircraft.autopilots.parameter_files import read_parameters
    from aircraft.equations.catalogue import equations_of

    if path is None:
        return None
    known = equations_of(airframe).parameters
    if not known:
        raise ValueError(
            f"--param-file: the autopilot {airframe.autopilot} has no parameters;"
            " say --autopilot arduplane or --autopilot px4"
        )
    return read_parameters(path, known)


def _show_given(given: ParameterFile) -> None:
    """What was taken from a parameter file, and what was not."""
    print(f"{given.path}: {len(given.values)} parameters of the autopilot")
    for text in given.converted:
        print(f"  converted: {text}")
    for text in given.unusual:
        print(f"  unusual: {text}")
    for name, near in given.near.items():
        print(f"  unknown: {name}; did you mean {near}?")
    if given.unused:
        text = f"unused ({len(given.unused)}): {', '.join(given.unused)}"
        print(textwrap.fill(text, 100, initial_indent="  ", subsequent_indent="    "))


def airframe_of(name: str, gains: Path | None = None) -> Airframe:
    """An airframe by name or folder, with the gains of a file if given; a mistake is one line."""
    from aircraft.airframe import load, load_gains
    from aircraft.autopilots.gains import gain_faults

    try:
        airframe = load(name)
        if gains is not None:
            airframe = load_gains(gains, airframe)
    except (FileNotFoundError, ValueError) as error:
        raise UserError(str(error)) from None
    if faults := gain_faults(airframe):
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        raise UserError(f"{gains or airframe.folder / 'airframe.toml'}: gains.{faults[0]}{more}")
    return airframe


@contextmanager
def flying(name: str) -> Iterator[None]:
    """What a model that cannot be flown raises ends in one line that names the airframe and its check."""
    from numpy.linalg import LinAlgError

    from aircraft.jsbsim.errors import FdmError

    try:
        yield
    except (FdmError, ArithmeticError, LinAlgError) as error:
        kind = "" if isinstance(error, FdmError) else f"{type(error).__name__}: "
        raise UserError(f"{name}: {kind}{error}; see: testbed aircraft check {shlex.quote(name)}") from None


def say(what: str) -> None:
    print(f"{what} ...", file=sys.stderr, flush=True)


def show_table(title: str, rows: list[dict[str, Any]]) -> None:
    """Rows below their title; a column named `step` becomes lines between them."""
    from rich.console import Console

    from testbed.report.tables import plain_table

    console = Console()
    if not rows or "step" not in rows[0]:
        console.print(plain_table(title, rows))
        return
    console.print(f"[italic]{title}[/]")
    for step, found in itertools.groupby(rows, key=lambda row: row["step"]):
        listed = [{k: v for k, v in row.items() if k != "step"} for row in found]
        for row in listed:
            row["quantity"] = f"  {row['quantity']}".ljust(38)
        table = plain_table("", listed)
        table.title, table.show_header = None, False
        console.print(step)
        console.print(table)
