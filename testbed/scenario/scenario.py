"""Reads and checks scenario files: what is flown, by whom, under which filter.

Angles are degrees and every number carries its unit in its name; defaults are the settings of
Squires et al. 2022, Section III.D. `load` reads a built-in scenario or a file and applies overrides.
"""

from __future__ import annotations

import copy
import math
import warnings
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError, ValidationInfo, model_validator

from aircraft.textfile import TextError, parse_toml, read_text
from testbed.errors import Mistake, NoteWarning, UserError, nearest, short
from testbed.scenario import capacity, fleet
from testbed.scenario.barrier import PairTurns
from testbed.scenario.contents import KINDS, LISTED_KINDS, SCHEMA_VERSION, Contents
from testbed.scenario.explain import explain
from testbed.scenario.fence_rules import check_fences
from testbed.scenario.fields import Section
from testbed.scenario.fleet_rules import check_tables
from testbed.scenario.guidance import NearIdentity
from testbed.scenario.guidance_rules import check_guidance, notes
from testbed.scenario.lines import line_in
from testbed.scenario.location import FIELD, placed
from testbed.scenario.overrides import assign, is_within, meanings, read_value, remove, resolve
from testbed.scenario.relevance import idle
from testbed.scenario.spelling import ALONE, FIELDS, TABLES, current
from testbed.scenario.start import Places, RandomGoals
from testbed.scenario.vehicle import field_names

# In pydantic's validation context: fields without effect are kept.
KEEP_IDLE = "keep_idle"


class Scenario(Contents):
    """Everything a run depends on; equal scenarios give equal files."""

    @model_validator(mode="after")
    def consistent(self, info: ValidationInfo) -> Scenario:
        check_tables(self)
        start, n = self.start, self.vehicles
        barrier = fleet.barrier(self)
        if isinstance(start, Places) and len(start.places) != n:
            raise ValueError(f"start.places: {len(start.places)} places for {n} vehicles; list one each")
        for k, v in enumerate(self.vehicle if isinstance(start, RandomGoals) else [], 1):
            if v.placed or v.goal_x_m is not None:
                raise ValueError(
                    f"vehicle.{k}: start.pattern = 'random-goals' draws starts and goals, every pair safe;"
                    " leave out its x_m and goal_x_m, or list places"
                )
        for name in ("lateral_offsets_m", "heading_offsets_deg", "height_offsets_m"):
            given = len(getattr(start, name))
            if given not in (0, n):
                raise ValueError(f"start.{name}: {given} offsets for {n} vehicles; list one each")
        for name in ("sigma", "zeta_mps", "manoeuvres"):
            values = getattr(barrier, name, None)
            if isinstance(values, list) and len(values) > 1 and len(values) != n:
                raise ValueError(f"barrier.{name}: {len(values)} values for {n} vehicles")
        if isinstance(barrier, PairTurns):
            wanted = [(i, j) for i in range(1, n + 1) for j in range(i + 1, n + 1)]
            if [(p.i, p.j) for p in barrier.pairs] != wanted:
                raise ValueError(f"barrier.pairs: list the pairs {wanted} in this order")
        if (known := self.sensing.range_m) is not None and known < self.d_safe_m:
            raise ValueError(
                f"sensing.range_m: {known:g} m is below Ds, d_safe_m = {self.d_safe_m:g} m: it would be too"
                " late when vehicles know of each other; `testbed range` prints how much is enough"
            )
        self.remedy.check(self.filter, barrier)
        check_fences(self)
        check_guidance(self)
        if not (info.context or {}).get(KEEP_IDLE) and (found := idle(self)):
            raise ValueError("; ".join(f"{path}: {why}" for path, why in found.items()))
        ratio = self.duration_s / self.rates.filter_dt_s
        if abs(ratio - round(ratio)) > 1e-6:
            lower, upper = (f(ratio) * self.rates.filter_dt_s for f in (math.floor, math.ceil))
            raise ValueError(
                f"duration_s: {self.duration_s:g} s is not a multiple of the filter period"
                f" {self.rates.filter_dt_s:g} s; try {lower:g} or {upper:g}"
            )
        capacity.check(self)
        return self


