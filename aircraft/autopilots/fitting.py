"""Puts an airframe under the autopilot that was asked for, with that autopilot's parameters and lags."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

from aircraft.airframes.schema import INVERTING, OTHERS, Airframe, identified
from aircraft.equations.catalogue import equations_of, file_of, flies_its_files, text_of
from aircraft.textfile import read_toml


def fitted_with(airframe: Airframe, asked: Sequence[str]) -> Airframe:
    """`airframe` under the autopilot asked for after an @, or its own; its name says which.

    The parameters are the autopilot's defaults, what the airframe says of that autopilot in
    FOLDER/autopilots/AUTOPILOT.toml, and for its own autopilot what airframe.toml says.
    Raises  ValueError naming what there is not, or the file and what is wrong with it
    """
    if len(asked) > 1:
        raise ValueError(f"{airframe.name}@{'@'.join(asked)}: name one autopilot")
    other = asked[0] if asked and asked[0] != airframe.autopilot else ""
    changes: dict[str, Any] = {}
    if other:
        changes |= {"autopilot": other, "variant": f"@{other}", "parameters": {}}
        changes |= {"identified": None, "step_factor": 1.0}
        changes |= _beside(airframe, other)
    found = airframe.model_copy(update=changes)
    if found.autopilot == INVERTING and not other:
        return found
    known = equations_of(found).parameters
    if unknown := sorted(found.parameters.keys() - known.keys()):
        raise ValueError(
            f"{airframe.folder}: parameters.{unknown[0]}: {found.autopilot} has no such parameter;"
            f" see: testbed aircraft autopilot {found.argument} --parameters"
        )
    parameters = {name: p.default for name, p in known.items()} | found.parameters
    after: dict[str, Any] = {"parameters": parameters}
    if found.autopilot != INVERTING:
        after["name"] = f"{airframe.name}@{found.autopilot.removesuffix('.eq')}"
    if not flies_its_files(found) and not file_of(found).is_relative_to(found.folder):
        after["equations_sha256"] = hashlib.sha256(text_of(found).encode()).hexdigest()
    return found.model_copy(update=after)


def _beside(airframe: Airframe, autopilot: str) -> dict[str, Any]:
    """What the airframe's folder says of an autopilot that is not its own: parameters, identified lags."""
    path = airframe.folder / OTHERS / f"{autopilot.removesuffix('.eq')}.toml"
    try:
        tables = read_toml(path)
    except FileNotFoundError:
        return {}
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    found: dict[str, Any] = {}
    for key, value in tables.items():
        if key == "parameters" and isinstance(value, dict):
            wrong = [k for k, v in value.items() if isinstance(v, bool) or not isinstance(v, int | float)]
            if wrong:
                raise ValueError(f"{path}: parameters.{wrong[0]}: must be a number")
            found["parameters"] = {k: float(v) for k, v in value.items()}
        elif key == "identified":
            found["identified"] = identified(value)
        else:
            raise ValueError(f"{path}: {key}: unknown; there are [parameters] and [identified]")
    return found
