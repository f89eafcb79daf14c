"""`testbed measures`: volumes lost, interventions and cost of recorded runs; the risk ratio of a filter."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.cli.common import JsonOption, show
from testbed.errors import UserError

if TYPE_CHECKING:
    from testbed.measures.encounter_measures import Settings

EXAMPLES = (
    "Examples: testbed measures runs/head-on/unicycle; testbed measures runs/mine --against kind=none"
    " --nmac 15x4.6; testbed measures runs/filtered --against runs/unfiltered --cylinder ds=5x5"
)


def measures(
    folder: Annotated[Path, typer.Argument(help="a run folder, a campaign's, or a folder of run folders")],
    against: Annotated[
        str | None,
        typer.Option(
            "--against",
            metavar="FOLDER|COLUMN=VALUE",
            help="the same encounters without the filter: another folder, or cells of this campaign",
        ),
    ] = None,
    nmac: Annotated[
        str | None,
        typer.Option("--nmac", metavar="RxH", help="near mid-air collision: radius x half height, m"),
    ] = None,
    well_clear: Annotated[
        str | None, typer.Option("--well-clear", metavar="RxH", help="well clear; feet as 200x37.5ft")
    ] = None,
    cylinder: Annotated[
        list[str] | None,
        typer.Option("--cylinder", metavar="NAME=RxH", help="one more volume; may be repeated"),
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            "--threshold", help="share of a channel's range altered that is an intervention; default 0.05"
        ),
    ] = None,
    nuisance: Annotated[
        str,
        typer.Option("--nuisance", help="volume whose loss without the filter calls for intervention"),
    ] = "well_clear",
    as_json: JsonOption = False,
) -> None:
    """Measure recorded runs as safety cases do: lost volumes, severity, interventions, cost, arrivals.

    With --against it pairs encounters by seed (and file, and draws) and gives the risk ratio with an exact
    interval. A campaign with a table [measures] is read from its runs.parquet, others from the runs kept.
    """
    from testbed.errors import short
    from testbed.report.tables import plain_table
    from testbed.studies.risk.folders import read, split
    from testbed.studies.risk.study import against as beside
    from testbed.studies.risk.study import alone

    settings = _settings(nmac, well_clear, cylinder, threshold)
    flown, settings = read(folder, settings)
    if nuisance not in settings.cylinders and (against is not None and nuisance != "well_clear"):
        raise UserError(f"--nuisance {short(nuisance)}: give one of {', '.join(settings.cylinders)}")
    notes: list[str] = []
    if against is None:
        rows, data = alone(flown, settings)
    else:
        if Path(against).is_dir():
            others, _ = read(Path(against), settings)
        elif "=" in against:
            flown, others = split(flown, against)
        else:
            raise UserError(f"--against {short(against)}: no such folder, and no COLUMN=VALUE")
        rows, data, notes = beside(flown, others, settings, nuisance)
    volumes = {name: str(c) for name, c in settings.cylinders.items()}
    if as_json:
        print(json.dumps({"folder": str(folder), **settings.data(), "cells": data}, indent=2))
        return
    if not rows:
        raise UserError(f"{folder}: no run was flown, so that there is nothing to measure")
    show(plain_table(f"{folder}: " + "; ".join(f"{n} {c}" for n, c in volumes.items()), rows))
    for note in notes:
        print(note)
    if against is not None:
        print("risk ratio: rate with the filter over rate without, exact interval; docs/guide/measures.md")


def _settings(
    nmac: str | None, well_clear: str | None, more: list[str] | None, threshold: float | None
) -> Settings | None:
    """None where nothing was said."""
    from testbed.measures.cylinders import read
    from testbed.measures.encounter_measures import (
        DEFAULT_CYLINDERS,
        DEFAULT_THRESHOLD,
        NMAC,
        WELL_CLEAR,
        Settings,
    )

    if nmac is None and well_clear is None and not more and threshold is None:
        return None
    cylinders = dict(DEFAULT_CYLINDERS)
    for name, option, text in ((NMAC, "--nmac", nmac), (WELL_CLEAR, "--well-clear", well_clear)):
        if text is not None:
            cylinders[name] = read(text, option)
    for text in more or []:
        name, equals, size = text.partition("=")
        if not equals or not name.isidentifier():
            raise UserError(f"--cylinder {text}: give NAME=RADIUSxHALF-HEIGHT, as ds=5x5")
        cylinders[name] = read(size, f"--cylinder {name}")
    limit = DEFAULT_THRESHOLD if threshold is None else threshold
    if not 0.0 <= limit < 1.0:
        raise UserError(f"--threshold {limit:g}: give a share from 0 to below 1, such as 0.05")
    return Settings(cylinders, limit)
