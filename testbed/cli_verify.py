"""`testbed verify`: h and every verdict again from the recorded positions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli_common import JsonOption, show

EXAMPLE = "Example: testbed verify runs/demo/jsbsim"
ANSWERS = {True: "agrees", False: "DIFFERS", None: "not checked"}


def verify(
    run: Annotated[Path, typer.Argument(help="a run's folder")],
    as_json: JsonOption = False,
) -> None:
    """Work out h and the verdicts of a finished run anew, from its positions and by other formulas.

    Exit code 1 if anything differs or a file was changed, 2 if the folder cannot be read or lacks rows.
    """
    from testbed.verification.check import verify as check

    findings = check(run)
    wrong = [f.what for f in findings if f.agrees is False]
    if as_json:
        print(
            json.dumps(
                {"run": str(run), "agrees": not wrong, "findings": [vars(f) for f in findings]}, indent=2
            )
        )
    else:
        from testbed.report.tables import plain_table

        rows = [
            {"": f.what, "the run says": f.said, "we find": f.own, "so it": ANSWERS[f.agrees]}
            for f in findings
        ]
        show(plain_table(f"{run}", rows))
        print(f"differs: {', '.join(wrong)}" if wrong else "everything checked agrees")
    if wrong:
        raise typer.Exit(1)
