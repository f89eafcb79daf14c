"""Defines and reads the campaign file: base scenario, axes, random fields, seeds, stopping rule."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, model_validator

from aircraft.textfile import line_of, parse_toml, read_text
from testbed.claims.registry import CLAIMS, JUDGED, SEPARATION, START_SAFE
from testbed.errors import UserError, nearest, short
from testbed.measures.cylinders import Cylinder
from testbed.measures.encounter_measures import DEFAULT_CYLINDERS, DEFAULT_THRESHOLD, Settings
from testbed.requirements.parser import LONGEST
from testbed.requirements.requirement import Requirement
from testbed.scenario.explain import explain
from testbed.scenario.fields import Name, Positive, Section

SCHEMA_VERSION = 1
MOST_RUNS = 1_000_000
Seed = Annotated[int, Field(ge=0, le=2**62)]
Values = Annotated[list[Any], Field(min_length=1, max_length=10_000)]
GUARANTEES = [claim.id for claim in JUDGED]


def _judged(name: str, requirements: Iterable[str]) -> None:
    if name not in GUARANTEES:
        known = [*GUARANTEES, *requirements]
        listed = f"{', '.join(map(repr, known[:-1]))} or {known[-1]!r}"
        raise ValueError(f"guarantee: input should be {listed}, got {short(repr(name))}")


def _requirement(text: str) -> str:
    try:
        Requirement(text).unit  # noqa: B018
    except UserError as error:
        raise ValueError(str(error)) from None
    return text


def _name(name: str) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9_-]{0,40}", name) or name in CLAIMS:
        raise ValueError(
            f"{short(name)!r} names a column of the table: small letters, digits, _ and -, and no claim's id"
        )
    return name


def _sets(said: Any) -> Any:
    """Sets of encounters by name; a single one is called as its folder or file."""
    if not isinstance(said, str):
        return said
    parts = [p for p in Path(said).with_suffix("").parts if not set(p) & set("*?[") and p not in (".", "..")]
    return {parts[-1] if parts else "encounters": said}


def _column(name: str) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,40}", name):
        raise ValueError(f"{short(name)!r} begins names of columns: small letters, digits and _")
    return name


Formula = Annotated[str, Field(max_length=LONGEST), AfterValidator(_requirement)]
Two = Annotated[list[float], Field(min_length=2, max_length=2)]


class Distribution(Section):
    """What a field is drawn from, once a run, from the run's seed: one of these."""

    uniform: Two | None = Field(default=None, description="[low, high]")
    loguniform: Two | None = Field(default=None, description="[low, high], both above 0")
    normal: Two | None = Field(default=None, description="[mean, standard deviation]")
    integers: Annotated[list[int], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="[lowest, highest], both included"
    )
    choice: Values | None = Field(default=None, description="one of these, equally likely")
    low: float | None = Field(default=None, description="with normal: nothing below")
    high: float | None = Field(default=None, description="with normal: nothing above")

    @model_validator(mode="after")
    def one_kind(self) -> Distribution:
        kinds = ("uniform", "loguniform", "normal", "integers", "choice")
        said = [k for k in kinds if getattr(self, k) is not None]
        if len(said) != 1:
            raise ValueError(
                f"say one of {', '.join(kinds)}" + (f", not {' and '.join(said)}" if said else "")
            )
        kind = said[0]
        if kind != "normal" and (self.low is not None or self.high is not None):
            raise ValueError(f"{kind}: low and high go with normal")
        if kind in ("uniform", "loguniform", "integers"):
            low, high = getattr(self, kind)
            if low > high:
                raise ValueError(f"{kind}: {low:g} is above {high:g}")
            if kind == "loguniform" and low <= 0:
                raise ValueError(f"loguniform: {low:g} is not above 0")
        if self.normal is not None:
            if self.normal[1] <= 0:
                raise ValueError(f"normal: standard deviation {self.normal[1]:g} is not above 0")
            if self.low is not None and self.high is not None and self.low >= self.high:
                raise ValueError(f"low {self.low:g} is not below high {self.high:g}")
        return self


class Stop(Section):
    """Looks planned beforehand: a cell is flown on until its rate is surely below or above `target`."""

    looks: Annotated[list[int], Field(min_length=1, max_length=1000)] = Field(
        description="numbers of seeds after which to look, increasing; the last is the most that are flown"
    )
    target: Annotated[float, Field(gt=0, lt=1)] = Field(description="rate of runs that lose the guarantee")
    alpha: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.05, description="error, split over the looks"
    )
    spending: Literal["equal", "obrien-fleming"] = "equal"

    @model_validator(mode="after")
    def increasing(self) -> Stop:
        if self.looks[0] < 1 or sorted(set(self.looks)) != self.looks:
            raise ValueError(f"looks {self.looks}: give increasing numbers of seeds, such as [50, 100, 200]")
        return self


class Measures(Section):
    """What is measured of every run, as columns of the table: see docs/guide/measures.md."""

    cylinders: dict[
        Annotated[str, AfterValidator(_column)],
        Annotated[list[Positive], Field(min_length=2, max_length=2)],
    ] = Field(
        default={name: [c.radius_m, c.half_height_m] for name, c in DEFAULT_CYLINDERS.items()},
        min_length=1,
        max_length=20,
        description="name -> [radius, half height] in m of a volume that pairs should keep clear of",
    )
    threshold: Annotated[float, Field(ge=0, lt=1)] = Field(
        default=DEFAULT_THRESHOLD,
        description="share of a channel's range beyond which an altered command is an intervention",
    )

    def settings(self) -> Settings:
        return Settings({name: Cylinder(*c) for name, c in self.cylinders.items()}, self.threshold)


