"""Puts an airframe under the autopilot and sensors that were asked for, with their parameters and lags."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from aircraft.airframes.schema import INVERTING, OTHERS, Airframe, identified
from aircraft.airframes.sensors import PRESETS, sensors_of
from aircraft.equations.catalogue import equations_of, file_of, flies_its_files, sha256_of
from aircraft.textfile import read_toml


def fitted_with(airframe: Airframe, asked: Sequence[str]) -> Airframe:
    """`airframe` under the autopilot and sensors asked for after an @, or its own; its name says which.

    The parameters are the autopilot's defaults, what the airframe says of that autopilot in
    FOLDER/autopilots/AUTOPILOT.toml, and for its own autopilot what airframe.toml says. Lags are those
    identified under just this autopilot and these sensors.
    Raises  ValueError naming what there is not, or the file and what is wrong with it
    """
    presets = [a for a in asked if a in PRESETS]
    others = [a for a in asked if a not in PRESETS]
    if len(others) > 1 or len(presets) > 1:
        raise ValueError(f"{airframe.name}@{'@'.join(asked)}: name one autopilot and one set of sensors")
    if airframe.gains_file is not None and not asked:
        return airframe  # its base is fitted already, and the file's parameters are on top
    changes: dict[str, Any] = {"variant": ""}
    if others and others[0] != airframe.autopilot:
        changes |= {"autopilot": others[0], "parameters": {}, "step_factor": 1.0, "identified": None}
        changes["variant"] += f"@{others[0]}"
    if presets and PRESETS[presets[0]] != sensors_of(airframe.sensors):
        changes |= {"sensors": {"preset": presets[0]}, "identified": None}
        changes["variant"] += f"@{presets[0]}"
    if airframe.gains_file is not None and "autopilot" not in changes:
        # Other sensors only: parameters stay the file's, lags under these sensors are not known.
        changes["variant"] = airframe.variant + changes["variant"]
        found = airframe.model_copy(update=changes)
    else:
        found = airframe.model_copy(update=changes) if changes["variant"] else airframe
        if found.variant:
            found = found.model_copy(update=_said(found))
    if found.autopilot == INVERTING and flies_its_files(found):
        return found
    known = equations_of(found).parameters
    if unknown := sorted(found.parameters.keys() - known.keys()):
        raise ValueError(
            f"{airframe.folder}: parameters.{unknown[0]}: {found.autopilot} has no such parameter;"
            f" see: testbed aircraft autopilot {found.argument} --parameters"
        )
    after: dict[str, Any] = {"parameters": {name: p.default for name, p in known.items()} | found.parameters}
    suffix = found.fit.removeprefix(INVERTING)
    after["name"] = airframe.name + (suffix if suffix.startswith("@") or not suffix else f"@{suffix}")
    if not file_of(found).is_relative_to(found.folder):
        after["equations_sha256"] = sha256_of(found)
    return found.model_copy(update=after)


def _said(airframe: Airframe) -> dict[str, Any]:
    """What the airframe's folder says of this autopilot and these sensors: parameters, identified lags."""
    found: dict[str, Any] = {}
    folder = airframe.folder / OTHERS
    other = airframe.autopilot.removesuffix(".eq")
    for name in dict.fromkeys((other, airframe.fit)):
        path = folder / f"{name}.toml"
        tables = _tables(path)
        if name == other and "parameters" in tables and airframe.variant.startswith(f"@{airframe.autopilot}"):
            found["parameters"] = tables["parameters"]
        if name == airframe.fit and "identified" in tables:
            found["identified"] = tables["identified"]
    return found


def _tables(path: Path) -> dict[str, Any]:
    """[parameters] and [identified] of a file beside an airframe. Raises ValueError naming what is wrong."""
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
            found[key] = {k: float(v) for k, v in value.items()}
        elif key == "identified":
            found[key] = identified(value)
        else:
            raise ValueError(f"{path}: {key}: unknown; there are [parameters] and [identified]")
    return found
