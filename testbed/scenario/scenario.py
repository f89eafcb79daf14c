"""The scenario file: what is flown, by whom, under which filter. TOML, checked field by field.

Angles are degrees and every number carries its unit in its name; defaults are the settings of
Squires et al. 2022, Section III.D. `load` reads a built-in scenario or a file and applies overrides.
"""

from __future__ import annotations

import math
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, ValidationError, model_validator

from aircraft.textfile import parse_toml, read_toml
from testbed.errors import UserError, nearest, short
from testbed.scenario import capacity
from testbed.scenario.nonideal import Gusts, Lags, Network, Remedy, Sensing, Wind
from testbed.scenario.tables import (
    Alpha,
    Barrier,
    Checks,
    Filter,
    InputSet,
    Name,
    Navigation,
    Nominal,
    Positive,
    Rates,
    Section,
    Start,
)

SCHEMA_VERSION: Literal[1] = 1


class Scenario(Section):
    """Everything a run depends on; equal scenarios give equal files."""

    schema_version: Literal[1] = Field(default=SCHEMA_VERSION, description="of this format")
    name: Name = Field(description="of the run, in titles and folder names")
    description: Annotated[str, Field(max_length=2000)] = Field(
        default="", description="a sentence for people"
    )
    vehicles: Annotated[int, Field(ge=1, le=1000)] = Field(description="how many; counted from 1")
    duration_s: Annotated[float, Field(ge=0, le=86400)] = Field(
        default=20.0, description="flown time; a multiple of the filter period"
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        default=1, description="of everything random in the run"
    )
    plant: Literal["unicycle", "lagged", "jsbsim"] = Field(
        default="unicycle",
        description="unicycle: the paper's; lagged: with identified lags and limits; jsbsim: 6-DOF aircraft",
    )
    airframes: list[Annotated[str, Field(min_length=1, max_length=1000)]] = Field(
        default=["x8"], min_length=1, max_length=1000, description="names or folders, repeated in turn"
    )
    d_safe_m: Positive = Field(default=5.0, description="Ds, the separation to keep")
    goal_radius_m: Positive = Field(default=20.0, description="a goal counts as reached within it")
    rates: Rates = Rates()
    limits: InputSet = InputSet()
    start: Start = Start()
    nominal: Nominal = Nominal()
    filter: Filter = Filter()
    barrier: Barrier = Barrier()
    alpha: Alpha = Alpha()
    navigation: Navigation = Navigation()
    checks: Checks = Checks()
    lags: Lags = Lags()
    remedy: Remedy = Remedy()
    wind: Wind = Wind()
    gusts: Gusts = Gusts()
    sensing: Sensing = Sensing()
    network: Network = Network()

    @model_validator(mode="after")
    def consistent(self) -> Scenario:
        if self.start.pattern == "list" and len(self.start.places) != self.vehicles:
            raise ValueError(
                f"start.places: {len(self.start.places)} places for {self.vehicles} vehicles; list one each"
            )
        if self.start.pattern == "circle" and self.start.places:
            raise ValueError("start.places: listed, but start.pattern is 'circle'; set it to 'list'")
        for name in ("lateral_offsets_m", "heading_offsets_deg", "height_offsets_m"):
            given = len(getattr(self.start, name))
            if given not in (0, self.vehicles):
                raise ValueError(f"start.{name}: {given} offsets for {self.vehicles} vehicles; list one each")
        for name in ("sigma", "zeta_mps", "manoeuvres"):
            values = getattr(self.barrier, name)
            if isinstance(values, list) and len(values) > 1 and len(values) != self.vehicles:
                raise ValueError(f"barrier.{name}: {len(values)} values for {self.vehicles} vehicles")
        if self.barrier.pairs:
            wanted = [(i, j) for i in range(1, self.vehicles + 1) for j in range(i + 1, self.vehicles + 1)]
            if [(p.i, p.j) for p in self.barrier.pairs] != wanted:
                raise ValueError(f"barrier.pairs: list the pairs {wanted} in this order")
        self.remedy.check(self.filter, self.barrier)
        if self.gusts.jsbsim_turbulence != "none" and self.plant != "jsbsim":
            raise ValueError(
                f"gusts.jsbsim_turbulence: plant {self.plant!r} has none; gusts.intensity suits every plant"
            )
        ratio = self.duration_s / self.rates.filter_dt_s
        if abs(ratio - round(ratio)) > 1e-6:
            lower, upper = (f(ratio) * self.rates.filter_dt_s for f in (math.floor, math.ceil))
            raise ValueError(
                f"duration_s: {self.duration_s:g} s is not a multiple of the filter period"
                f" {self.rates.filter_dt_s:g} s; try {lower:g} or {upper:g}"
            )
        capacity.check(self)
        return self

    @property
    def filter_steps(self) -> int:
        return round(self.duration_s / self.rates.filter_dt_s)


@cache
def builtin() -> dict[str, str]:
    """Built-in scenarios: name -> TOML text."""
    folder = resources.files("testbed.scenario") / "builtin"
    return {
        f.name.removesuffix(".toml"): f.read_text(encoding="utf-8")
        for f in sorted(folder.iterdir(), key=lambda f: f.name.removesuffix(".toml"))
        if f.name.endswith(".toml")
    }


