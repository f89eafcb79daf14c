"""`testbed run`: flies one scenario on one plant, judges it and writes a run folder."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from testbed.scenario.scenario import Scenario

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
    for line in _lags(s):
        print(textwrap.fill(line, 80))
    print(f"run folder: {where}")


# Beyond this a pose predicted by the speed's lag lies so far ahead that Ds was lost: docs/guide/answer.md.
_SLOW_S = 2.0


def _lags(s: Scenario) -> list[str]:
    """The lags by which the filter predicts poses, of each airframe under its autopilot and sensors."""
    from testbed.components import catalogue

    if not s.remedy.predict_lags or s.plant != "jsbsim":
        return []
    named = dict(zip((a.name for a in catalogue.airframes(s)), catalogue.lags(s), strict=True))
    lines = []
    for name, lags in named.items():
        channels = zip(("v", "omega", "zeta"), lags, strict=True)
        each = ", ".join(f"{c} {x.time_constant_s:.2f} + {x.delay_s:.2f} s" for c, x in channels)
        lines.append(f"poses of {name} predicted by time constant + delay: {each}")
        if lags[0].time_constant_s + lags[0].delay_s > _SLOW_S:
            lines.append(
                "its speed follows too slowly for that: such poses lie too far ahead, and Ds was lost with"
                " them; on the X8 remedy.prediction_s = 0.8 in place of remedy.predict_lags kept it"
            )
    return lines
