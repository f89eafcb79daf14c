"""The command line. Every mistake of a user's is one line on stderr and exit code 2."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli import aircraft, campaign, export, falsify, ledger, regress, studies, tune, verify
from testbed.cli import report as cli_report
from testbed.cli.common import (
    ForceOption,
    JsonOption,
    OutOption,
    OverwriteOption,
    PlantOption,
    ScenarioArg,
    SeedOption,
    SetOption,
    WorkersOption,
    count,
    display,
    fly_into,
    scenario_of,
    show,
    show_named,
    show_study,
    with_seed,
)
from testbed.cli.interrupts import ending
from testbed.errors import UserError

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Does a collision-avoidance guarantee proved on a unicycle survive on a real aeroplane?"
    " Start with: testbed compare paper-2-turn",
)


def _version(asked: bool) -> None:
    if asked:
        from testbed.components.catalogue import versions

        print("\n".join(f"{name} {version}" for name, version in versions().items()))
        raise typer.Exit


@app.callback()
def testbed(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="versions of this and of what it stands on"
        ),
    ] = False,
) -> None:
    """Options of the program itself."""


@app.command(
    short_help="One scenario on one plant, judged.",
    epilog="Example: testbed run paper-2-turn --plant jsbsim --set d_safe_m=8 --out runs/wide",
)
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
    from testbed.records.checksums import plain
    from testbed.report.tables import scorecard

    s = scenario_of(scenario, set_, seed, plant)
    where = out or Path("runs") / f"{s.name}-{s.plant}"
    result = fly_into(s, where, force, overwrite)
    if as_json:
        print(json.dumps({"run": str(where), "guarantees": plain(result.guarantees)}, indent=2))
        return
    show(scorecard({s.plant: result}, f"{s.name} on {s.plant}"))
    print(f"run folder: {where}")


@app.command(
    short_help="One scenario on several plants, or up the fidelity ladder.",
    epilog="Example: testbed compare paper-2-turn --plants unicycle,jsbsim --out runs/head-on",
)
def compare(
    scenario: ScenarioArg,
    plants: Annotated[
        str | None, typer.Option("--plants", help="plants to compare; default unicycle,jsbsim")
    ] = None,
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
    seeds: Annotated[
        int | None, typer.Option("--seeds", help="with --ladder: runs of each rung, from seed 1; default 20")
    ] = None,
    workers: WorkersOption = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="write report.html too")] = True,
) -> None:
    """Fly one scenario on several plants: a table of guarantees, and figures with the plants overlaid."""
    if ladder:
        if plants is not None:
            raise UserError("--plants: the ladder's rungs have their own; leave it out")
        if seed is not None:
            raise UserError("--seed: the ladder flies seeds from 1; say how many with --seeds")
        if force or not report:
            raise UserError("--force and --no-report: the ladder has neither; leave them out")
        from testbed.scenario.variants import load_base
        from testbed.studies.ladder.study import ladder as climb

        s = load_base(scenario, set_)
        where = out or Path("runs") / f"{s.name}-ladder"
        show_study(climb(s, count(20 if seeds is None else seeds), where, workers, overwrite), as_json)
        return
    if seeds is not None:
        raise UserError("--seeds: only --ladder flies several; --seed N is one run's")
    from testbed.report.tables import scorecard
    from testbed.scenario.variants import load_each
    from testbed.studies.comparison.comparison import compare as fly_all

    names = [p.strip() for p in (plants or "unicycle,jsbsim").split(",") if p.strip()]
    if not names:
        raise UserError("--plants: name at least one plant")
    scenarios = load_each(scenario, with_seed(set_, seed), names)
    first = next(iter(scenarios.values()))
    where = out or Path("runs") / f"{first.name}-compare"
    with display() as bar:
        result = fly_all(scenarios, where, force=force, overwrite=overwrite, progress=bar, report=report)
    if as_json:
        print(json.dumps(result.summary(), indent=2))
        return
    show(scorecard(result.runs, f"{first.name}: {first.vehicles} vehicles, Ds {first.d_safe_m:g} m"))
    print("figures:")
    for figure in result.figures:
        print(f"  {figure}")
    if report:
        print(f"report, with playback: {where / 'report.html'}")


@app.command("list", short_help="The built-in scenarios.", epilog="Example: testbed list --json")
def list_(as_json: JsonOption = False) -> None:
    """The built-in scenarios."""
    from testbed.scenario.scenario import builtin, load

    rows = {name: load(name).description for name in builtin()}
    show_named(rows, as_json)


@app.command(
    short_help="Every field of a scenario file.", epilog="Example: testbed schema > scenario.schema.json"
)
def schema(
    as_markdown: Annotated[
        bool, typer.Option("--markdown", help="the reference page of the guide instead")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="as JSON Schema, which is the default")] = False,
) -> None:
    """The JSON Schema of scenario files, or their reference as Markdown."""
    from testbed.scenario.scenario import Scenario

    if as_markdown and as_json:
        raise UserError("--markdown and --json: one at a time")
    if as_markdown:
        from testbed.scenario.reference_page import markdown

        print(markdown(), end="")
        return
    print(json.dumps(Scenario.model_json_schema(), indent=2))


# Commands that live beside this module.
app.add_typer(studies.app)
app.add_typer(aircraft.app, name="aircraft")
app.command("tune", short_help="An airframe's gains scored, swept, optimised.", epilog=tune.TUNE_EXAMPLES)(
    tune.tune
)
app.command(short_help="One HTML page of what other commands wrote.", epilog=cli_report.EXAMPLE)(
    cli_report.report
)
app.command("export", short_help="A run for Tacview, or as CSV.", epilog=export.EXAMPLE)(export.export)
app.command(short_help="Predicted against realised hdot of a run.", epilog=ledger.EXAMPLE)(ledger.ledger)
app.add_typer(regress.app, name="regress")
app.add_typer(campaign.app, name="campaign")
app.command(short_help="Search for a violation, and shrink it.", epilog=falsify.EXAMPLES)(falsify.falsify)
app.command(short_help="Whether a run's verdicts follow from its positions.", epilog=verify.EXAMPLE)(
    verify.verify
)


def main() -> None:
    """Entry point of the `testbed` command."""
    ending(app)
