"""Reads ArduPilot's .param and QGroundControl's .params files as parameters of an autopilot's equations.

ArduPilot's files have a name and a value in a line, with a comma, a tab or spaces between; QGroundControl's
have vehicle, component, name, value and type between tabs. Older names of ArduPlane are converted.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from aircraft.equations.language import Parameter
from aircraft.textfile import read_text

# Older names of ArduPlane: today's name, and what the value is multiplied by.
_RENAMED = {
    "LIM_ROLL_CD": ("ROLL_LIMIT_DEG", 0.01),
    "LIM_PITCH_MAX": ("PTCH_LIM_MAX_DEG", 0.01),
    "LIM_PITCH_MIN": ("PTCH_LIM_MIN_DEG", 0.01),
    "ARSPD_FBW_MIN": ("AIRSPEED_MIN", 1.0),
    "ARSPD_FBW_MAX": ("AIRSPEED_MAX", 1.0),
    "RLL2SRV_IMAX": ("RLL_RATE_IMAX", 1.0 / 4500.0),
    "PTCH2SRV_IMAX": ("PTCH_RATE_IMAX", 1.0 / 4500.0),
}


@dataclass
class ParameterFile:
    """What a file gives an autopilot: name -> value; what was converted; what its loops have no use for."""

    path: Path
    values: dict[str, float] = field(default_factory=dict)
    converted: list[str] = field(default_factory=list)
    near: dict[str, str] = field(default_factory=dict)  # a name that may be misspelt -> the parameter's
    unused: list[str] = field(default_factory=list)
    unusual: list[str] = field(default_factory=list)  # outside the parameter's usual range
    on_defaults: dict[str, float] = field(default_factory=dict)  # values, and the defaults of what is missing


def read_parameters(path: Path, known: Mapping[str, Parameter]) -> ParameterFile:
    """The parameters of a file for equations that have `known` ones.

    Raises  FileNotFoundError; ValueError naming file, line and cause, or a file that has none of them
    """
    try:
        said = _lines(read_text(path))
    except FileNotFoundError:
        raise FileNotFoundError(f"parameter file {path} does not exist") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    found = ParameterFile(path)
    rest = dict(said)
    for name in known.keys() & said.keys():
        found.values[name] = rest.pop(name)
    for axis in ("RLL", "PTCH"):
        _older_rate(found, rest, said, axis, known)
    for old, (new, factor) in _RENAMED.items():
        if old in rest and new in known:
            value = rest.pop(old) * factor
            if new not in found.values:
                found.values[new] = value
                found.converted.append(f"{old} as {new} = {value:.6g}")
    missing = [name for name in known if name not in found.values]
    for name in rest:
        near = difflib.get_close_matches(name, missing, 1, 0.9)
        if near:
            found.near[name] = near[0]
    found.unused = sorted(rest.keys() - found.near.keys())
    found.values = {name: found.values[name] for name in known if name in found.values}
    if not found.values:
        raise ValueError(
            f"{path}: none of its {len(said)} parameters is one of this autopilot's, such as"
            f" {', '.join(list(known)[:3])}; is it a file of another autopilot?"
        )
    found.on_defaults = {name: p.default for name, p in known.items()} | found.values
    for name, value in found.values.items():
        low, high = known[name].low, known[name].high
        if low is not None and high is not None and value and not low <= value <= high:
            found.unusual.append(f"{name} = {value:g}, usual {low:g} to {high:g} {known[name].unit}".rstrip())
    return found


def _lines(text: str) -> dict[str, float]:
    """name -> value of every line. Raises ValueError naming the line that is neither."""
    said: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        words = [w for w in re.split(r"[\s,]+", line) if w]
        if len(words) == 5 and words[0].isdigit() and words[1].isdigit():
            words = words[2:4]
        if len(words) < 2 or not re.fullmatch(r"[A-Z][A-Z0-9_]*", words[0]):
            raise ValueError(f"line {number}: not a parameter and its value: {line[:60]}")
        try:
            value = float(words[1])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"line {number}: {words[0]}: not a number: {words[1][:40]}")
        said[words[0]] = value
    return said


def _older_rate(
    found: ParameterFile,
    rest: dict[str, float],
    said: Mapping[str, float],
    axis: str,
    known: Mapping[str, Parameter],
) -> None:
    """Gains of ArduPlane before its rate controllers: P, I, D of an error in angle, converted as it does."""
    old = [f"{axis}2SRV_{x}" for x in "PID"]
    if f"{axis}_RATE_FF" not in known or not any(name in said for name in old):
        return
    usual = {"P": 1.0, "I": 0.3, "D": 0.08}
    p, i, d = (said.get(name, usual[name[-1]]) for name in old)
    for name in old:
        rest.pop(name, None)
    if f"{axis}_RATE_FF" in said:  # the file has today's gains as well: they count
        return
    t = said.get(f"{axis}2SRV_TCONST", known[f"{axis}2SRV_TCONST"].default)
    gains = {"FF": (p - i * t) * t - d, "P": d, "I": i * t, "D": 0.0}
    for name, value in gains.items():
        found.values[f"{axis}_RATE_{name}"] = value
    found.converted.append(
        f"{axis}2SRV_P, _I, _D as " + ", ".join(f"{axis}_RATE_{n} = {v:.4g}" for n, v in gains.items())
    )
