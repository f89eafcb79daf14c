"""The command line. Every mistake of a user's is one line on stderr and exit code 2."""

from __future__ import annotations

from typing import Annotated

import typer

from testbed.cli import (
    aircraft,
    answer,
    campaign,
    compare,
    export,
    falsify,
    figures,
    ledger,
    margin,
    regress,
    remedies,
    run,
    schema,
    tune,
    verify,
)
from testbed.cli import list as list_
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


app.command(short_help="One scenario on one plant, judged.", epilog=run.EXAMPLE)(run.run)
app.command(short_help="One scenario on several plants, or up the fidelity ladder.", epilog=compare.EXAMPLE)(
    compare.compare
)
app.command("list", short_help="The built-in scenarios.", epilog=list_.EXAMPLE)(list_.list_)
app.command(short_help="Every field of a scenario file.", epilog=schema.EXAMPLE)(schema.schema)
app.command(short_help="The paper's figures, with errors.", epilog=figures.EXAMPLE)(figures.figures)
app.command(short_help="What restores the guarantee, at equal seeds.", epilog=remedies.EXAMPLE)(
    remedies.remedies
)
app.command(short_help="The smallest setting of a remedy that is enough.", epilog=margin.EXAMPLE)(
    margin.margin
)
app.command(short_help="The central table: does the guarantee survive?", epilog=answer.EXAMPLE)(answer.answer)
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
