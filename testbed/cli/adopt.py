"""The command `aircraft adopt`: any JSBSim aircraft, flying under the autopilot."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from testbed.errors import UserError


def adopt(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME|FOLDER",
            help="an aircraft that comes with JSBSim, a model's folder, or its file",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="folder to write; by default its name, here")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print the result as JSON")] = False,
) -> None:
    """Adopt any JSBSim aircraft: find its speeds, controls and derivatives, give it an autopilot, fly it."""
    from aircraft.adopt.command import adopted, default_folder
    from aircraft.adopt.failures import AdoptionError
    from aircraft.adopt.verdict import GOOD, REFUSED

    folder = default_folder(name) if out is None else out

    def say(what: str) -> None:
        print(f"{what} ...", file=sys.stderr, flush=True)

    try:
        verdict = adopted(name, folder, say)
    except AdoptionError as error:
        raise UserError(f"{name}: {error.reason}") from None
    except (FileExistsError, ValueError) as error:
        raise UserError(str(error)) from None
    except OSError as error:
        raise UserError(f"cannot write {folder}: {error.strerror}") from None
    if as_json:
        from dataclasses import asdict

        print(json.dumps({"folder": str(folder) if verdict.flies else None, **asdict(verdict)}, indent=2))
    elif verdict.kind == REFUSED:
        print(f"{name}: refused at {verdict.stage}: {'; '.join(verdict.remarks)}")
    else:
        print(f"{name}: {verdict.kind}")
        for remark in verdict.remarks:
            print(f"  {remark}")
        w = verdict.worst
        print(
            f"  worst overshoot {100 * w['overshoot']:.1f} %, final error {100 * w['final_error']:.1f} %,"
            f" disk margin {w['disk_margin']:.2f}"
        )
        print(f"{folder}: airframe.toml, README.md, the model and its autopilot")
        fly = f"--plant jsbsim --set \"airframes=['{folder}']\" --scale-to-airframe"
        print(f"next: testbed run paper-2-turn {fly}")
    if verdict.kind != GOOD:
        raise typer.Exit(1)
