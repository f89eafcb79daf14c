"""`testbed range`: prints how far the vehicles of a scenario must know of each other."""

from __future__ import annotations

import json
import math

from testbed.cli.common import JsonOption, ScenarioArg, SetOption

EXAMPLE = "Example: testbed range paper-20-turn --set filter_dt_s=0.05"


def range_(scenario: ScenarioArg, set_: SetOption = None, as_json: JsonOption = False) -> None:
    """The least range with which every pair is safe, h >= 0, when its vehicles first know of each other.

    Nothing is flown. See docs/guide/range.md for the proof; [sensing] range_m sets a scenario's range.
    """
    from testbed.components.ranges import NONE, needed
    from testbed.scenario.scenario import load

    s = load(scenario, set_)
    due, said = needed(s), s.sensing.range_m
    finite = math.isfinite(due.range_m)
    if as_json:
        data = {
            "scenario": s.name,
            "needed_m": due.range_m if finite else None,
            "at_once_m": due.at_once if finite else None,
            "unseen_s": due.unseen_s,
            "vehicles": list(due.vehicles),
            "range_m": said,
        }
        print(json.dumps(data, indent=2))
        return
    if not due.vehicles:
        print("a single vehicle has no pair: no range is needed")
        return
    if not finite:
        print(NONE)
    else:
        who = " and ".join(map(str, due.vehicles))
        print(f"range that is enough: {due.range_m:.2f} m (vehicles {who} need most)")
        print(f"  known at once it would be {due.at_once:.2f} m; here a pair may be known")
        print(f"  {due.unseen_s:.3g} s after it was out of range: filter period, and age of what is known")
    if said is None:
        print("this scenario sets no range: vehicles know of each other however far apart")
    else:
        holds = finite and said >= due.range_m
        print(f"this scenario's range, {said:g} m, is {'enough' if holds else 'not enough'}")
