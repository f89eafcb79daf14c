"""`testbed margin`: finds the smallest setting of a remedy that meets a violation rate."""

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

EXAMPLE = "Example: testbed margin paper-2-turn --knob ds_buffer --target-rate 0.01"


def margin(
    scenario: ScenarioArg,
    knob: Annotated[str, typer.Option("--knob", help="ds_buffer, prediction, robust, issf or derate")],
    target_rate: Annotated[
        float, typer.Option("--target-rate", help="largest share of runs that may lose Ds")
    ] = 0.01,
    plant: PlantOption = "jsbsim",
    set_: SetOption = None,
    parts: PartsOption = None,
    out: OutOption = None,
    seeds: SeedsOption = 20,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Find the smallest setting of a remedy that meets a violation rate, and certify it on fresh seeds."""
    from testbed.studies.margin.study import margin as find

    s = scenario_of(scenario, [*STUDY_RATES, *(set_ or [])], None, plant)
    own = parts_of(parts)
    where = out or Path("runs") / folder_name(s, own, "margin", knob)
    show_study(find(s, knob, target_rate, count(seeds), where, workers, overwrite, own), as_json)
