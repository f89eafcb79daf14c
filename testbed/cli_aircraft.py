"""Commands about airframes: `aircraft list | describe | check` and `tune`."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbed.errors import UserError

if TYPE_CHECKING:
    from aircraft.airframe import Airframe

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Airframes: what they can do, and whether a folder holds a good one.",
)

NameArg = Annotated[
    str, typer.Argument(metavar="NAME", help="an airframe (see: testbed aircraft list) or its folder")
]
JsonOption = Annotated[bool, typer.Option("--json", help="print the result as JSON")]
OutOption = Annotated[Path | None, typer.Option("--out", help="folder to write")]
GainsOption = Annotated[
    Path | None, typer.Option("--gains", help="a gains file, as `testbed tune` writes it")
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="replace what an earlier run left there")]


@app.command("list", epilog="Example: testbed aircraft list --json")
def list_(as_json: JsonOption = False) -> None:
    """The airframes that come with the testbed."""
    from aircraft.airframe import load, names

    rows = {name: load(name).title for name in names()}
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    for name, title in rows.items():
        print(f"{name}\n    {title}")


@app.command(epilog="Example: testbed aircraft describe x8 --out datasheets/x8")
def describe(
    name: NameArg,
    out: OutOption = None,
    gains: GainsOption = None,
    overwrite: OverwriteOption = False,
    as_markdown: Annotated[bool, typer.Option("--markdown", help="print the tables as Markdown")] = False,
    as_json: JsonOption = False,
) -> None:
    """A datasheet: geometry, trim, envelope, modes, margins, steps; with --out a page with plots."""
    from aircraft.datasheet import describe as measure
    from aircraft.fdm import FdmError
    from testbed.report.aircraft_tables import markdown, tables
    from testbed.store import check_free, plain

    airframe = airframe_of(name, gains)
    if out is not None:
        check_free(out, overwrite)
    try:
        sheet = measure(airframe, progress=_say)
    except FdmError as error:
        raise UserError(f"{name}: {error}; see: testbed aircraft check") from None
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
        _table(title, rows)
    if out is not None:
        print(f"page: {out / 'index.html'}")


@app.command(epilog="Example: testbed aircraft check my-airframe; exit code 0 clean, 1 findings, 2 bad input")
def check(
    path: Annotated[
        Path, typer.Argument(metavar="PATH", help="an airframe folder: JSBSim XML, airframe.toml")
    ],
    as_json: JsonOption = False,
) -> None:
    """Lint an airframe folder: files, properties, inertia, controls, thrust, stall, trim; with remedies."""
    from aircraft.lint import NOT_SEEN
    from aircraft.lint import check as lint

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
        print(f"{len(findings)} findings in {path}" if findings else f"{path} is clean")
        print(f"not checked: {NOT_SEEN}")
    if findings:
        raise typer.Exit(1)


def airframe_of(name: str, gains: Path | None = None) -> Airframe:
    """An airframe by name or folder, with the gains of a file if given; a mistake is one line."""
    from aircraft.airframe import load
    from aircraft.gains import gain_faults

    try:
        airframe = load(name)
        if gains is not None:
            from aircraft.gains import read

            airframe = read(gains, airframe)
    except (FileNotFoundError, ValueError) as error:
        raise UserError(str(error)) from None
    if faults := gain_faults(airframe):
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        raise UserError(f"{gains or airframe.folder / 'airframe.toml'}: gains.{faults[0]}{more}")
    return airframe


def _say(what: str) -> None:
    import sys

    print(f"{what} ...", file=sys.stderr, flush=True)


def _table(title: str, rows: list[dict[str, Any]]) -> None:
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


def tune(
    name: NameArg,
    sweep: Annotated[
        list[str] | None,
        typer.Option("--sweep", metavar="GAIN=FROM:TO:COUNT", help="factors of the gain; :abs for values"),
    ] = None,
    scenario: Annotated[
        str | None, typer.Option("--scenario", help="flown at every point of the sweep, for its guarantee")
    ] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="FIELD=VALUE", help="override a scenario field")
    ] = None,
    optimise: Annotated[
        bool, typer.Option("--optimise", help="find gains that meet the specification")
    ] = False,
    vary: Annotated[list[str] | None, typer.Option("--vary", metavar="GAIN", help="of --optimise")] = None,
    seed: Annotated[int, typer.Option("--seed", help="of the first simplex of --optimise")] = 1,
    starts: Annotated[int, typer.Option("--starts", help="simplices of --optimise, seeds counted up")] = 2,
    evaluations: Annotated[int, typer.Option("--evaluations", help="at most so many a start")] = 300,
    gains: GainsOption = None,
    out: OutOption = None,
    workers: Annotated[int | None, typer.Option("--workers", help="processes; default one a core")] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Score an airframe's gains on the step specification; sweep them, a scenario in the loop; optimise them.

    Gains are those of airframe.toml, SECTION.NAME; any unambiguous beginning will do. A sweep's range is in
    factors of the file's value, in equal ratios: 0.5:2:9 has the value itself in the middle.
    """
    from testbed.studies import optimising, tuning

    airframe = airframe_of(name, gains)
    if scenario and not sweep:
        raise UserError("--scenario: flown at the points of a --sweep; give one")
    if sweep and optimise:
        raise UserError("--sweep and --optimise: one at a time")
    said = _command(name, sweep, scenario, set_, gains)
    where = out or Path("runs") / f"{airframe.name}-tune"
    if sweep:
        from testbed.scenario import load

        s = load(scenario, [*(set_ or []), "plant=jsbsim"]) if scenario else None
        swept = [tuning.Sweep.parse(text, airframe) for text in sweep]
        found = tuning.sweep(
            airframe, name, swept, s, where, command=said, workers=workers, overwrite=overwrite
        )
    elif optimise:
        said += "".join(f" --vary {v}" for v in vary or [])
        said += f" --optimise --seed {seed} --starts {starts} --evaluations {evaluations}"
        found = optimising.optimise(
            airframe, name, where, command=said, vary=vary or [], seed=seed, starts=starts,
            evaluations=evaluations, workers=workers, overwrite=overwrite,
        )  # fmt: skip
    else:
        found = tuning.specification(airframe)
    if as_json:
        from testbed.store import plain

        print(json.dumps(plain(found.data), indent=2))
    else:
        _table(found.title, found.rows)
        print("\n".join(found.lines))
    if optimise and not found.met:
        raise typer.Exit(1)


TUNE_EXAMPLES = (
    "Examples: testbed tune x8;"
    " testbed tune x8 --sweep turn.bandwidth=0.5:2:9 --scenario paper-2-turn --out sweep;"
    " testbed tune rascal --optimise --out tuned; testbed tune rascal --gains tuned/gains.toml"
)


def _command(
    name: str, sweep: list[str] | None, scenario: str | None, set_: list[str] | None, gains: Path | None
) -> str:
    """The command that remakes a result: what decides its numbers, and no more."""
    import shlex

    words = ["testbed", "tune", name]
    for option, values in (("--sweep", sweep), ("--set", set_)):
        words += [w for value in values or [] for w in (option, value)]
    words += ["--scenario", scenario] if scenario else []
    words += ["--gains", str(gains)] if gains else []
    return shlex.join(words)
