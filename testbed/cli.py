"""The command line. Every mistake of a user's is one line on stderr and exit code 2."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.errors import UserError

if TYPE_CHECKING:
    from testbed.record import Run
    from testbed.scenario import Scenario
    from testbed.studies.robustness import Found

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Does a collision-avoidance guarantee proved on a unicycle survive on a real aeroplane?"
    " Start with: testbed compare paper-2-turn",
)

ScenarioArg = Annotated[str, typer.Argument(help="a built-in scenario (see: testbed list) or a TOML file")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="FIELD=VALUE", help="override a field; may be repeated")
]
OutOption = Annotated[Path | None, typer.Option("--out", help="folder to write; default runs/NAME")]
SeedOption = Annotated[int | None, typer.Option("--seed", help="seed of everything random in the run")]
ForceOption = Annotated[bool, typer.Option("--force", help="fly even from a start outside the safe set")]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="replace what an earlier run left there")]
JsonOption = Annotated[bool, typer.Option("--json", help="print the result as JSON")]

PlantOption = Annotated[str | None, typer.Option("--plant", help="unicycle, lagged or jsbsim")]
SeedsOption = Annotated[int, typer.Option("--seeds", help="runs of a study, seeds 1 to this")]
WorkersOption = Annotated[int | None, typer.Option("--workers", help="processes; default one a core")]

# Studies sample the filter as an autopilot would, 20 Hz, unless told otherwise.
STUDY_RATES = ("rates.filter_dt_s=0.05", "rates.record_dt_s=1")


@app.command(epilog="Example: testbed run paper-2-turn --plant jsbsim --set d_safe_m=8 --out runs/wide")
def run(
    scenario: ScenarioArg,
    plant: PlantOption = None,
    set_: SetOption = None,
    seed: SeedOption = None,
    out: OutOption = None,
    force: ForceOption = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fly one scenario on one plant, judge it, and write a run folder."""
    from testbed.report.tables import scorecard

    s = _scenario(scenario, set_, seed, plant)
    where = out or Path("runs") / f"{s.name}-{s.plant}"
    result = _fly(s, where, force, overwrite)
    if as_json:
        print(json.dumps({"run": str(where), "guarantees": result.guarantees}, indent=2))
        return
    _print(scorecard({s.plant: result}, f"{s.name} on {s.plant}"))
    print(f"run folder: {where}")


@app.command(epilog="Example: testbed compare paper-2-turn --plants unicycle,jsbsim --out runs/head-on")
def compare(
    scenario: ScenarioArg,
    plants: Annotated[str, typer.Option("--plants", help="plants to compare")] = "unicycle,jsbsim",
    set_: SetOption = None,
    seed: SeedOption = None,
    out: OutOption = None,
    force: ForceOption = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    ladder: Annotated[
        bool,
        typer.Option("--ladder", help="climb the fidelity ladder instead: lags, 6-DOF, weather, network"),
    ] = False,
    seeds: SeedsOption = 20,
    workers: WorkersOption = None,
) -> None:
    """Fly one scenario on several plants: a table of guarantees, and figures with the plants overlaid."""
    if ladder:
        from testbed.studies.robustness import ladder as climb

        s = _scenario(scenario, set_, seed, None)
        where = out or Path("runs") / f"{s.name}-ladder"
        _study(climb(s, _count(seeds), where, workers, overwrite), as_json)
        return
    from testbed.comparison import compare as fly_all
    from testbed.report.tables import scorecard

    names = [p.strip() for p in plants.split(",") if p.strip()]
    scenarios = {p: _scenario(scenario, set_, seed, p) for p in names}
    if not scenarios:
        raise UserError("--plants: name at least one plant")
    first = next(iter(scenarios.values()))
    where = out or Path("runs") / f"{first.name}-compare"
    with _progress() as bar:
        result = fly_all(scenarios, where, force=force, overwrite=overwrite, progress=bar)
    if as_json:
        print(json.dumps(result.summary(), indent=2))
        return
    _print(scorecard(result.runs, f"{first.name}: {first.vehicles} vehicles, Ds {first.d_safe_m:g} m"))
    print("figures:")
    for figure in result.figures:
        print(f"  {figure}")


@app.command(epilog="Example: testbed figures --out figures")
def figures(
    out: Annotated[Path, typer.Option("--out", help="folder to write")],
    plant: Annotated[str, typer.Option("--plant", help="unicycle or jsbsim")] = "unicycle",
    kink: Annotated[bool, typer.Option("--kink", help="the kink study instead (some minutes)")] = False,
    onset: Annotated[bool, typer.Option("--onset", help="when overriding begins, instead")] = False,
    seeds: Annotated[int, typer.Option("--seeds", help="headings of the kink study")] = 20,
    workers: Annotated[int | None, typer.Option("--workers", help="processes; default one a core")] = None,
    set_: SetOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Redraw the paper's figures 2, 3 and 6, with errors at the published points; or --onset, --kink."""
    from testbed.report.tables import plain_table
    from testbed.studies.figures import make

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
        from testbed.store import plain

        print(json.dumps(plain(book.summary()), indent=2))
        return
    for title, rows in book.tables.items():
        _print(plain_table(title, rows))
    print(f"{len(book.files)} files in {out}")


@app.command(epilog="Example: testbed remedies paper-2-turn --set lookahead_m=10 --seeds 50")
def remedies(
    scenario: ScenarioArg,
    plant: PlantOption = "jsbsim",
    set_: SetOption = None,
    out: OutOption = None,
    seeds: SeedsOption = 20,
    first_seed: Annotated[int, typer.Option("--first-seed", help="the first of them")] = 1,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="fly only this remedy; may be repeated")
    ] = None,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """What restores the guarantee: remedies compared at equal seeds."""
    from testbed.studies.robustness import compare_remedies

    s = _scenario(scenario, [*STUDY_RATES, *(set_ or [])], None, plant)
    where = out or Path("runs") / f"{s.name}-remedies"
    chosen = range(first_seed, first_seed + _count(seeds))
    _study(compare_remedies(s, chosen, only or [], where, workers, overwrite), as_json)


