"""Tells what a name in a list of plants, filters or guidance means: a built-in kind, or a user's part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from testbed.components import named_parts
from testbed.components.named_parts import NamedPart
from testbed.errors import UserError, short
from testbed.scenario import installed
from testbed.scenario.control import FILTERS
from testbed.scenario.guidance import GUIDANCES
from testbed.scenario.variants import EVERY_PLANT


@dataclass(frozen=True)
class Axis:
    """One part of a run that is varied.

    role   "plant", "filter" or "guidance"
    name   of the list of its names, as options and campaign files call it
    field  of the scenario that says its kind
    kinds  of the catalogue
    """

    role: str
    name: str
    field: tuple[str, ...]
    kinds: tuple[str, ...]


AXES = {
    axis.role: axis
    for axis in (
        Axis("plant", "plants", ("plant",), EVERY_PLANT),
        Axis("filter", "filters", ("filter", "kind"), tuple(FILTERS.models)),
        Axis("guidance", "guidance", ("guidance", "kind"), tuple(GUIDANCES.models)),
    )
}


@dataclass(frozen=True)
class Choice:
    """One name of an axis.

    name    as tables show it
    fields  of the scenario that it sets, by path
    own     whether it names a part of the user's own, of that label
    """

    name: str
    fields: Mapping[tuple[str, ...], str]
    own: bool = False


def choices(axis: Axis, names: Sequence[str], roles: Mapping[str, str], where: str) -> list[Choice]:
    """What the names of an axis mean, in their order.

    roles   label -> role of the parts that `--parts` brings
    where   the list, as messages call it
    Raises  UserError for a name that is neither a kind, nor installed, nor brought; or that is listed twice
    """
    own = [label for label, role in roles.items() if role == axis.role]
    if not names:
        raise UserError(f"{where}: name at least one {axis.role}")
    found = []
    for name in names:
        if name in own:
            found.append(Choice(name, {}, own=True))
        elif name in axis.kinds or name in installed.names(axis.role):
            found.append(Choice(name, {axis.field: name}))
        else:
            known = [*axis.kinds, *installed.names(axis.role), *own]
            listed = "; ".join(known) if any("," in n for n in known) else ", ".join(known)
            hint = f"there is {listed}, and with --parts FILE.py:NAME one of your own"
            raise UserError(f"{where}: there is no {axis.role} {short(name)!r}; {hint}")
    twice = [name for name in names if list(names).count(name) > 1]
    if twice:
        raise UserError(f"{where}: {short(twice[0])!r} is listed twice")
    return found


def with_files(axis: Axis, text: str, named: Sequence[NamedPart]) -> tuple[list[str], list[NamedPart]]:
    """The names of a list that a person typed, `centralised,my_parts.py:Cone`, and the parts it names itself.

    named   the parts that `--parts` brings: what the list names again is that part
    """
    items = named_parts.split(text)
    texts = [item for item in items if ".py:" in item]
    known = {(part.label, part.origin.sha256): part for part in named}
    parts = named_parts.read(_with_role(axis, item) for item in texts)
    for item, part in zip(texts, parts, strict=True):
        if part.role != axis.role:
            raise UserError(f"--{axis.name} {item}: it is a {part.role}, not a {axis.role}")
    labels = dict(zip(texts, (part.label for part in parts), strict=True))
    new = [part for part in parts if (part.label, part.origin.sha256) not in known]
    return [labels.get(item, item) for item in items], new


def _with_role(axis: Axis, text: str) -> str:
    """The text of one part, with the axis's role before it where the code alone does not tell the role."""
    try:
        named_parts.read([text])
    except UserError:
        return text if text.startswith(f"{axis.role}=") else f"{axis.role}={text}"
    return text


def everywhere(roles: Mapping[str, str], axes: Mapping[str, Sequence[Choice]], where: str) -> list[str]:
    """Labels of the parts whose role is not varied: they fly in every combination.

    roles   label -> role of the parts that `--parts` brings
    axes    role -> its choices
    where   begins the name of the list to be mended, "--" or "campaign: "
    Raises  UserError for a part whose role is varied and that no list names
    """
    for label, role in roles.items():
        if role in axes and label not in [choice.name for choice in axes[role] if choice.own]:
            raise UserError(f"--parts {label}: {where}{AXES[role].name} does not name it; add it there")
    return [label for label, role in roles.items() if role not in axes]
