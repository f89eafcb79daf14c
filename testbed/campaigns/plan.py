"""Expands a campaign into its runs: cells times seeds, each run with an id of what it depends on."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbed.campaigns import named_remedies
from testbed.campaigns.draw import draw
from testbed.campaigns.file import MOST_RUNS, SCHEMA_VERSION, Campaign
from testbed.campaigns.identity import AirframeHashes, code_id, content_id
from testbed.campaigns.sent_parts import OwnParts, SentParts, origins
from testbed.claims.registry import SEPARATION, SEPARATION_INTRUDERS
from testbed.components.choices import AXES, Choice, choices, everywhere
from testbed.components.installed_parts import effective
from testbed.errors import UserError, nearest, short
from testbed.requirements.requirement import Requirement
from testbed.scenario import fleet, scenario
from testbed.scenario.location import identity, placed
from testbed.scenario.overrides import assign
from testbed.scenario.scenario import Scenario, field_path
from testbed.scenario.variants import Variants

Fields = dict[tuple[str, ...], Any]


@dataclass(frozen=True)
class Cell:
    """One combination of the axes' values.

    parameters  axis -> value, as the tables show it
    label       of the axes that have more than one value
    data        the scenario, but for seed and draws
    own         labels of the user's own parts that fly in it
    """

    number: int
    parameters: dict[str, Any]
    label: str
    data: dict[str, Any]
    own: tuple[str, ...] = ()


@dataclass(frozen=True)
class Planned:
    """One run: `id` is the hash of its resolved scenario, the code, the airframes' files and own parts."""

    id: str
    cell: int
    seed: int
    draws: dict[str, Any]


@dataclass
class Plan:
    """Every run there may be, cell by cell in the axes' order and seed by seed.

    airframes  checksums of the airframes used, see `AirframeHashes.known`
    parts      the user's own
    """

    campaign: Campaign
    base: Scenario
    code: str
    cells: list[Cell]
    runs: list[Planned]
    airframes: dict[str, dict[str, str]] = field(default_factory=dict)
    parts: OwnParts = field(default_factory=OwnParts)
    id: str = field(init=False)

    def __post_init__(self) -> None:
        stop = self.campaign.stop.model_dump() if self.campaign.stop else None
        says = [self.campaign.guarantee, stop, self.campaign.keep, self.campaign.force]
        self.id = content_id([[r.id for r in self.runs], [c.parameters for c in self.cells], says])

    def of(self, cell: int) -> list[Planned]:
        n = len(self.campaign.seed_list)
        return self.runs[cell * n : (cell + 1) * n]

    def sent(self, run: Planned, s: Scenario) -> SentParts | None:
        """The parts that a run's job takes along, those of installed packages that `s` names included."""
        return SentParts.of(effective(s, self.parts.parts(self.cells[run.cell].own)))

    def data(self, run: Planned) -> dict[str, Any]:
        """The run's scenario as plain data."""
        data = _with(self.cells[run.cell].data, run.draws, run.seed)
        return scenario.settled(data, self.campaign.name)[0].model_dump(mode="json")


def base(campaign: Campaign, folder: Path) -> Scenario:
    """The scenario that a campaign varies; a path is meant from `folder`, the campaign file's."""
    source = campaign.scenario
    if Path(source).suffix == ".toml":
        source = str(folder / source)
    said = scenario.tables(scenario.read(source), source)
    file = scenario.parse(placed(said, *scenario.homes(source)), source, keep_idle=True)
    data = file.model_dump(mode="json")
    asked = [_path(name, "set") for name in campaign.set]
    for path, value in zip(asked, campaign.set.values(), strict=True):
        assign(data, path, value)
    if named := _airframes(campaign):
        there = placed({"airframes": named}, folder, Path())
        data |= {"airframes_folder": there.get("airframes_folder", data["airframes_folder"])}
    # What has an effect in no cell is refused when all are known.
    data = scenario.without_foreign(data, asked)[0]
    return scenario.parse(data, "set" if campaign.set else source, keep_idle=True)


