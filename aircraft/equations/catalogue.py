"""Finds the equations that an airframe flies: an autopilot of the package, or a file in its folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from aircraft.airframes.schema import INVERTING, Airframe
from aircraft.airframes.sensors import Sensors, sensors_of
from aircraft.equations.compiler import system_xml
from aircraft.equations.language import DESIGN_DT_S, Equations, parse, without_gains
from aircraft.equations.sensing import sensed, sensor_values
from aircraft.textfile import read_text

AUTOPILOTS = Path(__file__).parents[1] / "autopilots"
FILE = "autopilot.eq"


def names() -> list[str]:
    """The autopilots that come with the package."""
    return sorted(p.parent.name for p in AUTOPILOTS.glob(f"*/{FILE}"))


def file_of(airframe: Airframe) -> Path:
    """The equations file of an airframe's autopilot. Raises ValueError if there is no such autopilot."""
    if airframe.autopilot in names():
        return AUTOPILOTS / airframe.autopilot / FILE
    if airframe.autopilot.endswith(".eq"):
        return airframe.folder / airframe.autopilot
    raise ValueError(
        f"there is no autopilot {airframe.autopilot}; there are {', '.join(names())}, or name an equations"
        " file of the folder, NAME.eq"
    )


def text_of(airframe: Airframe) -> str:
    """The text of the equations. Raises ValueError naming a file that cannot be read."""
    path = file_of(airframe)
    try:
        return read_text(path)
    except FileNotFoundError:
        raise ValueError(f"{path} does not exist; write it, or name another autopilot") from None


def sha256_of(airframe: Airframe) -> str:
    """SHA-256 of the equations, for fingerprints: without what the text says of gains, which flies nothing.

    Of the inverting autopilot, which has equations for adopted aircraft too, it is of those that the airframe
    has, however they are laid out.
    """
    text = without_gains(text_of(airframe))
    if airframe.autopilot == INVERTING:
        mine = equations_of(airframe).of(airframe.gain_values())
        channels = [
            [c.name, c.condition, c.every, c.rate_hz, [[e.name, e.formula, e.output] for e in c.equations]]
            for c in mine.channels
        ]
        inputs = [[name, value] for name, (value, _) in mine.inputs.items()]
        text = json.dumps([mine.uses, inputs, channels])
    return hashlib.sha256(text.encode()).hexdigest()


def equations_of(airframe: Airframe) -> Equations:
    """The equations of an airframe's autopilot, for all airframes. Raises ValueError naming file and line."""
    path = file_of(airframe)
    return _parsed(path, text_of(airframe))


@cache
def _parsed(path: Path, text: str) -> Equations:
    try:
        return parse(text)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def of_airframe(airframe: Airframe) -> Equations:
    """The autopilot's equations, those that this airframe has, with its sensors and servos.

    Raises  ValueError naming the file and what is wrong with it
    """
    path, text = file_of(airframe), text_of(airframe)
    return _of(path, text, tuple(airframe.gain_values()), sensors_of(airframe.sensors))


@cache
def _of(path: Path, text: str, gains: tuple[str, ...], sensors: Sensors) -> Equations:
    found = _parsed(path, text).of(gains)
    try:
        return sensed(found, sensors)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def values_of(airframe: Airframe) -> dict[str, float]:
    """What the autopilot's properties hold: name -> gain or parameter. Raises ValueError."""
    if airframe.autopilot == INVERTING and sensors_of(airframe.sensors).perfect:
        return airframe.gain_values()
    mine = of_airframe(airframe)
    gains = airframe.gain_values() | sensor_values(sensors_of(airframe.sensors))
    needed = mine.needed()
    found = {name: value for name, value in gains.items() if name in needed}
    parameters = {name: p.default for name, p in mine.parameters.items()}
    return found | parameters | {n: v for n, v in airframe.parameters.items() if n in parameters}


def flies_its_files(airframe: Airframe) -> bool:
    """Whether systems/autopilot.xml of the folder flies as it is; else the equations are compiled."""
    plain = airframe.autopilot == INVERTING and not airframe.variant
    return plain and sensors_of(airframe.sensors).perfect


def compiled(airframe: Airframe, dt: float = DESIGN_DT_S) -> str | None:
    """The system that flies in place of systems/autopilot.xml at a period of dt [s]; None if that one does.

    Raises  ValueError naming file and line of what does not compile
    """
    return None if flies_its_files(airframe) else xml_of(airframe, dt)


def xml_of(airframe: Airframe, dt: float = DESIGN_DT_S) -> str:
    """The system of an airframe's autopilot, as a folder holds it; raises ValueError as `compiled` does."""
    path, text, sensors = file_of(airframe), text_of(airframe), sensors_of(airframe.sensors)
    values = tuple(values_of(airframe).items())
    return _compiled(path, text, tuple(airframe.gain_values()), sensors, values, dt, airframe.engines.count)


@cache
def _compiled(
    path: Path,
    text: str,
    gains: tuple[str, ...],
    sensors: Sensors,
    values: tuple[tuple[str, float], ...],
    dt: float,
    engines: int,
) -> str:
    try:
        return system_xml(_of(path, text, gains, sensors), dict(values), dt, engines)
    except ValueError as error:
        said = str(error)
        raise ValueError(said if said.startswith(str(path)) else f"{path}: {said}") from None


def unused(airframe: Airframe, given: Mapping[str, float]) -> list[str]:
    """Names among `given` that the autopilot has no parameter for."""
    return sorted(given.keys() - equations_of(airframe).parameters.keys())