def load(source: str | Path, overrides: list[str] | None = None) -> Scenario:
    """A built-in scenario by name, or a file by path, with `field=value` overrides.

    An override names a field by its dotted path (`start.radius_m=100`) or, where that is unambiguous, by
    its last part (`radius_m=100`); the value is TOML (`[0, 1]`, `true`, `20`), or else a plain word.
    Raises UserError in one line, with the file and the field's path.
    """
    where, data = str(source), _read(str(source))
    for item in overrides or []:
        _apply(data, item)
    return parse(data, where)


def parse(data: dict[str, Any], where: str = "scenario") -> Scenario:
    """A scenario from plain data; raises UserError with the offending field's path."""
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise UserError(f"{where}: {explain(error)}") from None


def _read(source: str) -> dict[str, Any]:
    if source in builtin():
        return parse_toml(builtin()[source])
    path = Path(source)
    try:
        if path.suffix == ".toml" or path.is_file():
            return read_toml(path)
    except FileNotFoundError:
        raise UserError(f"scenario file {source} does not exist") from None
    except OSError as error:  # a name no file can have
        raise UserError(f"scenario file {short(source)}: {error.strerror}") from None
    except ValueError as error:
        raise UserError(f"{source}: {error}") from None
    raise UserError(f"unknown scenario {short(source)!r}; {nearest(source, builtin())}")


# Of several mistakes, so many are named.
NAMED_MISTAKES = 4
# What pydantic adds to a path where a field may be of two types.
_TYPES = {"float", "constrained-float", "list[float]", "list[constrained-float]", "function-after"}


def explain(error: ValidationError, model: type[Section] | None = None) -> str:
    """What pydantic found wrong with the data of `model` (a scenario), in one line."""
    said = list(dict.fromkeys(_explain(e, model or Scenario) for e in error.errors()))
    more = len(said) - NAMED_MISTAKES
    return "; ".join(said[:NAMED_MISTAKES]) + (f"; and {more} more" if more > 0 else "")


def _explain(error: Any, model: type[Section]) -> str:
    """One pydantic error in one line: the field's path, what is wrong, and the remedy."""
    *parents, last = [p for p in error["loc"] if p not in _TYPES] or [""]
    path = short(".".join(map(str, [*parents, last])))
    if error["type"] == "extra_forbidden":
        return f"{path}: unknown field; {nearest(str(last), _fields_at(parents, model))}"
    message = error["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    if error["type"] == "list_type":
        message = f"write a list, such as {path}=[{short(repr(error['input']))}]"
    got = f", got {short(repr(error['input']))}" if path and not isinstance(error["input"], dict) else ""
    return f"{path}: {message}{got}" if path else message


def _section(annotation: Any) -> type[Section] | None:
    """The section that an annotation names, be it in a list, a table or a union."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return annotation
    return next((found for a in get_args(annotation) if (found := _section(a)) is not None), None)


def _fields_at(parents: list[Any], model: type[Section]) -> list[str]:
    here: type[Section] | None = model
    for part in parents:
        # Anything else is a place in a list or a key of a table, whose entries are all alike.
        if here is not None and part in here.model_fields:
            here = _section(here.model_fields[part].annotation)
    return list(here.model_fields) if here is not None else []


@cache
def field_paths() -> dict[str, list[tuple[str, ...]]]:
    """Every name an override may use -> the paths it can mean."""
    paths: dict[str, list[tuple[str, ...]]] = {}
    for name in Scenario.model_fields:
        section = Scenario.model_fields[name].annotation
        if not (isinstance(section, type) and issubclass(section, Section)):
            paths.setdefault(name, []).append((name,))
            continue
        for leaf in section.model_fields:
            paths.setdefault(leaf, []).append((name, leaf))
            paths[f"{name}.{leaf}"] = [(name, leaf)]
    return paths


def _apply(data: dict[str, Any], item: str) -> None:
    name, equals, text = item.partition("=")
    name = name.strip()
    if not equals:
        raise UserError(f"--set {item}: write field=value, for example --set start.radius_m=100")
    path = field_path(name, "--set ")
    value: Any = text.strip()
    try:
        read = parse_toml(f"value = {text}")
        # A text of several lines would be several fields, and all but the first dropped.
        value = read["value"] if len(read) == 1 else value
    except ValueError:
        pass
    assign(data, path, value)


def field_path(name: str, where: str = "") -> tuple[str, ...]:
    """The path that a field's whole or last name means; UserError, begun by `where`, if there is none."""
    paths = field_paths().get(name)
    if paths is None:
        raise UserError(f"{where}{short(name)}: unknown field; {nearest(name, field_paths())}")
    # A field of the scenario itself wins over one of the same name in a section.
    path = min(paths, key=len)
    if sum(len(p) == len(path) for p in paths) > 1:
        raise UserError(f"{where}{name}: could be " + " or ".join(".".join(p) for p in paths))
    return path


def assign(data: dict[str, Any], path: tuple[str, ...], value: Any) -> None:
    """Set the field at `path` in a scenario's plain data."""
    target = data
    for part in path[:-1]:
        target = target.setdefault(part, {})
        if not isinstance(target, dict):
            raise UserError(f"{part}: must be a table")
    target[path[-1]] = value