@cache
def builtin() -> dict[str, str]:
    """Built-in scenarios: name -> TOML text."""
    folder = resources.files("testbed.scenario") / "builtin"
    return {
        f.name.removesuffix(".toml"): f.read_text(encoding="utf-8")
        for f in sorted(folder.iterdir(), key=lambda f: f.name.removesuffix(".toml"))
        if f.name.endswith(".toml")
    }


def load(source: str | Path, overrides: Sequence[str] | None = None) -> Scenario:
    """A built-in scenario by name, or a file by path, with `field=value` overrides.

    An override names a field by its dotted path (`start.radius_m=100`) or, where that is unambiguous, by
    its last part (`radius_m=100`); the value is TOML (`[0, 1]`, `true`, `20`), or else a plain word.
    What the file says and an override leaves without effect is left out, with a `NoteWarning`.
    Raises UserError in one line, with the file and the field's path.
    """
    where = str(source)
    text = read(where)
    file = tables(text, where)
    data = copy.deepcopy(file)
    asked = [override(data, item) for item in overrides or []]
    data = placed(data, *homes(where, asked))

    def line(field: str) -> int | None:
        return None if is_within(field, asked) else line_in(text, field)

    try:
        made, dropped = settled(data, where)
        own = {} if is_old(file) else _idle_in(file, where) if dropped else {}
        refused = [Mistake(dropped[p], p) for p in dropped if p in own or is_within(p, asked)]
        if refused:
            raise UserError(*refused, file=where)
    except UserError as error:
        raise error.located(line) from None
    for path, why in dropped.items():
        if path == FIELD and FIELD not in file:
            continue  # found here, not given by the user
        warnings.warn(NoteWarning(f"{where}: {path} is left out: {why}"), stacklevel=2)
    for note in notes(made):
        warnings.warn(NoteWarning(f"{where}: {note}"), stacklevel=2)
    return made


def homes(source: str, asked: Sequence[tuple[str, ...]] = ()) -> list[Path]:
    """Where relative airframes of a scenario start: beside its file first, or in the working directory.

    asked  paths of overrides: what the command line says starts from the working directory
    """
    here, beside = Path(), [] if source in builtin() else [Path(source).parent]
    own = any(path[0] == "vehicle" and path[-1] == "airframe" for path in asked)
    return [here, *beside] if own or is_within("airframes", asked) else [*beside, here]


def parse(data: dict[str, Any], where: str = "scenario", keep_idle: bool = False) -> Scenario:
    """A scenario from plain data of this schema or an older one, in today's or an older spelling.

    keep_idle  fields without effect are kept instead of refused: in what was flown already, and in what
               `changed` makes scenarios from
    Raises UserError with the offending field's path.
    """
    data = current(data)
    if is_old(data):
        data = without_foreign(data)[0] | {"schema_version": SCHEMA_VERSION}
        if not keep_idle:
            return settled(data, where)[0]
    try:
        return Scenario.model_validate(data, context={KEEP_IDLE: keep_idle})
    except ValidationError as error:
        raise UserError(*explain(error, Scenario, KINDS | LISTED_KINDS), file=where) from None


def is_old(data: Mapping[str, Any]) -> bool:
    """Whether plain data says that it is of schema 1, in which fields without effect stood everywhere."""
    said = data.get("schema_version")
    return type(said) is int and said == 1


def without_foreign(
    data: Mapping[str, Any], kept: Sequence[tuple[str, ...]] = ()
) -> tuple[dict[str, Any], dict[str, str]]:
    """Plain data without fields that belong to another kind of their table, and why each was left out.

    kept  paths that stay, to be refused where they have no effect
    """
    left, dropped = copy.deepcopy(current(data)), {}
    for table, kinds in KINDS.items():
        said = left.get(table)
        if not isinstance(said, dict):
            continue
        said = kinds.settled(said)
        for name in kinds.foreign(said):
            if not is_within(f"{table}.{name}", kept):
                dropped[f"{table}.{name}"] = kinds.refusal(name, kinds.tag(said) or "")
        left[table] = {name: v for name, v in said.items() if f"{table}.{name}" not in dropped}
    return left, dropped


