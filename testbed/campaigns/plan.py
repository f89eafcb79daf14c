"""Expands a campaign into its runs: cells times seeds, each run with an id of what it depends on."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from testbed.campaigns import named_remedies
from testbed.campaigns.bases import AXIS, Base, groups, path_within, seeds_of
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
from testbed.scenario.location import identity
from testbed.scenario.overrides import assign
from testbed.scenario.scenario import Scenario
from testbed.scenario.variants import Variants

Fields = dict[tuple[str, ...], Any]


@dataclass(frozen=True)
class Cell:
    """One combination of the axes' values.

    parameters  axis -> value, as the tables show it
    label       of the axes that have more than one value
    fields      number of a base -> what the cell sets in it; of those that it flies
    own         labels of the user's own parts that fly in it
    """

    number: int
    parameters: dict[str, Any]
    label: str
    fields: dict[int, Fields]
    own: tuple[str, ...] = ()


@dataclass(frozen=True)
class Planned:
    """One run: `id` is the hash of its resolved scenario, the code, the airframes' files and own parts.

    base  number of the scenario or encounter that it flies
    """

    id: str
    cell: int
    seed: int
    draws: dict[str, Any]
    base: int = 0


@dataclass
class Plan:
    """Every run there may be, cell by cell in the axes' order, encounter by encounter and seed by seed.

    bases      the scenario that it varies, or the encounters
    airframes  checksums of the airframes used, see `AirframeHashes.known`
    parts      the user's own
    """

    campaign: Campaign
    bases: Sequence[Base]
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

        self._first = [0]
        for cell in self.cells:
            self._first.append(self._first[-1] + len(cell.fields) * len(self.campaign.seed_list))

    def of(self, cell: int) -> list[Planned]:
        return self.runs[self._first[cell] : self._first[cell + 1]]

    @property
    def longest(self) -> int:
        """The most runs of a cell."""
        return max(b - a for a, b in itertools.pairwise(self._first))

    def varied(self, cell: Cell, base: int) -> dict[str, Any]:
        """The plain data of a base as a cell flies it, but for seed and draws."""
        return _set(self.bases[base].scenario, cell.fields[base])

    def sent(self, run: Planned, s: Scenario) -> SentParts | None:
        """The parts that a run's job takes along, those of installed packages that `s` names included."""
        return SentParts.of(effective(s, self.parts.parts(self.cells[run.cell].own)))

    def data(self, run: Planned) -> dict[str, Any]:
        """The run's scenario as plain data."""
        data = _with(self.varied(self.cells[run.cell], run.base), run.draws, run.seed)
        return scenario.settled(data, self.campaign.name)[0].model_dump(mode="json")


