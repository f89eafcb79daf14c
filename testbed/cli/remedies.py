"""`testbed remedies`: flies remedies at equal seeds and says which of them keep the guarantee."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import (
    STUDY_RATES,
    JsonOption,
    OutOption,
    OverwriteOption,
    PartsOption,
    PlantOption,
    ScenarioArg,
    SeedsOption,
    SetOption,
    WorkersOption,
    count,
    folder_name,
    parts_of,
    scenario_of,
    show_study,
)

EXAMPLE = "Example: testbed remedies paper-2-turn --set lookahead_m=10 --seeds 50"


def remedies(
    scenario: ScenarioArg,
    plant: PlantOption = "jsbsim",
    set_: SetOption = None,
    parts: PartsOption = None,
    out: OutOption = None,
    seeds: SeedsOption = 20,
    first_seed: Annotated[int, typer.Option("--first-seed", help="the seed of the first run")] = 1,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="fly only this remedy; may be repeated")
    ] = None,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fly remedies at equal seeds and say how often each loses Ds, and what it costs."""
    from testbed.studies.remedies.study import compare

    s = scenario_of(scenario, [*STUDY_RATES, *(set_ or [])], None, plant)
    own = parts_of(parts)
    where = out or Path("runs") / folder_name(s, own, "remedies")
    chosen = range(first_seed, first_seed + count(seeds))
    show_study(compare(s, chosen, only or [], where, workers, overwrite, own), as_json)