def _airframes(campaign: Campaign) -> list[str]:
    """The airframes that the campaign's own fields name: [set], the variants and the grid."""
    sets = (campaign.set, *campaign.variants.values())
    lists = [*(fields.get("airframes") for fields in sets), *campaign.grid.get("airframes", [])]
    return [name for names in lists if isinstance(names, list) for name in names]


def expand(
    campaign: Campaign,
    start: Scenario,
    code: str | None = None,
    airframes: Mapping[str, dict[str, str]] | None = None,
    parts: OwnParts | None = None,
) -> Plan:
    """All runs of `campaign` on the base scenario `start`.

    code       name of the code that flies them; None: this code's
    airframes  `Plan.airframes` of an earlier process; None: computed from the files as they are
    parts      the user's own: each flies in the cells whose axis names it, or in all if its role has no axis
    Raises UserError naming the axis, the cell or the seed whose scenario is refused, or a field set twice.
    """
    roles = {label: of["role"] for label, of in parts.origins.items()} if parts else {}
    parted = _parted(campaign, roles)
    always = everywhere(roles, parted, f"{campaign.name}: ")
    axes = _axes(campaign, parted)
    drawn = {".".join(_path(name, "random")): d for name, d in campaign.random.items()}
    _once(axes, drawn)
    seeds = campaign.seed_list
    count = len(seeds)
    for options in axes.values():
        count *= len(options)
    if count > MOST_RUNS:
        raise UserError(f"{campaign.name}: {count} runs are more than {MOST_RUNS}; thin an axis or the seeds")
    code, hashes = code or code_id(), AirframeHashes(airframes)
    cells, runs, variants = [], [], Variants()
    for number, chosen in enumerate(itertools.product(*(o.items() for o in axes.values()))):
        parameters = dict(zip(axes, (label for label, _ in chosen), strict=True))
        fields = dict(pair for _, fields in chosen for pair in fields.items())
        data = _cell_data(parameters, fields, campaign, start, drawn)
        label = _said({axis: v for axis, v in parameters.items() if len(axes[axis]) > 1}) or "all"
        here = {(role, parameters[_name(role)]) for role in parted}
        varied = (c.name for role, of in parted.items() for c in of if c.own and (role, c.name) in here)
        named = (*always, *varied)
        cells.append(Cell(number, parameters, label, data, named))
        given = parts.identity(named) if parts else {}
        for seed in seeds:
            draws = {path: draw(d, seed, path) for path, d in drawn.items()}
            if seed == seeds[0] or draws:
                where = _said(parameters | ({"seed": seed} if draws else {}), campaign.name)
                s = variants.add(_with(data, draws, seed), where)
                _decidable(campaign.guarantee, s, where)
                _tellable(campaign.requirements.values(), s, where)
                content, own = identity(s.model_dump(mode="json")), hashes.of(s)
                flown = [o] if (o := origins(effective(s)) | given) else []
            asked = [campaign.requirements] if campaign.requirements else []
            run = content_id([SCHEMA_VERSION, content | {"seed": seed}, code, own, *flown, *asked])
            runs.append(Planned(run, number, seed, draws))
    variants.refuse(campaign.name)
    return Plan(campaign, start, code, cells, runs, hashes.known, parts or OwnParts())


def _parted(campaign: Campaign, roles: Mapping[str, str]) -> dict[str, list[Choice]]:
    """Role -> the choices of its axis. roles: label -> role of the user's own parts."""
    said = {role: getattr(campaign, axis.name) for role, axis in AXES.items()}
    where = f"{campaign.name}: "
    return {r: choices(AXES[r], names, roles, where + AXES[r].name) for r, names in said.items() if names}


def _name(role: str) -> str:
    """The axis of a role, as tables call it."""
    return ".".join(AXES[role].field)


def _decidable(guarantee: str, s: Scenario, where: str) -> None:
    """UserError for a guarantee about pairs of which a scenario has none."""
    strangers = len(fleet.intruders(s))
    if guarantee == SEPARATION_INTRUDERS.id and not strangers:
        raise UserError(f"{where}: guarantee {guarantee!r}: no vehicle is an intruder (filter = false)")
    if guarantee == SEPARATION.id and strangers and s.vehicles - strangers < 2:
        raise UserError(
            f"{where}: guarantee {guarantee!r}: one vehicle under the filter has no pair;"
            f" say guarantee = {SEPARATION_INTRUDERS.id!r}"
        )


