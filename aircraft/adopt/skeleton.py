"""An airframe.toml for a model of which nothing is known yet, and the writing of any airframe.toml."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from aircraft.airframes.reading import read_airframe
from aircraft.airframes.schema import Airframe, Speeds
from aircraft.airframes.setup import Engines, Setup
from aircraft.autopilots.gains import needed_gains
from aircraft.equations.catalogue import xml_of

SECTIONS = ("airframe", "level", "thrust", "envelope", "turn", "climb", "speed")
_ANY = 0.1


def skeleton(folder: Path, name: str, setup: Setup, engines: Engines, rudder: bool) -> Airframe:
    """Write airframe.toml and the autopilot with any gains, so that the model loads."""
    sections = (*SECTIONS, "rudder") if rudder else SECTIONS
    empty = Airframe.model_validate(
        {
            "name": name,
            "title": name,
            "model": name,
            "licence": "see README.md",
            "speeds": Speeds(v_min_mps=20.0, v_max_mps=40.0, start_mps=30.0, trim_mps=[30.0]),
            "surfaces": {},
            "setup": setup,
            "engines": engines,
            "gains": {section: {"none": _ANY} for section in sections},
            "folder": folder,
        }
    )
    gains: dict[str, dict[str, float]] = {section: {} for section in sections}
    for gain in sorted(needed_gains(empty)):
        section, _, key = gain.partition("_")
        gains[section][key] = _ANY
    made = empty.model_copy(update={"gains": gains})
    return write(made)


def write(airframe: Airframe, head: str = "", comments: Mapping[str, str] | None = None) -> Airframe:
    """Write airframe.toml and systems/autopilot.xml of an airframe; returns it as it is read from there.

    head      comment lines at the top;  comments  table -> comment line above it
    """
    dumped = airframe.model_dump(exclude_none=True, exclude_defaults=True)
    tables: dict[str, Any] = {}
    for key in ("name", "title", "model", "licence", "step_factor", "speeds", "surfaces", "setup", "engines"):
        if key in dumped:
            tables[key] = dumped[key]
    tables["surfaces"] = airframe.surfaces
    tables["gains"] = {s: {k: _short(v) for k, v in g.items()} for s, g in airframe.gains.items()}
    for key in ("identified", "stated"):
        if key in dumped:
            tables[key] = dumped[key]
    lines = []
    for line in tomli_w.dumps(tables).splitlines():
        if line.startswith("[") and (said := (comments or {}).get(line.strip("[]"))):
            lines.append(f"# {said}")
        lines.append(line)
    folder = airframe.folder
    (folder / "airframe.toml").write_text("\n".join([*head.splitlines(), *lines, ""]), encoding="utf-8")
    (folder / "systems").mkdir(exist_ok=True)
    written = read_airframe(folder)
    (folder / "systems" / "autopilot.xml").write_text(xml_of(written), encoding="utf-8")
    return written


def _short(value: float) -> float:
    """Six digits: more are noise."""
    return float(f"{value:.6g}")
