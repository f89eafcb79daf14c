"""Finds the equations that an airframe flies: an autopilot of the package, or a file in its folder."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from aircraft.airframes.schema import INVERTING, Airframe
from aircraft.equations.compiler import system_xml
from aircraft.equations.language import DESIGN_DT_S, Equations, parse
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


def equations_of(airframe: Airframe) -> Equations:
    """The equations of an airframe's autopilot, for all airframes. Raises ValueError naming file and line."""
    path = file_of(airframe)
    try:
        return _parsed(text_of(airframe))
    except ValueError as error:
        said = str(error)
        raise ValueError(said if said.startswith(str(path)) else f"{path}: {said}") from None


@cache
def _parsed(text: str) -> Equations:
    return parse(text)


def of_airframe(airframe: Airframe) -> Equations:
    """The autopilot's equations, those that this airframe has."""
    return equations_of(airframe).of(airframe.gain_values())


def values_of(airframe: Airframe) -> dict[str, float]:
    """What the autopilot's properties hold: name -> gain or parameter. Raises ValueError."""
    if airframe.autopilot == INVERTING:
        return airframe.gain_values()
    mine = of_airframe(airframe)
    gains = airframe.gain_values()
    needed = mine.needed()
    found = {name: value for name, value in gains.items() if name in needed}
    parameters = {name: p.default for name, p in mine.parameters.items()}
    return found | parameters | {n: v for n, v in airframe.parameters.items() if n in parameters}


def flies_its_files(airframe: Airframe) -> bool:
    """Whether systems/autopilot.xml of the folder flies as it is; else the equations are compiled."""
    return airframe.autopilot == INVERTING and not airframe.variant


def compiled(airframe: Airframe, dt: float = DESIGN_DT_S) -> str | None:
    """The system that flies in place of systems/autopilot.xml at a period of dt [s]; None if that one does.

    Raises  ValueError naming file and line of what does not compile
    """
    if flies_its_files(airframe):
        return None
    return _compiled(str(file_of(airframe)), text_of(airframe), tuple(values_of(airframe).items()),
                     tuple(airframe.gain_values()), dt, airframe.engines.count)  # fmt: skip


@cache
def _compiled(
    path: str,
    text: str,
    values: tuple[tuple[str, float], ...],
    gains: tuple[str, ...],
    dt: float,
    engines: int,
) -> str:
    try:
        return system_xml(parse(text).of(gains), dict(values), dt, engines)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def xml_of(airframe: Airframe, dt: float = DESIGN_DT_S) -> str:
    """The system of an airframe's autopilot, as a folder holds it; raises ValueError as `compiled` does."""
    made = compiled(airframe, dt)
    if made is not None:
        return made
    return system_xml(equations_of(airframe), values_of(airframe), dt, airframe.engines.count)


def unused(airframe: Airframe, given: Mapping[str, float]) -> list[str]:
    """Names among `given` that the autopilot has no parameter for."""
    return sorted(given.keys() - equations_of(airframe).parameters.keys())