@app.command(epilog="Example: testbed margin paper-2-turn --knob ds_buffer --target-rate 0.01")
def margin(
    scenario: ScenarioArg,
    knob: Annotated[str, typer.Option("--knob", help="ds_buffer, prediction, robust, issf or derate")],
    target_rate: Annotated[float, typer.Option("--target-rate", help="of runs that lose Ds")] = 0.01,
    plant: PlantOption = "jsbsim",
    set_: SetOption = None,
    out: OutOption = None,
    seeds: SeedsOption = 20,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """The smallest setting of a remedy that meets a violation rate, certified on fresh seeds."""
    from testbed.studies.robustness import margin as find

    s = _scenario(scenario, [*STUDY_RATES, *(set_ or [])], None, plant)
    where = out or Path("runs") / f"{s.name}-margin-{knob}"
    _study(find(s, knob, target_rate, _count(seeds), where, workers, overwrite), as_json)


@app.command(epilog="Example: testbed answer --airframes x8 --vehicles 2 --seeds 20")
def answer(
    airframes: Annotated[str, typer.Option("--airframes", help="names or folders")] = "x8,rascal",
    vehicles: Annotated[str, typer.Option("--vehicles", help="2, 20 or both")] = "2,20",
    out: OutOption = None,
    seeds: SeedsOption = 50,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Does the guarantee survive? Aircraft, numbers, weather and remedies in one table."""
    from testbed.studies.answer import FLEETS
    from testbed.studies.robustness import answer as find

    fleets = {str(n): n for n in FLEETS}
    asked = [v.strip() for v in vehicles.split(",")]
    if unknown := [v for v in asked if v not in fleets]:
        raise UserError(f"--vehicles {unknown[0]}: give 2, 20 or 2,20")
    names = [a.strip() for a in airframes.split(",") if a.strip()]
    where = out or Path("runs") / "answer"
    _study(find(names, [fleets[v] for v in asked], _count(seeds), where, workers, overwrite), as_json)


@app.command("list", epilog="Example: testbed list --json")
def list_(as_json: JsonOption = False) -> None:
    """The built-in scenarios."""
    from testbed.scenario import builtin, load

    rows = {name: load(name).description for name in builtin()}
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    for name, description in rows.items():
        print(f"{name}\n    {description}")


@app.command(epilog="Example: testbed schema > scenario.schema.json")
def schema() -> None:
    """The JSON Schema of scenario files."""
    from testbed.scenario import Scenario

    print(json.dumps(Scenario.model_json_schema(), indent=2))


def _count(seeds: int) -> int:
    if seeds < 1:
        raise UserError(f"--seeds {seeds}: give at least 1")
    return seeds


def _study(found: Found, as_json: bool) -> None:
    from testbed.report.tables import plain_table

    if as_json:
        from testbed.store import plain

        print(json.dumps(plain({"folder": str(found.folder), "rows": found.rows} | found.data), indent=2))
        return
    _print(plain_table(found.title, found.rows))
    for line in found.lines:
        print(line)
    print(f"tables and figures: {found.folder}")


def _scenario(source: str, overrides: list[str] | None, seed: int | None, plant: str | None) -> Scenario:
    from testbed.scenario import load

    extra = [f"seed={seed}"] if seed is not None else []
    extra += [f"plant={plant}"] if plant is not None else []
    return load(source, (overrides or []) + extra)


def _fly(s: Scenario, where: Path, force: bool, overwrite: bool) -> Run:
    from testbed.simulate import run as fly

    with _progress() as bar:
        return fly(s, where, force=force, overwrite=overwrite, progress=bar.track(s.plant))


def _progress():  # type: ignore[no-untyped-def]
    from testbed.report.progress import Progress

    return Progress()


def _print(table: object) -> None:
    from rich.console import Console

    Console().print(table)


def _others() -> None:
    """Commands that live beside this module."""
    from testbed import cli_aircraft

    app.add_typer(cli_aircraft.app, name="aircraft")
    app.command("tune", epilog=cli_aircraft.TUNE_EXAMPLES)(cli_aircraft.tune)


_others()


def main() -> None:
    """Entry point of the `testbed` command."""
    try:
        app(standalone_mode=True)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("interrupted; nothing half-written is left", file=sys.stderr)
        sys.exit(130)
