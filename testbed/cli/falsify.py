"""`testbed falsify`: searches for a violation within bounds, and shrinks it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.claims.registry import FENCE_CLEARANCE, SAFE_SET, SEPARATION, SEPARATION_INTRUDERS
from testbed.cli.common import (
    JsonOption,
    OutOption,
    OverwriteOption,
    PartsOption,
    PlantOption,
    ScenarioArg,
    SetOption,
    WorkersOption,
    folder_name,
    parts_of,
    scenario_of,
    show_study,
)
from testbed.errors import UserError

EXAMPLES = (
    "Examples: testbed falsify paper-20-turn --budget 200;"
    " testbed falsify paper-2-turn --requirement 'always[0,20](distance_m > 5) and"
    " eventually[0,20](goal_distance_m < 20)';"
    " testbed falsify paper-2-turn --plant jsbsim --set filter_dt_s=0.05 --set ds_buffer_m=2 --wind 8"
)
GUARANTEES = (SEPARATION.id, SEPARATION_INTRUDERS.id, SAFE_SET.id, FENCE_CLEARANCE.id)


def falsify(
    scenario: ScenarioArg,
    budget: Annotated[
        int, typer.Option("--budget", help="largest number of runs of the search, and of the shrinking")
    ] = 200,
    guarantee: Annotated[
        str | None,
        typer.Option("--guarantee", help=f"{' or '.join(GUARANTEES)}; default {SEPARATION.id}"),
    ] = None,
    requirement: Annotated[
        str | None,
        typer.Option(
            "--requirement",
            metavar="FORMULA",
            help="instead of a guarantee, signal temporal logic over run columns:"
            " 'always[0,20](distance_m > 5)'",
        ),
    ] = None,
    lateral: Annotated[
        float | None, typer.Option("--lateral", help="largest offset of each start, m; default 10")
    ] = None,
    heading: Annotated[
        float | None, typer.Option("--heading", help="largest change of each first course, deg; default 5")
    ] = None,
    height: Annotated[
        float | None, typer.Option("--height", help="largest height change of each start, m; default 1")
    ] = None,
    wind: Annotated[float, typer.Option("--wind", help="largest wind added to the scenario's, m/s")] = 5.0,
    latency: Annotated[
        float, typer.Option("--latency", help="largest link delay added to the scenario's, s")
    ] = 0.1,
    seed: Annotated[int, typer.Option("--seed", help="seed of the search; the runs have the scenario's")] = 1,
    thorough: Annotated[
        bool,
        typer.Option("--thorough", help="spend the whole budget on the smallest margin, violated or not"),
    ] = False,
    plant: PlantOption = None,
    set_: SetOption = None,
    parts: PartsOption = None,
    out: OutOption = None,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Search starts, headings, wind and delay for a violation; shrink it; write it as a scenario file.

    --lateral, --heading, --height, --wind and --latency bound the departures, 0 leaves one out. A scenario's
    own random perturbations of starts stand in for the defaults; they are searched, not drawn.
    """
    from contextlib import nullcontext

    from testbed.campaigns.executor import executor
    from testbed.records.store import check_free
    from testbed.requirements.requirement import Requirement, recorded_at_every_step
    from testbed.studies.falsify.falsify import falsify as search
    from testbed.studies.falsify.flights import Flights
    from testbed.studies.falsify.space import Space, bounds
    from testbed.studies.falsify.study import write

    s = scenario_of(scenario, set_, None, plant)
    own = parts_of(parts)
    where = out or Path("runs") / folder_name(s, own, "falsify")
    check_free(where, overwrite)
    if budget < 1:
        raise UserError(f"--budget {budget}: give at least 1")
    if requirement is not None:
        if guarantee is not None:
            raise UserError("--requirement and --guarantee: give one of the two")
        Requirement(requirement).check(s)
        s = recorded_at_every_step(s)
    guarantee = guarantee or SEPARATION.id
    if guarantee not in GUARANTEES:
        raise UserError(f"--guarantee {guarantee}: give {' or '.join(GUARANTEES)}")
    if guarantee == FENCE_CLEARANCE.id and not s.fence:
        raise UserError(f"--guarantee {guarantee}: {s.name} has no [[fence]] table")
    space = Space.of(s, bounds(s, lateral, heading, height, wind, latency))
    with nullcontext() if workers == 1 else executor(workers) as pool:
        result = search(Flights(space, requirement or guarantee, budget, pool, parts=own), seed, thorough)
    show_study(write(result, where, overwrite, parts or []), as_json)
