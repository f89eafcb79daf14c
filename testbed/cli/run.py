"""`testbed run`: flies one scenario on one plant, judges it and writes a run folder."""

from __future__ import annotations

import json
from pathlib import Path

from testbed.cli.common import (
    ForceOption,
    JsonOption,
    OutOption,
    OverwriteOption,
    PartsOption,
    PlantOption,
    ScaleOption,
    ScenarioArg,
    SeedOption,
    SetOption,
    fly_into,
    folder_name,
    parts_of,
    scenario_of,
    show,
)

EXAMPLE = (
    "Examples: testbed run paper-2-turn --plant jsbsim --set d_safe_m=8 --out runs/wide;"
    " testbed run paper-2-turn --parts 'my_parts.py:Cone(gain=2)'"
)


def run(
    scenario: ScenarioArg,
    plant: PlantOption = None,
    set_: SetOption = None,
    seed: SeedOption = None,
    parts: PartsOption = None,
    scale: ScaleOption = False,
    out: OutOption = None,
    force: ForceOption = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fly one scenario on one plant, judge it, and write a run folder."""
    from testbed.records.checksums import plain
    from testbed.report.tables import scorecard
    from testbed.studies.common.found import titled

    s = scenario_of(scenario, set_, seed, plant, scale)
    own = parts_of(parts)
    where = out or Path("runs") / folder_name(s, own, s.plant)
    result = fly_into(s, where, force, overwrite, own)
    if as_json:
        print(json.dumps({"run": str(where), "guarantees": plain(result.guarantees)}, indent=2))
        return
    show(scorecard({result.part("plant") or s.plant: result}, titled(s, own)))
    print(f"run folder: {where}")
