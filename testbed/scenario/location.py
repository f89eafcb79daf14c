"""Finds airframes that a scenario names by relative paths, whatever the working directory.

The path stays in `airframes` as it was written; `airframes_folder` says where it starts. That folder is no
part of what a run is: names of runs leave it out, and a run folder has it relative to itself.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from testbed.scenario.track_file import with_tracks

FIELD = "airframes_folder"


def placed(data: Mapping[str, Any], *homes: Path) -> dict[str, Any]:
    """Plain data whose relative airframes start from the first of `homes` that has one of them.

    Tracks that it names are read, and then are in it.
    """
    made, said = with_tracks(dict(data), homes), data.get(FIELD)
    if isinstance(said, str) and said:
        made[FIELD] = (homes[0].absolute() / said).resolve().as_posix()
        return made
    names = list(relative(_named(data)))
    for home in homes:
        if any((home / split(name)[0]).exists() for name in names):
            made[FIELD] = home.resolve().as_posix()
            return made
    return made


def _named(data: Mapping[str, Any]) -> list[Any]:
    """What the scenario lists, and what its vehicles name."""
    listed, tables = data.get("airframes", []), data.get("vehicle", [])
    own = [v.get("airframe") for v in tables if isinstance(v, dict)] if isinstance(tables, list) else []
    return [*(listed if isinstance(listed, list) else []), *own]


def relative(airframes: Any) -> Iterable[str]:
    """The airframes that are relative paths: neither names of the package's nor absolute."""
    from aircraft.airframes.schema import names

    listed = airframes if isinstance(airframes, list) else []
    known = names() if listed else []
    said = (a for a in listed if isinstance(a, str) and not Path(a).is_absolute())
    yield from (a for a in said if split(a)[0] not in known)


def split(airframe: str) -> tuple[str, tuple[str, ...]]:
    """An airframe's folder, and the autopilot asked for after an @."""
    from aircraft.airframes.naming import split as parts

    return parts(airframe)


def path_of(airframe: str, folder: str) -> str:
    """The path, or the name, by which an airframe of a scenario is loaded."""
    if folder and airframe in relative([airframe]) and (Path(folder) / split(airframe)[0]).exists():
        return str(Path(folder) / airframe)
    return airframe


def moved(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Plain data as a file in `folder` says it: its airframes' folder relative to that, where it can be."""
    if not data.get(FIELD):
        return dict(data)
    try:
        there = os.path.relpath(data[FIELD], folder.resolve())
    except ValueError:  # on another drive
        return dict(data)
    return dict(data) | {FIELD: Path(there).as_posix()}


def identity(data: Mapping[str, Any]) -> dict[str, Any]:
    """Plain data without what does not change a run: where its airframes lie. Their files are hashed."""
    return {name: value for name, value in data.items() if name != FIELD}