def settled(data: dict[str, Any], where: str = "scenario") -> tuple[Scenario, dict[str, str]]:
    """The scenario of plain data without what has no effect in it: what a change by the program leaves.

    Data of schema 1 become data of this schema. Returns the scenario, and dotted path -> why of what was left
    out. Raises UserError as `parse` does.
    """
    data, dropped = without_foreign(data)
    if is_old(data):
        data["schema_version"] = SCHEMA_VERSION
        if data.get("plant", "unicycle") == "unicycle" and isinstance(data.get("start"), dict):
            data["start"].pop("speed_mps", None)  # with schema 1 a unicycle did not have it
    made = parse(data, where, keep_idle=True)
    while found := idle(made):
        for path in found:
            remove(data, path)
        dropped |= found
        made = parse(data, where, keep_idle=True)
    return made, dropped


@cache
def field_paths() -> dict[str, list[tuple[str, ...]]]:
    """Every name an override may use -> the paths it can mean."""
    found = meanings({name: _short(name) for name in Scenario.model_fields})
    found |= {f"guidance.{leaf}": [("guidance", leaf)] for leaf in _fields("guidance")}
    for old, table in TABLES.items():
        renamed = {new: leaf for leaf, new in FIELDS.get(table, {}).items()}
        found[old] = [(table,)]
        found |= {f"{old}.{renamed.get(f, f)}": [(table, f)] for f in _fields(table)}
    listed = {name: kinds.fields() for name, kinds in LISTED_KINDS.items()} | {"vehicle": field_names()}
    for name, fields in listed.items():
        found |= {f"{name}.*.{leaf}": [(name, "*", leaf)] for leaf in fields}
    return found | {leaf: [path] for leaf, path in ALONE.items()}


def _short(name: str) -> list[str]:
    """The fields of a table that an override may name alone: of guidance those that have long been there."""
    return list(NearIdentity.model_fields) if name == "guidance" else _fields(name)


def _fields(name: str) -> list[str]:
    """The fields of a table, of all its kinds; none for what is no table."""
    if name in KINDS:
        return KINDS[name].fields()
    table = Scenario.model_fields[name].annotation
    return list(table.model_fields) if isinstance(table, type) and issubclass(table, Section) else []


def field_path(name: str, where: str = "") -> tuple[str, ...]:
    """The path that a field's whole or last name means; UserError, begun by `where`, if there is none."""
    return resolve(name, field_paths(), where)


def override(data: dict[str, Any], item: str) -> tuple[str, ...]:
    """Set `field=value` in a scenario's plain data; returns the field's path."""
    name, equals, text = item.partition("=")
    if not equals:
        raise UserError(f"--set {item}: write field=value, for example --set start.radius_m=100")
    path = field_path(name.strip(), "--set ")
    assign(data, path, read_value(text))
    return path


def read(source: str) -> str:
    """The text of a built-in scenario or of a file; UserError where there is none."""
    if source in builtin():
        return builtin()[source]
    path = Path(source)
    try:
        if path.suffix == ".toml" or path.is_file():
            return read_text(path)
    except FileNotFoundError:
        raise UserError(f"scenario file {source} does not exist") from None
    except OSError as error:  # a name no file can have
        raise UserError(f"scenario file {short(source)}: {error.strerror}") from None
    except TextError as error:
        raise UserError(str(error), file=source) from None
    raise UserError(f"unknown scenario {short(source)!r}; {nearest(source, builtin())}")


def tables(text: str, where: str) -> dict[str, Any]:
    """A scenario file's text as plain data in today's spelling; UserError for what is no TOML."""
    try:
        return current(parse_toml(text))
    except TextError as error:
        raise UserError(str(error), file=where) from None
    except UserError as error:
        raise UserError(*error.mistakes, file=where) from None


def _idle_in(file: dict[str, Any], where: str) -> dict[str, str]:
    """What has no effect in a file as it stands; nothing where it is no scenario without overrides."""
    try:
        return settled(file, where)[1]
    except UserError:
        return {}