def expand(
    campaign: Campaign,
    bases: Sequence[Base],
    code: str | None = None,
    airframes: Mapping[str, dict[str, str]] | None = None,
    parts: OwnParts | None = None,
) -> Plan:
    """All runs of `campaign` on its bases, as `bases.bases` reads them.

    code       name of the code that flies them; None: this code's
    airframes  `Plan.airframes` of an earlier process; None: computed from the files as they are
    parts      the user's own: each flies in the cells whose axis names it, or in all if its role has no axis
    Raises UserError naming the axis, the cell or the seed whose scenario is refused, or a field set twice.
    """
    roles = {label: of["role"] for label, of in parts.origins.items()} if parts else {}
    parted = _parted(campaign, roles)
    always = everywhere(roles, parted, f"{campaign.name}: ")
    axes = _axes(campaign, parted)
    drawn = {".".join(path_within(name, "random")): d for name, d in campaign.random.items()}
    _once(axes, drawn)
    sets = groups(bases)
    count = len(bases) * len(campaign.seed_list)
    for options in axes.values():
        count *= len(options)
    if count > MOST_RUNS:
        raise UserError(f"{campaign.name}: {count} runs are more than {MOST_RUNS}; thin an axis or the seeds")
    if campaign.encounters:
        of_sets: dict[str, dict[Any, Fields]] = {AXIS: {label: {} for label in sets}}
        axes = of_sets | axes
    code, hashes = code or code_id(), AirframeHashes(airframes)
    measures = [campaign.measures.settings().data()] if campaign.measures else []
    cells, runs, variants = [], [], Variants()
    for number, chosen in enumerate(itertools.product(*(o.items() for o in axes.values()))):
        parameters = dict(zip(axes, (label for label, _ in chosen), strict=True))
        fields = dict(pair for _, fields in chosen for pair in fields.items())
        label = _said({axis: v for axis, v in parameters.items() if len(axes[axis]) > 1}) or "all"
        here = {(role, parameters[_name(role)]) for role in parted}
        varied = (c.name for role, of in parted.items() for c in of if c.own and (role, c.name) in here)
        named = (*always, *varied)
        cells.append(Cell(number, parameters, label, {}, named))
        given = parts.identity(named) if parts else {}
        for k in sets[parameters.get(AXIS, "")]:
            start = bases[k]
            cells[-1].fields[k] = _cell_fields(parameters, fields, campaign, start.scenario, drawn)
            data = _set(start.scenario, cells[-1].fields[k])
            at = parameters | ({"file": start.file} if start.file else {})
            seeds = seeds_of(campaign, start)
            for seed in seeds:
                draws = {path: draw(d, seed, path) for path, d in drawn.items()}
                if seed == seeds[0] or draws:
                    where = _said(at | ({"seed": seed} if draws else {}), campaign.name)
                    s = variants.add(_with(data, draws, seed), where)
                    _decidable(campaign.guarantee, s, where)
                    _tellable(campaign.requirements.values(), s, where)
                    content, own = identity(s.model_dump(mode="json")), hashes.of(s)
                    flown = [o] if (o := origins(effective(s)) | given) else []
                asked = [campaign.requirements] if campaign.requirements else []
                asked += measures
                run = content_id([SCHEMA_VERSION, content | {"seed": seed}, code, own, *flown, *asked])
                runs.append(Planned(run, number, seed, draws, k))
    variants.refuse(campaign.name)
    return Plan(campaign, bases, code, cells, runs, hashes.known, parts or OwnParts())


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
            name: {path_within(f, f"variants.{name}"): v for f, v in fields.items()}
            for name, fields in campaign.variants.items()
        }
    for name, values in campaign.grid.items():
        path = path_within(name, "grid")
        dotted = ".".join(path)
        if dotted in axes:
            raise UserError(f"{campaign.name}: grid.{name}: {dotted} is an axis already")
        axes[dotted] = {_label(v): {path: v} for v in values}
        if len(axes[dotted]) < len(values):
            raise UserError(f"{campaign.name}: grid.{name}: a value is listed twice")
    if campaign.remedies:
        axes["remedy"] = {name: {} for name in campaign.remedies}
    return axes


def _cell_fields(
    parameters: dict[str, Any], fields: Fields, campaign: Campaign, start: Scenario, drawn: Container[str]
) -> Fields:
    """What a cell sets, its remedy's fields included; what remedies there are depends on the others."""
    if "remedy" not in parameters:
        return fields
    name = parameters["remedy"]
    where = _said({axis: v for axis, v in parameters.items() if axis != "remedy"}, campaign.name)
    known = named_remedies.catalogue(scenario.settled(_set(start, fields), where)[0])
    if name not in known:
        raise UserError(f"{where}: remedies: {name!r} is unknown; {nearest(name, known)}")
    for dotted in known[name]:
        if tuple(dotted.split(".")) in fields or dotted in drawn:
            raise UserError(f"{where}: {dotted} is set by remedy {name!r} and once more")
    return fields | {tuple(dotted.split(".")): value for dotted, value in known[name].items()}


def _set(start: Scenario, fields: Fields) -> dict[str, Any]:
    """The plain data of a base with a cell's fields set."""
    data = start.model_dump(mode="json")
    for path, value in fields.items():
        assign(data, path, copy.deepcopy(value))
    return data


def _said(parameters: dict[str, Any], *before: str) -> str:
    return ", ".join([*before, *(f"{axis} {short(str(value))}" for axis, value in parameters.items())])


def _with(data: dict[str, Any], draws: dict[str, Any], seed: int) -> dict[str, Any]:
    """A cell's plain data with what one run draws."""
    made = copy.deepcopy(data) | {"seed": seed}
    for path, value in draws.items():
        assign(made, tuple(path.split(".")), value)
    return made


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
    """(from, to) places among a cell's runs between looks; one round without a stopping rule."""
    looks = plan.campaign.stop.looks if plan.campaign.stop else [plan.longest]
    return itertools.pairwise([0, *looks])
