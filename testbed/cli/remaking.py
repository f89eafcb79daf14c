"""Commands that remake what an airframe's files derive: `aircraft identify | trim | autopilot`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.cli.aircraft import JsonOption, NameArg, airframe_of, app, flying, say, show_table
from testbed.errors import UserError

if TYPE_CHECKING:
    from aircraft.airframes.schema import Airframe
    from aircraft.autopilots.remaking import Remade

DryRunOption = Annotated[bool, typer.Option("--dry-run", help="print what would be written; write nothing")]


@app.command(
    short_help="Identify an airframe's lags.",
    epilog="Examples: testbed aircraft identify my-wing; testbed aircraft identify my-gains.toml --dry-run",
)
def identify(name: NameArg, dry_run: DryRunOption = False, as_json: JsonOption = False) -> None:
    """Fly steps and write lag, delay and rate limits of each channel as [identified]; about 20 s."""
    from aircraft.autopilots.remaking import remade_lags

    _remake(name, lambda airframe: remade_lags(airframe, say), dry_run, as_json)


@app.command(
    short_help="Fit the feed-forward to level trims.",
    epilog="Examples: testbed aircraft trim my-wing --dry-run; testbed aircraft trim my-wing",
)
def trim(name: NameArg, dry_run: DryRunOption = False, as_json: JsonOption = False) -> None:
    """Fit lift, drag and elevator of [gains.airframe] to level trims of the model, and write them."""
    from aircraft.autopilots.remaking import remade_feedforward

    after = "testbed aircraft autopilot {0}, then: testbed aircraft identify {0}"
    _remake(_folder(name), remade_feedforward, dry_run, as_json, after)


@app.command(
    short_help="Compile the autopilot.",
    epilog="Examples: testbed aircraft autopilot my-wing; testbed aircraft autopilot x8 --dry-run;"
    " testbed aircraft autopilot x8@px4 --parameters --diagram px4-blocks",
)
def autopilot(
    name: NameArg,
    dry_run: DryRunOption = False,
    parameters: Annotated[
        bool, typer.Option("--parameters", help="print the autopilot's parameters; write nothing")
    ] = False,
    as_markdown: Annotated[bool, typer.Option("--markdown", help="print --parameters as Markdown")] = False,
    diagram: Annotated[
        Path | None,
        typer.Option("--diagram", metavar="FOLDER", help="draw block diagrams, one for each output, there"),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Compile the autopilot's equations and the gains of airframe.toml to systems/autopilot.xml.

    With --parameters or --diagram nothing is compiled: they show what the equations say.
    """
    from aircraft.autopilots.remaking import remade_autopilot

    if as_markdown and not parameters:
        raise UserError("--markdown: belongs to --parameters")
    if diagram is not None:
        _diagrams(airframe_of(name), diagram)
    if parameters:
        _parameters(airframe_of(name), as_json, as_markdown)
    if parameters or diagram is not None:
        return
    _remake(_folder(name), remade_autopilot, dry_run, as_json)


def _diagrams(airframe: Airframe, folder: Path) -> None:
    """Block diagrams of an airframe's autopilot."""
    from testbed.report.block_diagram import write

    try:
        files = write(airframe, folder)
    except OSError as error:
        raise UserError(f"cannot write {folder}: {error.strerror}") from None
    print("block diagrams: " + ", ".join(map(str, files)), file=sys.stderr)


def _parameters(airframe: Airframe, as_json: bool, as_markdown: bool) -> None:
    """The table of an autopilot's parameters or gains: value here, default, unit, range, what each does."""
    from aircraft.autopilots.parameters import markdown, table

    rows = table(airframe)
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    if as_markdown:
        print(markdown(rows))
        return
    show_table(f"Parameters of {airframe.autopilot} on {airframe.title}", rows)


def _folder(name: str) -> str:
    """`name`, unless it is a gains file: what is written belongs into an airframe's folder."""
    if name.endswith(".toml"):
        raise UserError(f"{name}: give an airframe or its folder, not a gains file")
    from aircraft.airframes.naming import split

    base, asked = split(name)
    if asked:
        raise UserError(
            f"{name}: what is written belongs to the airframe's own autopilot; give {base}, or copy it:"
            f" testbed aircraft copy {base} FOLDER --autopilot {asked[0]}"
        )
    return name


def _remake(
    name: str, make: Callable[[Airframe], Remade], dry_run: bool, as_json: bool, after: str = ""
) -> None:
    """Make a file of an airframe anew, write it unless told not to, and say what changed."""
    airframe = airframe_of(name)
    try:
        with flying(name):
            remade = make(airframe)
        changed = remade.changed
        if changed and not dry_run:
            remade.write()
    except ValueError as error:
        raise UserError(f"{airframe.folder / 'airframe.toml'}: {error}") from None
    except OSError as error:
        raise UserError(f"cannot write {remade.path}: {error.strerror}") from None
    if as_json:
        written = changed and not dry_run
        print(
            json.dumps(
                {"file": str(remade.path), "changed": changed, "written": written, "text": remade.shown}
            )
        )
        return
    if dry_run or remade.shown != remade.text:
        print(remade.shown.rstrip("\n"))
    if dry_run:
        return
    print(f"{remade.path}: {'written' if changed else 'unchanged'}", file=sys.stderr)
    if changed and after:
        print(f"next: {after.format(name)}", file=sys.stderr)
