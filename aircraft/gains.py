"""Gains: what the autopilot needs of an airframe, and files of gains that stand for an airframe."""

from __future__ import annotations

import ast
from functools import cache

from aircraft.airframe import Airframe
from aircraft.autopilot import EQUATIONS, Equations, parse


@cache
def equations() -> Equations:
    return parse(EQUATIONS.read_text(encoding="utf-8"))


# Sections whose gains multiply an error or are a time: below zero they destabilise.
_NOT_NEGATIVE = ("turn", "climb", "speed", "rudder")


def gain_faults(airframe: Airframe) -> list[str]:
    """What is wrong with an airframe's gains, a line each: missing, unknown, negative where none may be."""
    mine = equations().of(airframe.gain_values())
    known = {*mine.assigned(), *mine.inputs, *mine.uses}
    trees = [ast.parse(e.formula, mode="eval") for c in mine.channels for e in c.equations]
    names = {n.id for tree in trees for n in ast.walk(tree) if isinstance(n, ast.Name)}
    calls = {n.func for tree in trees for n in ast.walk(tree) if isinstance(n, ast.Call)}
    functions = {f.id for f in calls if isinstance(f, ast.Name)}
    wanted, have = names - known - functions, airframe.gain_values()
    faults = [
        f"{n.replace('_', '.', 1)}: the autopilot needs this gain" for n in sorted(wanted - have.keys())
    ]
    faults += [
        f"{n.replace('_', '.', 1)}: the autopilot has no such gain" for n in sorted(have.keys() - wanted)
    ]
    for section in _NOT_NEGATIVE:
        for name, value in airframe.gains.get(section, {}).items():
            time = name.endswith(("filter_s", "model_lag_s"))
            if value < 0 or (time and value == 0):
                least = "positive" if time else "zero or more"
                faults.append(f"{section}.{name}: must be {least}, got {value:g}")
    return faults
