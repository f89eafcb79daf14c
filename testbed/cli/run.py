"""`testbed run`: flies one scenario on one plant, judges it and writes a run folder."""

from __future__ import annotations

import json
from pathlib import Path

from testbed.cli.common import (
    ForceOption,
    JsonOption,
    OutOption,
    OverwriteOption,
    PlantOption,
    ScenarioArg,
    SeedOption,
    SetOption,
    fly_into,
    scenario_of,
    show,
)

EXAMPLE = "Example: testbed run paper-2-turn --plant jsbsim --set d_safe_m=8 --out runs/wide"


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
