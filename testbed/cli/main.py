"""Puts the commands together. Every mistake of a person ends in one line on stderr and exit code 2."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from testbed.cli import (
    adopt,
    aircraft_log,
    answer,
    benchmark,
    campaign,
    compare,
    encounters,
    export,
    falsify,
    figures,
    ledger,
    margin,
    measures,
    rare,
    regress,
    remaking,
    remedies,
    run,
    schema,
    tune,
    verify,
)
from testbed.cli import describe as cli_describe
from testbed.cli import list as list_
from testbed.cli import range as cli_range
from testbed.cli import report as cli_report
from testbed.cli.interrupts import ending

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
        from testbed.components.versions import versions

        print("\n".join(f"{name} {version}" for name, version in versions().items()))
        raise typer.Exit


@app.callback()
def testbed(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_version,
            is_eager=True,
            help="print versions of the testbed and of its packages",
        ),
    ] = False,
) -> None:
    """Options of the program itself."""


def _add(name: str, command: Callable[..., None], example: str, said: str) -> None:
    app.command(name, short_help=said, epilog=example)(command)


# In the order of --help.
_add("run", run.run, run.EXAMPLE, "Fly one scenario on one plant and judge it.")
_add("compare", compare.compare, compare.EXAMPLE, "Fly one scenario on several plants, or up the ladder.")
_add("list", list_.list_, list_.EXAMPLE, "List the built-in scenarios.")
_add("schema", schema.schema, schema.EXAMPLE, "Print every field of a scenario file.")
_add("range", cli_range.range_, cli_range.EXAMPLE, "Print how far vehicles must know of each other.")
_add("figures", figures.figures, figures.EXAMPLE, "Redraw the paper's figures, with errors.")
_add("remedies", remedies.remedies, remedies.EXAMPLE, "Compare remedies at equal seeds.")
_add("margin", margin.margin, margin.EXAMPLE, "Find the smallest setting of a remedy that is enough.")
_add("answer", answer.answer, answer.EXAMPLE, "Tabulate whether the guarantee survives.")
remaking.app.command("describe", short_help="An airframe's datasheet.", epilog=cli_describe.EXAMPLES)(
    cli_describe.describe
)
remaking.app.command(
    "linear", short_help="The linear model for python-control or MATLAB.", epilog=cli_describe.LINEAR_EXAMPLES
)(cli_describe.linear)
remaking.app.command(
    "log", short_help="Lags of a flight log, beside the simulated aircraft.", epilog=aircraft_log.EXAMPLES
)(aircraft_log.log)
remaking.app.command(
    short_help="Any JSBSim aircraft, flying under an autopilot.",
    epilog="Examples: testbed aircraft adopt c172p; testbed aircraft adopt my-models/glider --out my-glider;"
    " exit code 0 good, 1 flies with remarks or refused, 2 bad input",
)(adopt.adopt)
app.add_typer(remaking.app, name="aircraft")
_add("tune", tune.tune, tune.TUNE_EXAMPLES, "Score, sweep or optimise an airframe's gains.")
_add("report", cli_report.report, cli_report.EXAMPLE, "Write one HTML page of what other commands wrote.")
_add("export", export.export, export.EXAMPLE, "Convert a run for Tacview, or to CSV.")
_add("ledger", ledger.ledger, ledger.EXAMPLE, "Compare predicted and realised hdot of a run.")
_add("measures", measures.measures, measures.EXAMPLES, "Measure runs as safety cases do; risk ratios.")
app.add_typer(encounters.app, name="encounters")
_add("benchmark", benchmark.benchmark, benchmark.EXAMPLES, "Compare filters in sets of encounters.")
app.add_typer(regress.app, name="regress")
app.add_typer(campaign.app, name="campaign")
_add("falsify", falsify.falsify, falsify.EXAMPLES, "Search for a violation, and shrink it.")
_add("rare", rare.rare, rare.EXAMPLES, "Estimate the probability of a rare event over random starts.")
_add("verify", verify.verify, verify.EXAMPLE, "Compute a run's verdicts again from its positions.")


def main() -> None:
    """Entry point of the `testbed` command."""
    ending(app)