class Campaign(Section):
    """Every cell (plant x filter x guidance x remedy x variant x grid) is flown from the same seeds."""

    schema_version: Literal[1] = 1
    name: Name
    description: Annotated[str, Field(max_length=2000)] = ""
    scenario: str = Field(
        default="", description="a built-in scenario or a file, from the campaign file's folder"
    )
    encounters: Annotated[dict[str, str], BeforeValidator(_sets)] = Field(
        default={},
        description="instead of scenario: a folder or pattern of scenario files, or an axis of named ones;"
        " a cell flies every file",
    )
    seeds: Annotated[int, Field(ge=1, le=MOST_RUNS)] | None = Field(
        default=None, description="how many; with [stop] the last look says it; of each encounter, or 1"
    )
    first_seed: Seed = 1
    guarantee: str = Field(
        default=SEPARATION.id,
        description="a guarantee's or requirement's name, whose violations are counted",
        json_schema_extra={"examples": [*GUARANTEES]},
    )
    requirements: dict[Annotated[str, AfterValidator(_name)], Formula] = Field(
        default={}, description="name -> signal temporal logic over run columns; robustness is recorded"
    )
    measures: Measures | None = Field(
        default=None, description="a table, empty for its defaults: volumes lost, interventions, cost"
    )
    keep: Literal["none", "violations", "all"] = Field(default="none", description="run folders to keep")
    force: bool = Field(default=True, description=f"fly unsafe starts too; `{START_SAFE.id}` tells")
    set: dict[str, Any] = Field(default={}, description="fields of the base scenario")
    plants: list[str] = Field(default=[], description="axis: a plant, or a name that --parts brings")
    filters: list[str] = Field(default=[], description="axis: filter.kind, or a name that --parts brings")
    guidance: list[str] = Field(default=[], description="axis: guidance.kind, or a name that --parts brings")
    remedies: list[str] = Field(default=[], description="axis: by name, as `testbed remedies` has them")
    variants: dict[str, dict[str, Any]] = Field(default={}, description="axis: several fields under one name")
    grid: dict[str, Values] = Field(default={}, description="axes: field -> values")
    random: dict[str, Distribution] = Field(default={}, description="field -> what it is drawn from")
    stop: Stop | None = None

    @model_validator(mode="after")
    def consistent(self) -> Campaign:
        if self.guarantee not in self.requirements:
            _judged(self.guarantee, self.requirements)
        if not self.scenario and not self.encounters:
            raise ValueError("scenario: field required, or encounters: a folder of scenario files")
        if self.scenario and self.encounters:
            raise ValueError("scenario: leave it out, or encounters; the encounters' files are scenarios")
        if self.encounters and self.stop is not None:
            raise ValueError("stop: looks count seeds, and encounters are flown all; leave out one of them")
        if self.stop is None and self.seeds is None and not self.encounters:
            raise ValueError("seeds: say how many")
        if self.stop is not None and self.seeds not in (None, self.stop.looks[-1]):
            raise ValueError(f"seeds: {self.seeds}, but the last of stop.looks is {self.stop.looks[-1]}")
        for axis in ("plants", "filters", "guidance", "remedies"):
            twice = {v for v in getattr(self, axis) if getattr(self, axis).count(v) > 1}
            if twice:
                raise ValueError(f"{axis}: {min(twice)!r} is listed twice")
        return self

    @property
    def seed_list(self) -> range:
        count = self.stop.looks[-1] if self.stop is not None else self.seeds or 1
        return range(self.first_seed, self.first_seed + count)


_FOLDER = resources.files("testbed.campaigns") / "files"


@cache
def builtin() -> dict[str, str]:
    """Campaigns that come with the package: name -> TOML text."""
    return {
        f.name.removesuffix(".toml"): f.read_text(encoding="utf-8")
        for f in sorted(_FOLDER.iterdir(), key=lambda f: f.name)
        if f.name.endswith(".toml")
    }


def load(source: str) -> tuple[Campaign, Path]:
    """A campaign by name (`head-on-x8`) or file, and the folder its scenario's path starts from.

    Raises UserError in one line, with the file and the field's path.
    """
    name = source.removesuffix(".toml")
    path = Path(source)
    folder = path.parent
    try:
        if path.is_file() or name not in builtin():
            if path.suffix != ".toml" and not path.exists():
                raise UserError(f"unknown campaign {short(source)!r}; {nearest(name, builtin())}")
            text = read_text(path)
        else:
            text = builtin()[name]
            folder = Path(str(_FOLDER))
        data = parse_toml(text)
    except FileNotFoundError:
        raise UserError(f"campaign file {short(source)} does not exist; {nearest(name, builtin())}") from None
    except OSError as error:  # a name no file can have
        raise UserError(f"campaign file {short(source)}: {error.strerror}") from None
    except ValueError as error:
        raise UserError(str(error), file=source) from None
    try:
        return parse(data, source), folder
    except UserError as error:
        raise error.located(lambda field: line_of(text, field.split("."))) from None


def parse(data: dict[str, Any], where: str) -> Campaign:
    try:
        return Campaign.model_validate(data)
    except ValidationError as error:
        raise UserError(*explain(error, Campaign), file=where) from None
