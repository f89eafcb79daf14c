"""The scenario file: what is flown, by whom, under which filter. TOML, checked field by field.

Angles are degrees and every number carries its unit in its name; defaults are the settings of
Squires et al. 2022, Section III.D. `load` reads a built-in scenario or a file and applies overrides.
"""

from __future__ import annotations

import math
import tomllib
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from testbed.errors import UserError, nearest

SCHEMA_VERSION = 1

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
TurnRate = Annotated[float, Field(ge=-360, le=360)]


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Rates(Section):
    """Periods of the flight dynamics, of the filter and of recording; the latter two are multiples."""

    fdm_dt_s: Annotated[float, Field(ge=1e-4, le=1)] = 0.005
    filter_dt_s: Positive = 0.005
    record_dt_s: Positive = 0.005

    @model_validator(mode="after")
    def divide(self) -> Rates:
        for name in ("filter", "record"):
            period = getattr(self, f"{name}_dt_s")
            ratio = period / self.fdm_dt_s
            if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
                below, above = max(1, math.floor(ratio)), max(1, math.ceil(ratio))
                choices = " or ".join(f"{k * self.fdm_dt_s:g}" for k in sorted({below, above}))
                raise ValueError(
                    f"{name} period {period:g} s is not a multiple of the FDM period {self.fdm_dt_s:g} s;"
                    f" try {choices}"
                )
        ratio = self.record_dt_s / self.filter_dt_s
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            below, above = max(1, math.floor(ratio)), max(1, math.ceil(ratio))
            choices = " or ".join(f"{k * self.filter_dt_s:g}" for k in sorted({below, above}))
            raise ValueError(
                f"record period {self.record_dt_s:g} s is not a multiple of the filter period"
                f" {self.filter_dt_s:g} s; try {choices}"
            )
        return self

    @property
    def fdm_steps(self) -> int:
        """FDM periods per filter period."""
        return round(self.filter_dt_s / self.fdm_dt_s)

    @property
    def record_steps(self) -> int:
        """Filter periods per recording."""
        return round(self.record_dt_s / self.filter_dt_s)


class InputSet(Section):
    """The input set U: what the filter may command."""

    v_min_mps: Positive = 15.0
    v_max_mps: Positive = 25.0
    omega_max_degps: Annotated[float, Field(ge=0, le=360)] = 13.0
    zeta_max_mps: NonNegative = 3.9

    @model_validator(mode="after")
    def ordered(self) -> InputSet:
        if self.v_min_mps > self.v_max_mps:
            raise ValueError(f"v_min_mps {self.v_min_mps:g} is above v_max_mps {self.v_max_mps:g}")
        return self


class Place(Section):
    """Where one vehicle starts, and its goal."""

    x_m: float
    y_m: float
    course_deg: Annotated[float, Field(ge=-720, le=720)]
    z_m: float = 0.0
    goal_x_m: float
    goal_y_m: float
    goal_z_m: float = 0.0


class Start(Section):
    """Initial poses: on a circle facing its centre with the goal opposite, or listed one by one."""

    pattern: Literal["circle", "list"] = "circle"
    radius_m: Positive = 200.0
    course_offset_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    heights_m: list[float] = Field(
        default=[0.0], min_length=1, description="one for all, or one per vehicle, repeated in turn"
    )
    places: list[Place] = Field(default=[], description="for pattern = 'list': one per vehicle")
    speed_mps: Positive = Field(
        default=20.0, description="an aircraft's first ground speed; a unicycle has none"
    )
    round_decimals: Annotated[int, Field(ge=0, le=12)] | None = Field(
        default=None, description="x, y [m] and course [deg] rounded so, as in the published runs"
    )
    lateral_perturbation_m: NonNegative = Field(default=0.0, description="uniform, across the course")
    heading_perturbation_deg: Annotated[float, Field(ge=0, le=180)] = Field(
        default=0.0, description="uniform"
    )
    height_perturbation_m: NonNegative = Field(default=0.0, description="uniform")


class Nominal(Section):
    """The goal-seeking controller that the filter alters."""

    controller: Literal["near-identity", "manoeuvre"] = "near-identity"
    lookahead_m: Positive = 1.0
    gain_per_s: Positive = 0.1
    delay_steps: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="filter steps by which u_hat is old; before there is one it is zero"
    )


class Alpha(Section):
    """The extended class-K function alpha(h)."""

    kind: Literal["linear", "cubic", "odd-polynomial"] = "cubic"
    coefficient: Positive = 0.1
    coefficients: list[NonNegative] = Field(default=[], description="of h, h^3, h^5, ... for odd-polynomial")

    @model_validator(mode="after")
    def complete(self) -> Alpha:
        if self.kind == "odd-polynomial" and not any(self.coefficients):
            raise ValueError("coefficients: an odd polynomial needs at least one positive coefficient")
        return self


class Manoeuvre(Section):
    """A constant input: straight, a turn, a climb, or any mixture."""

    v_mps: Positive
    omega_degps: TurnRate = 0.0
    zeta_mps: float = 0.0