def _tellable(requirements: Iterable[str], s: Scenario, where: str) -> None:
    """UserError for a requirement that runs of a scenario cannot tell."""
    for text in requirements:
        try:
            Requirement(text).check(s)
        except UserError as error:
            raise UserError(f"{where}: {error}") from None


def _axes(campaign: Campaign, parted: Mapping[str, list[Choice]]) -> dict[str, dict[Any, Fields]]:
    """Axis -> label -> the fields it sets. Remedies' fields depend on the cell and come later."""
    axes: dict[str, dict[Any, Fields]] = {}
    for role, chosen in parted.items():
        axes[_name(role)] = {c.name: dict(c.fields) for c in chosen}
    if campaign.variants:
        axes["variant"] = {
            name: {_path(f, f"variants.{name}"): v for f, v in fields.items()}
            for name, fields in campaign.variants.items()
        }
    for name, values in campaign.grid.items():
        path = _path(name, "grid")
        dotted = ".".join(path)
        if dotted in axes:
            raise UserError(f"{campaign.name}: grid.{name}: {dotted} is an axis already")
        axes[dotted] = {_label(v): {path: v} for v in values}
        if len(axes[dotted]) < len(values):
            raise UserError(f"{campaign.name}: grid.{name}: a value is listed twice")
    if campaign.remedies:
        axes["remedy"] = {name: {} for name in campaign.remedies}
    return axes


def _cell_data(
    parameters: dict[str, Any], fields: Fields, campaign: Campaign, start: Scenario, drawn: Container[str]
) -> dict[str, Any]:
    """The scenario of a cell, its remedy's fields included; what remedies there are depends on the others."""
    data = start.model_dump(mode="json")
    for path, value in fields.items():
        assign(data, path, copy.deepcopy(value))
    if "remedy" not in parameters:
        return data
    name = parameters["remedy"]
    where = _said({axis: v for axis, v in parameters.items() if axis != "remedy"}, campaign.name)
    known = named_remedies.catalogue(scenario.settled(data, where)[0])
    if name not in known:
        raise UserError(f"{where}: remedies: {name!r} is unknown; {nearest(name, known)}")
    for dotted, value in known[name].items():
        path = tuple(dotted.split("."))
        if path in fields or dotted in drawn:
            raise UserError(f"{where}: {dotted} is set by remedy {name!r} and once more")
        assign(data, path, value)
    return data


def _said(parameters: dict[str, Any], *before: str) -> str:
    return ", ".join([*before, *(f"{axis} {short(str(value))}" for axis, value in parameters.items())])


def _with(data: dict[str, Any], draws: dict[str, Any], seed: int) -> dict[str, Any]:
    """A cell's plain data with what one run draws."""
    made = copy.deepcopy(data) | {"seed": seed}
    for path, value in draws.items():
        assign(made, tuple(path.split(".")), value)
    return made


def _path(name: str, where: str) -> tuple[str, ...]:
    path = field_path(name, f"{where}.")
    if path == ("seed",):
        raise UserError(f"{where}.seed: say seeds and first_seed")
    return path


def _once(axes: dict[str, dict[Any, Fields]], drawn: dict[str, Any]) -> None:
    """UserError if two axes, or an axis and a distribution, set one field."""
    setters: dict[str, str] = {}
    claims = [(".".join(p), axis) for axis, o in axes.items() for fields in o.values() for p in fields]
    for path, by in itertools.chain(claims, ((path, "random") for path in drawn)):
        if setters.setdefault(path, by) != by:
            raise UserError(f"{path}: set by both {setters[path]} and {by}")


def _label(value: Any) -> Any:
    """A grid's value as a parameter: numbers, words and truth as they are, lists as text."""
    return value if isinstance(value, bool | int | float | str) else repr(value)


def rounds(plan: Plan) -> Iterator[tuple[int, int]]:
    """(from, to) places in the list of seeds between looks; one round without a stopping rule."""
    looks = plan.campaign.stop.looks if plan.campaign.stop else [len(plan.campaign.seed_list)]
    return itertools.pairwise([0, *looks])
