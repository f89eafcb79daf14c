"""Commands that measure airframes: `aircraft describe`, one or several over each other, and `linear`."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.aircraft import (
    GainsOption,
    JsonOption,
    NameArg,
    OutOption,
    OverwriteOption,
    airframe_of,
    flying,
    say,
    show_table,
)
from testbed.errors import UserError

EXAMPLES = (
    "Examples: testbed aircraft describe x8 --out datasheets/x8;"
    " testbed aircraft describe x8 x8@arduplane tuned/gains.toml --overlay --out overlay"
)
LINEAR_EXAMPLES = (
    "Examples: testbed aircraft linear x8 --out x8.mat;"
    " testbed aircraft linear x8@px4 --speed 18 --out x8-px4.json"
)
NamesArg = Annotated[
    list[str],
    typer.Argument(
        metavar="NAME...",
        help="an airframe (see: testbed aircraft list), its folder or a gains file;"
        " NAME@AUTOPILOT for another autopilot; several with --overlay",
    ),
]


def describe(
    names: NamesArg,
    out: OutOption = None,
    gains: GainsOption = None,
    overlay: Annotated[
        bool,
        typer.Option("--overlay", help="several airframes or gains files over each other, a figure a loop"),
    ] = False,
    speed: Annotated[
        float | None,
        typer.Option("--speed", help="of --overlay, m/s; absent: each airframe's own start speed"),
    ] = None,
    overwrite: OverwriteOption = False,
    as_markdown: Annotated[bool, typer.Option("--markdown", help="print the tables as Markdown")] = False,
    as_json: JsonOption = False,
) -> None:
    """A datasheet: geometry, trim, envelope, modes, margins, steps; with --out a page with plots.

    With --overlay, of several airframes or gains files: each loop's Bode and Nyquist plots, margins and
    step, over each other.
    """
    if overlay:
        _overlay(names, out, gains, speed, overwrite, as_markdown, as_json)
        return
    if len(names) > 1:
        raise UserError(f"one airframe has a datasheet, got {len(names)}; to compare them add --overlay")
    if speed is not None:
        raise UserError("--speed: a datasheet is of all speeds; it belongs to --overlay")
    from aircraft.datasheets.datasheet import describe as measure
    from testbed.records.checksums import plain
    from testbed.records.store import check_free
    from testbed.report.aircraft_tables import markdown, tables

    airframe = airframe_of(names[0], gains)
    if out is not None:
        check_free(out, overwrite)
    with flying(names[0]):
        sheet = measure(airframe, progress=say)
    if out is not None:
        from testbed.report.aircraft_page import write

        write(sheet, out, overwrite)
    if as_json:
        print(json.dumps(plain(sheet.as_dict()), indent=2))
        return
    if as_markdown:
        print(markdown(sheet))
        return
    for title, rows in tables(sheet).items():
        show_table(title, rows)
    if out is not None:
        print(f"page: {out / 'index.html'}")


def _overlay(
    names: list[str],
    out: Path | None,
    gains: Path | None,
    speed: float | None,
    overwrite: bool,
    as_markdown: bool,
    as_json: bool,
) -> None:
    """Several airframes over each other: figures and a table in `out`, the table on the terminal."""
    from aircraft.datasheets.overlay import compare, rows
    from aircraft.jsbsim.errors import FdmError
    from testbed.records.checksums import plain
    from testbed.records.store import check_free
    from testbed.report.overlay_page import shown, write

    if gains is not None:
        raise UserError("--gains: name gains files among the airframes of --overlay instead")
    if as_markdown:
        raise UserError("--markdown: of a datasheet; --overlay writes overlay.csv with --out")
    if len(names) < 2:
        raise UserError("--overlay: name two airframes or gains files, or more")
    if len(names) > 7:
        raise UserError(f"--overlay: at most 7 can be told apart in a figure, got {len(names)}")
    if out is not None:
        check_free(out, overwrite)
    airframes = [airframe_of(name) for name in names]
    called = [a.name for a in airframes]
    if twice := [name for name in called if called.count(name) > 1]:
        raise UserError(
            f"--overlay: {twice[0]} is named twice; give folders or gains files of their own names"
        )
    try:
        found = compare(airframes, speed, say)
    except FdmError as error:
        raise UserError(str(error)) from None
    except ValueError as error:
        raise UserError(f"--speed: {error}") from None
    if out is not None:
        command = shlex.join(["testbed", "aircraft", "describe", *names, "--overlay"])
        write(found, out, command + (f" --speed {speed:g}" if speed is not None else ""), overwrite)
    if as_json:
        print(json.dumps(plain(rows(found)), indent=2))
        return
    show_table("Loops broken at the plant input, and the steps they fly", shown(found))
    if out is not None:
        print(f"figures, overlay.csv and page: {out}")


def linear(
    name: NameArg,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="what to write: FILE.mat or FILE.json")
    ] = None,
    speed: Annotated[
        float | None, typer.Option("--speed", help="of level flight, m/s; absent: the airframe's start speed")
    ] = None,
    gains: GainsOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """The linear model of aircraft and autopilot for python-control or MATLAB: A, B, C, D, names, units.

    Around level flight in still air: the bare airframe, the closed loop from commands to motion, and each
    loop broken at the plant input. Without --out, a table of what the file would hold.
    """
    from aircraft.autopilots.linear_export import exported, write

    if out is not None and out.suffix not in (".mat", ".json"):
        raise UserError(f"--out {out}: the ending says the format; name it FILE.mat or FILE.json")
    if out is not None and out.exists() and not overwrite:
        raise UserError(f"{out} exists; give another file or add --overwrite")
    airframe = airframe_of(name, gains)
    speeds = airframe.speeds
    v = speeds.start_mps if speed is None else speed
    if not speeds.v_min_mps <= v <= speeds.v_max_mps:
        span = f"{speeds.v_min_mps:g} to {speeds.v_max_mps:g} m/s"
        raise UserError(f"--speed: {airframe.name} is flown at {span}, not at {v:g} m/s")
    with flying(name):
        content = exported(airframe, v)
    if out is not None:
        try:
            write(out, content)
        except OSError as error:
            raise UserError(f"cannot write {out}: {error.strerror}") from None
    if as_json:
        print(json.dumps(content, default=lambda x: x.tolist()))
        return
    rows = [
        {"system": key, "states": len(system["states"]), "inputs": ", ".join(system["inputs"])}
        | {"outputs": ", ".join(system["outputs"]), "period s": system["dt"] or "continuous"}
        for key, system in content.items()
        if isinstance(system, dict) and "A" in system
    ]
    show_table(f"Linear model of {airframe.title} under {airframe.fit} at {v:g} m/s", rows)
    if "note" in content:
        print(f"note: {content['note']}")
    if out is not None:
        print(f"linear model: {out}")