class Pair(Section):
    """The turn that one pair evades by, where every pair has a manoeuvre of its own."""

    i: Annotated[int, Field(ge=1)]
    j: Annotated[int, Field(ge=2)]
    v_mps: Positive
    omega_degps: TurnRate


class Barrier(Section):
    """The evading manoeuvre gamma and the barrier function built from it."""

    kind: Literal["turn", "straight", "rollout", "euclidean"] = "turn"
    form: Literal["root", "squared"] = "root"
    v_mps: Positive = 16.0
    omega_degps: TurnRate = Field(default=11.7, description="of the turn")
    sigma: Positive | list[Positive] = Field(default=1.0, description="turn: speed ratio, one or per vehicle")
    delta_m2: NonNegative = Field(default=0.01, description="turn: the paper's rounding of the kink")
    smoothing_m2: NonNegative = Field(
        default=0.0, description="turn: eps of the smoothed barrier; 0 is the paper's, we recommend 30"
    )
    speed_step: NonNegative = Field(
        default=0.01, description="straight: vehicle i (from 1) evades at v_mps (1 + speed_step i)"
    )
    zeta_mps: float | list[float] = Field(default=0.0, description="straight: climb rate, one or per vehicle")
    manoeuvres: list[Manoeuvre] = Field(default=[], description="rollout: one for all, or one per vehicle")
    shared: bool = Field(
        default=True, description="false lets every pair have its own manoeuvre, which voids Theorem 3"
    )
    pairs: list[Pair] = Field(default=[], description="turn, with shared = false: each pair's manoeuvre")
    gradient: Literal["analytic", "forward"] = Field(
        default="analytic", description="forward: by differences, as in the published runs"
    )
    gradient_step: Annotated[float, Field(gt=0, le=1)] = Field(default=1e-4, description="m and rad")

    @model_validator(mode="after")
    def complete(self) -> Barrier:
        if self.kind == "turn" and self.omega_degps == 0:
            raise ValueError("omega_degps: a turn needs a turn rate other than zero")
        if self.kind == "rollout" and not self.manoeuvres:
            raise ValueError("manoeuvres: a rollout needs at least one manoeuvre")
        if self.pairs and self.shared:
            raise ValueError(
                "pairs: a manoeuvre for each pair breaks the shared-manoeuvre assumption"
                " (Assumption 1 of the paper); say shared = false to study just that"
            )
        if not self.shared and not self.pairs:
            raise ValueError("pairs: shared = false needs each pair's manoeuvre listed")
        return self


class Filter(Section):
    """What stands between the nominal controller and the vehicles."""

    kind: Literal["centralised", "limited", "navigation", "none"] = "centralised"
    monitor: bool = Field(default=False, description="check Theorems 3 and 4 at every step, and compare QPs")


class Navigation(Section):
    """The navigation-function baseline, with the parameters its authors' comparison used."""

    speed_mps: Positive = 20.0
    heading_gain_per_s: Positive = 0.6
    path_radius_m: Positive = Field(default=20.0, description="r_p: closer to the goal the path fades")
    path_gain: NonNegative = Field(default=20.0, description="K_p: pull towards the line from start to goal")
    potential_exponent: Positive = Field(default=0.2, description="k of the navigation function")
    swirl: NonNegative = Field(default=0.08, description="K_s: share of the gradient across lines of sight")
    vehicle_radius_m: NonNegative = Field(default=0.0, description="rho_j: contact with a vehicle")
    vehicle_margin_m: Positive = Field(default=5.0, description="delta_j: a vehicle repels from there on")
    disc_radius_m: Positive = Field(default=2000.0, description="rho_c: disc about the origin to stay in")
    disc_margin_m: Positive = Field(default=5.0, description="delta_c: its edge repels from there on")
    sensing_range_m: Positive = 400.0
    difference_step_m: Positive = Field(default=1.0, description="of the gradient's central differences")


