"""Gains: what the autopilot needs of an airframe, and files of gains that stand for an airframe."""

from __future__ import annotations

import difflib
import json
import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from aircraft.airframes.schema import INVERTING, Airframe, Identified, check_gains, identified
from aircraft.equations.catalogue import equations_of
from aircraft.textfile import read_toml

_UNIT = r"(_(radps|per_s2?|s|mps2?|rad|m|kg))?"

# Sections whose gains multiply an error or are a time: below zero they destabilise.
_NOT_NEGATIVE = ("turn", "climb", "speed", "rudder")


@dataclass(frozen=True)
class GainFault:
    """What is wrong with one gain, section.name."""

    gain: str
    message: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.gain}: {self.message}"


def needed_gains(airframe: Airframe) -> set[str]:
    """The gains that the autopilot's equations use for this airframe, section_name."""
    return equations_of(airframe).of(airframe.gain_values()).needed()


def gain_faults(airframe: Airframe) -> list[GainFault]:
    """What is wrong with an airframe's gains: missing, unknown, negative where none may be."""
    try:
        wanted = needed_gains(airframe)
    except ValueError as error:
        return [GainFault("autopilot", str(error), "correct the equations, or name another autopilot")]
    have = airframe.gain_values().keys()
    # Beside another autopilot, gains of the inverting one may stay: x8 and x8@arduplane are one folder.
    unknown, faults = sorted(have - wanted) if airframe.autopilot == INVERTING else [], []
    for name in sorted(wanted - have):
        section, _, key = name.partition("_")
        if not difflib.get_close_matches(name, unknown, 1, 0.8):  # or it is there under another name
            remedy = f"add {key} to [gains.{section}]"
            faults.append(GainFault(f"{section}.{key}", "the autopilot needs this gain", remedy))
    for name in unknown:
        section, _, key = name.partition("_")
        near = difflib.get_close_matches(name, sorted(wanted - have), 1, 0.8)
        remedy = f"rename it to {near[0].partition('_')[2]}" if near else "remove it"
        faults.append(GainFault(f"{section}.{key}", "the autopilot has no such gain", remedy))
    for section in _NOT_NEGATIVE:
        for key, value in airframe.gains.get(section, {}).items():
            time = key.endswith(("filter_s", "model_lag_s"))
            if value < 0 or (time and value == 0):
                least = "positive" if time else "zero or more"
                remedy = f"write {-value:g}" if value else "write how long it takes, in s"
                faults.append(GainFault(f"{section}.{key}", f"must be {least}, got {value:g}", remedy))
    return faults


@dataclass(frozen=True)
class GainsFile:
    """A gains file as data: its base airframe, gains by section.name, and lags identified with them."""

    path: Path
    base: str
    gains: dict[str, float]
    identified: Identified | None


def read(path: Path) -> GainsFile:
    """A gains file. Raises FileNotFoundError, or ValueError naming the file and what is wrong with it."""
    try:
        tables = read_toml(path)
    except FileNotFoundError:
        raise FileNotFoundError(f"gains file {path} does not exist") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    name, gains = tables.get("base"), tables.get("gains")
    parameters = tables.get("parameters")
    if isinstance(parameters, dict) and gains is None:
        gains = {}
    if not isinstance(name, str) or not isinstance(gains, dict):
        raise ValueError(f'{path}: a gains file needs base = "NAME" and tables [gains.SECTION]')
    if name.endswith(".toml"):  # which could be this file itself
        raise ValueError(f"{path}: base: name an airframe, not another gains file")
    found: dict[str, float] = {}
    said = [("gains", section, values) for section, values in gains.items()] + [("", "", parameters)]
    for table, section, values in said:
        for gain, value in values.items() if isinstance(values, dict) else ():
            number = math.nan
            if isinstance(value, int | float) and not isinstance(value, bool):
                with suppress(OverflowError):  # an integer of hundreds of digits
                    number = float(value)
            if not math.isfinite(number):
                got = repr(value) if len(repr(value)) <= 80 else f"{repr(value)[:80]}..."
                where = f"{table}.{section}.{gain}" if table else f"parameters.{gain}"
                raise ValueError(f"{path}: {where}: must be a finite number, got {got}")
            found[f"{section}.{gain}" if section else gain] = number
    try:
        lags = identified(tables["identified"]) if "identified" in tables else None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return GainsFile(path, name, found, lags)


def on_top_of(base: Airframe, file: GainsFile) -> Airframe:
    """`base` with what a gains file says.

    Raises  ValueError naming the file and the gain that is unknown, out of range or missing
    """
    try:
        after = base.with_gains(file.gains)
        check_gains(after.gains)
    except KeyError as error:
        raise ValueError(f"{file.path}: {error.args[0]}") from None
    except ValueError as error:
        raise ValueError(f"{file.path}: {error}") from None
    if faults := gain_faults(after):
        raise ValueError(f"{file.path}: gains.{faults[0]}")
    lags = file.identified
    same = after.gains == base.gains and after.parameters == base.parameters
    if lags is None and same:  # else those of the base are of other gains
        lags = base.identified
    return after.model_copy(update={"identified": lags, "gains_file": file.path})


def write(path: Path, base: str, gains: Mapping[str, float], provenance: Mapping[str, str]) -> None:
    """A gains file: `gains` by section.name on top of airframe `base`, and where they come from.

    Equal inputs give equal bytes; no date.
    """
    lines = [
        "# Gains on top of those of an airframe; fly them with --gains FILE, or as a scenario's airframe."
    ]
    lines += [f"base = {json.dumps(base)}", "", "[provenance]"]
    lines += [f"{key} = {json.dumps(value)}" for key, value in provenance.items()]
    sections: dict[str, list[str]] = {}
    for key, value in gains.items():
        section, _, name = key.rpartition(".")
        sections.setdefault(section, []).append(f"{name} = {value!r}")
    for section, rows in sections.items():
        lines += ["", f"[gains.{section}]" if section else "[parameters]", *rows]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def resolve(airframe: Airframe, name: str) -> str:
    """The full section.name of a gain, of which any unambiguous beginning is enough: turn.band.

    Raises  ValueError naming the gains it could be
    """
    read = needed_gains(airframe)
    known = [k for k in airframe.gain_names() if k in airframe.parameters or k.replace(".", "_", 1) in read]
    if name in known:
        return name
    # turn.damping is that gain even where turn.damping_limit exists; a unit may always be left out
    found = [k for k in known if name and k.startswith(name)]
    exact = [k for k in found if re.fullmatch(re.escape(name) + _UNIT, k)]
    if len(found) == 1 or len(exact) == 1:
        return (exact or found)[0]
    unread = [k for k in airframe.gain_names() if k not in known and name and k.startswith(name)]
    if unread and not found:
        raise ValueError(
            f"{airframe.autopilot} does not read the gain {unread[0]} of another autopilot;"
            f" what it reads: testbed aircraft autopilot {airframe.argument} --parameters"
        )
    near = found or difflib.get_close_matches(name, known, 3)
    sections = f"SECTION.NAME of airframe.toml, of the sections {', '.join(airframe.gains)}"
    raise ValueError(f"{airframe.name} has no gain {name}; there are {', '.join(near) or sections}")
