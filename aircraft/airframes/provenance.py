"""Fingerprints of what derived numbers were made from: identified lags and fitted feed-forward.

A fingerprint covers the model and the gains and speeds of airframe.toml that enter. The model is its XML as
JSBSim reads it, without comments and layout, with [setup] and [engines]. A fingerprint does not cover names,
sources or [identified] itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from aircraft.airframes.files import read_folder
from aircraft.airframes.schema import INVERTING, Airframe, property_name
from aircraft.airframes.setup import Engines, Setup
from aircraft.airframes.xml import Element

# Gains that `testbed aircraft trim` fits, and those that the fit uses.
FITTED = (
    "cl_0",
    "cl_alpha",
    "cd_0",
    "cd_1",
    "cd_2",
    "elevator_0_rad",
    "elevator_per_alpha",
    "elevator_per_alpha2",
)
_USED = ("mass_kg", "wing_area_m2", "thrust_area_share", "motor_speed_mps", "elevator_norm_rad")
_AUTOPILOT = "systems/autopilot.xml"
_PROSE = {"fileheader", "documentation", "description", "note", "author", "license", "reference", "email"}
_DIGITS = 8  # hexadecimal, of each half


def identified_fingerprint(airframe: Airframe) -> str:
    """Fingerprint of what lags are identified with: gains, step speeds and autopilot, "-", the model."""
    files = _files(airframe)
    autopilot, model = ([f for f in files if (f[0] == _AUTOPILOT) == wanted] for wanted in (True, False))
    gains: list[Any] = [autopilot, airframe.gains, airframe.speeds.model_dump(exclude_none=True)]
    if airframe.autopilot != INVERTING or airframe.variant or airframe.sensors:
        what = [airframe.fit, airframe.equations_sha256, _own_equations(airframe), airframe.parameters]
        what.append(airframe.sensors)
        gains = [*what, *gains[1:]]
    return f"{_digest(gains)}-{_digest(model)}"


def _own_equations(airframe: Airframe) -> str:
    path = airframe.folder / airframe.autopilot
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""


def fitted_fingerprint(airframe: Airframe) -> str:
    """Fingerprint of the fitted gains, and the gains and speeds that enter their fit, "-", the model."""
    known = airframe.gains.get("airframe", {})
    envelope = airframe.gains.get("envelope", {}).get("airspeed_min_mps")
    gains = {name: known.get(name) for name in (*FITTED, *_USED)}
    model = [f for f in _files(airframe) if f[0] != _AUTOPILOT]
    return f"{_digest([gains, envelope, airframe.speeds.v_max_mps])}-{_digest(model)}"


def differs(fingerprint: str, now: str) -> str | None:
    """What two fingerprints differ in: "gains", "model", or None."""
    if fingerprint == now:
        return None
    return "model" if fingerprint.partition("-")[0] == now.partition("-")[0] else "gains"


def _files(airframe: Airframe) -> list[list[Any]]:
    """The XML files that the model consists of, in order of their names, as nested lists; then what
    airframe.toml sets in the model."""
    tables: list[list[Any]] = []
    if airframe.setup != Setup() or airframe.engines != Engines():
        own = [t.model_dump(exclude_defaults=True) for t in (airframe.setup, airframe.engines)]
        tables.append(["airframe.toml", *own])
    # Defaults of gains in the autopilot are overwritten by airframe.toml whenever the model is loaded.
    gains = frozenset(property_name(name) for name in airframe.gain_values())
    folder, texts = airframe.folder, hashlib.sha256()
    for path in filter(Path.is_file, [folder / "airframe.toml", *sorted(folder.rglob("*.xml"))]):
        texts.update(str(path).encode() + b"\0" + path.read_bytes() + b"\0")
    trees = _trees(folder, texts.hexdigest(), gains)
    return [] if trees is None else [*trees, *tables]


@lru_cache(maxsize=32)
def _trees(folder: Path, texts: str, gains: frozenset[str]) -> list[list[Any]] | None:
    """The XML files as nested lists; None where airframe.toml cannot be read.

    texts  hash of the files' bytes: thousands of short runs ask for the same files, and parse them once
    """
    files, _ = read_folder(folder)
    return None if files is None else [[name, *_element(t, gains)] for name, t in sorted(files.trees.items())]


def _element(e: Element, gains: frozenset[str]) -> Iterator[Any]:
    yield e.name
    yield sorted((key, _plain(value)) for key, value in e.attributes.items())
    yield _plain(e.text)
    for child in e.children:
        default = child.name == "property" and "value" in child.attributes
        if child.name not in _PROSE and not (default and child.text in gains):
            yield list(_element(child, gains))


def _plain(text: str) -> list[str | float]:
    """The text as words and numbers, so that 0.5 and 0.50 are equal."""
    words: list[str | float] = []
    for word in text.split():
        try:
            words.append(float(word))
        except ValueError:
            words.append(word)
    return words


def _digest(content: list[Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:_DIGITS]