class Scenario(Section):
    """Everything a run depends on; equal scenarios give equal files."""

    schema_version: Literal[1] = SCHEMA_VERSION
    name: Annotated[str, Field(min_length=1, max_length=100)]
    description: str = ""
    vehicles: Annotated[int, Field(ge=1, le=1000)]
    duration_s: Annotated[float, Field(ge=0, le=86400)] = 20.0
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 1
    plant: Literal["unicycle", "jsbsim"] = "unicycle"
    airframes: list[str] = Field(
        default=["x8"], min_length=1, description="names or folders, repeated in turn"
    )
    d_safe_m: Positive = Field(default=5.0, description="Ds, the separation to keep")
    goal_radius_m: Positive = 20.0
    rates: Rates = Rates()
    limits: InputSet = InputSet()
    start: Start = Start()
    nominal: Nominal = Nominal()
    filter: Filter = Filter()
    barrier: Barrier = Barrier()
    alpha: Alpha = Alpha()
    navigation: Navigation = Navigation()

    @model_validator(mode="after")
    def consistent(self) -> Scenario:
        if self.start.pattern == "list" and len(self.start.places) != self.vehicles:
            raise ValueError(
                f"start.places: {len(self.start.places)} places for {self.vehicles} vehicles; list one each"
            )
        if self.start.pattern == "circle" and self.start.places:
            raise ValueError("start.places: listed, but start.pattern is 'circle'; set it to 'list'")
        for name in ("sigma", "zeta_mps", "manoeuvres"):
            values = getattr(self.barrier, name)
            if isinstance(values, list) and len(values) > 1 and len(values) != self.vehicles:
                raise ValueError(f"barrier.{name}: {len(values)} values for {self.vehicles} vehicles")
        if self.barrier.pairs:
            wanted = [(i, j) for i in range(1, self.vehicles + 1) for j in range(i + 1, self.vehicles + 1)]
            if [(p.i, p.j) for p in self.barrier.pairs] != wanted:
                raise ValueError(f"barrier.pairs: list the pairs {wanted} in this order")
        ratio = self.duration_s / self.rates.filter_dt_s
        if abs(ratio - round(ratio)) > 1e-6:
            lower, upper = (f(ratio) * self.rates.filter_dt_s for f in (math.floor, math.ceil))
            raise ValueError(
                f"duration_s: {self.duration_s:g} s is not a multiple of the filter period"
                f" {self.rates.filter_dt_s:g} s; try {lower:g} or {upper:g}"
            )
        return self

    @property
    def filter_steps(self) -> int:
        return round(self.duration_s / self.rates.filter_dt_s)


@cache
def builtin() -> dict[str, str]:
    """Built-in scenarios: name -> TOML text."""
    folder = resources.files("testbed") / "scenarios"
    return {
        f.name.removesuffix(".toml"): f.read_text(encoding="utf-8")
        for f in sorted(folder.iterdir(), key=lambda f: f.name)
        if f.name.endswith(".toml")
    }


def load(source: str | Path, overrides: list[str] | None = None) -> Scenario:
    """A built-in scenario by name, or a file by path, with `field=value` overrides.

    An override names a field by its dotted path (`start.radius_m=100`) or, where that is unambiguous, by
    its last part (`radius_m=100`); the value is TOML (`[0, 1]`, `true`, `20`), or else a plain word.
    Raises UserError in one line, with the file and the field's path.
    """
    where, text = _read(str(source))
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{where}: not valid TOML: {error}") from None
    for item in overrides or []:
        _apply(data, item)
    return parse(data, where)


def parse(data: dict[str, Any], where: str = "scenario") -> Scenario:
    """A scenario from plain data; raises UserError with the offending field's path."""
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise UserError(f"{where}: " + "; ".join(_explain(e) for e in error.errors())) from None


def _read(source: str) -> tuple[str, str]:
    if source in builtin():
        return source, builtin()[source]
    path = Path(source)
    if path.suffix == ".toml" or path.is_file():
        try:
            return source, path.read_text(encoding="utf-8")
        except FileNotFoundError:
            raise UserError(f"scenario file {source} does not exist") from None
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(f"scenario file {source} cannot be read: {error}") from None
    raise UserError(f"unknown scenario {source!r}; {nearest(source, builtin())}")


def _explain(error: Any) -> str:
    """One pydantic error in one line: the field's path, what is wrong, and the remedy."""
    path = ".".join(
        str(part) for part in error["loc"] if part not in ("float", "int", "list[constrained-float]")
    )
    if error["type"] == "extra_forbidden":
        *parents, name = error["loc"]
        return f"{path}: unknown field; {nearest(str(name), _fields_at(parents))}"
    message = error["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    got = f", got {error['input']!r}" if path and not isinstance(error["input"], dict) else ""
    return f"{path}: {message}{got}" if path else message


def _section(model: type[Section], name: str) -> type[Section] | None:
    annotation = model.model_fields[name].annotation if name in model.model_fields else None
    return annotation if isinstance(annotation, type) and issubclass(annotation, Section) else None


def _fields_at(parents: list[Any]) -> list[str]:
    model: type[Section] | None = Scenario
    for part in parents:
        model = (
            Place
            if part == "places"
            else model
            if isinstance(part, int) or model is None
            else _section(model, part)
        )
    return list(model.model_fields) if model is not None else []


@cache
def field_paths() -> dict[str, list[tuple[str, ...]]]:
    """Every name an override may use -> the paths it can mean."""
    paths: dict[str, list[tuple[str, ...]]] = {}
    for name in Scenario.model_fields:
        section = _section(Scenario, name)
        if section is None:
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
    paths = field_paths().get(name)
    if paths is None:
        raise UserError(f"--set {name}: unknown field; {nearest(name, field_paths())}")
    # A field of the scenario itself wins over one of the same name in a section.
    path = min(paths, key=len)
    if sum(len(p) == len(path) for p in paths) > 1:
        raise UserError(f"--set {name}: could be " + " or ".join(".".join(p) for p in paths))
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    target = data
    for part in path[:-1]:
        target = target.setdefault(part, {})
        if not isinstance(target, dict):
            raise UserError(f"{part}: must be a table")
    target[path[-1]] = value
