"""`testbed compare`: flies one scenario with several plants, filters and guidance, or climbs the ladder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import (
    ForceOption,
    JsonOption,
    OutOption,
    OverwriteOption,
    PartsOption,
    ScaleOption,
    ScenarioArg,
    SeedOption,
    SetOption,
    WorkersOption,
    count,
    display,
    named,
    show,
    show_study,
    to_airframes,
    with_seed,
)
from testbed.errors import UserError

EXAMPLE = (
    "Example: testbed compare paper-2-turn --plants unicycle,jsbsim"
    " --filters centralised,my_parts.py:Cone,none --out runs/head-on"
)


def compare(
    scenario: ScenarioArg,
    plants: Annotated[
        str | None,
        typer.Option(
            "--plants",
            help="plants to compare; default unicycle,jsbsim; with --filters the scenario's",
        ),
    ] = None,
    filters: Annotated[
        str | None, typer.Option("--filters", help="filters to compare: centralised,my_parts.py:Cone,none")
    ] = None,
    guidance: Annotated[
        str | None, typer.Option("--guidance", help="guidance to compare: kinds, or FILE.py:NAME")
    ] = None,
    parts: PartsOption = None,
    set_: SetOption = None,
    seed: SeedOption = None,
    scale: ScaleOption = False,
    out: OutOption = None,
    force: ForceOption = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    ladder: Annotated[
        bool,
        typer.Option("--ladder", help="climb the fidelity ladder instead: lags, 6-DOF, weather, network"),
    ] = False,
    seeds: Annotated[
        int | None, typer.Option("--seeds", help="with --ladder: runs of each rung; default 20")
    ] = None,
    first_seed: Annotated[
        int | None, typer.Option("--first-seed", help="with --ladder: the seed of the first run; default 1")
    ] = None,
    autopilots: Annotated[
        bool,
        typer.Option(
            "--autopilots",
            help="with --ladder: rungs of sensing and autopilots: typical, arduplane, px4, poor",
        ),
    ] = False,
    workers: WorkersOption = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="write report.html too")] = True,
) -> None:
    """Fly one scenario with several plants, filters and guidance: one table, and figures with all overlaid.

    Every plant flies with every filter and every guidance that is named.
    """
    if ladder:
        for option, given in (
            ("plants", plants),
            ("filters", filters),
            ("guidance", guidance),
            ("parts", parts),
        ):
            if given is not None:
                raise UserError(f"--{option}: the ladder's rungs have their own; leave it out")
        if seed is not None:
            raise UserError("--seed: the ladder flies several; say how many with --seeds")
        if force or not report:
            raise UserError("--force and --no-report: the ladder has neither; leave them out")
        from testbed.scenario.variants import load_base
        from testbed.studies.ladder.study import ladder as climb

        s = load_base(scenario, set_)
        where = out or Path("runs") / f"{s.name}-{'autopilots' if autopilots else 'ladder'}"
        lowest = 1 if first_seed is None else first_seed
        chosen = range(lowest, lowest + count(20 if seeds is None else seeds))
        show_study(climb(s, chosen, where, workers, overwrite, autopilots=autopilots), as_json)
        return
    if autopilots:
        raise UserError("--autopilots: rungs of a --ladder; give both")
    if seeds is not None or first_seed is not None:
        raise UserError("--seeds and --first-seed: only --ladder flies several; --seed N is one run's")
    from testbed.report.tables import scorecard
    from testbed.studies.comparison.combinations import combinations
    from testbed.studies.comparison.comparison import compare as fly_all

    asked = {"plant": plants, "filter": filters, "guidance": guidance}
    found = combinations(scenario, with_seed(set_, seed), asked, named(parts))
    scenarios = {label: c.scenario for label, c in found.items()}
    if scale:
        scenarios = to_airframes(scenarios)
    own = {label: c.parts for label, c in found.items() if c.parts is not None}
    first = next(iter(scenarios.values()))
    where = out or Path("runs") / f"{first.name}-compare"
    with display() as bar:
        result = fly_all(
            scenarios, where, force=force, overwrite=overwrite, progress=bar, report=report, parts=own
        )
    if as_json:
        print(json.dumps(result.summary(), indent=2))
        return
    show(scorecard(result.runs, f"{first.name}: {first.vehicles} vehicles, Ds {first.d_safe_m:g} m"))
    print("figures:")
    for figure in result.figures:
        print(f"  {figure}")
    if report:
        print(f"report, with playback: {where / 'report.html'}")
