"""Turns pydantic's errors into mistakes: the path of the field, what is wrong, the remedy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from pydantic import ValidationError

from testbed.errors import Mistake, nearest, short
from testbed.scenario.fields import Section
from testbed.scenario.installed import names
from testbed.scenario.kinds import INSTALLED, Kinds
from testbed.scenario.overrides import NUMBERED

# What pydantic adds to a path where a field may be of two types.
_TYPES = {"float", "constrained-float", "list[float]", "list[constrained-float]", "function-after"}


def explain(
    error: ValidationError, model: type[Section], kinds: Mapping[str, Kinds] | None = None
) -> list[Mistake]:
    """What pydantic found wrong with the data of `model`, without repetitions.

    kinds  the tables of `model`, and lists of tables, that come in kinds, by name
    """
    return list(dict.fromkeys(_explain(e, model, kinds or {}) for e in error.errors()))


def _explain(error: Any, model: type[Section], known: Mapping[str, Kinds]) -> Mistake:
    where = [p for p in error["loc"] if p not in _TYPES]
    listed = len(where) > 1 and where[0] in NUMBERED and isinstance(where[1], int)
    if listed:
        where[1] += 1
    kinds, tag = known.get(str(where[0])) if where else None, ""
    inside = 2 if listed else 1  # where the path inside the table begins
    if kinds is None and listed and len(where) > 2:  # a table in an entry of a list of tables
        kinds, inside = known.get(str(where[2])), 3
    if kinds is not None and len(where) > inside and where[inside] in (*kinds.models, INSTALLED):
        tag = str(where.pop(inside))
    *parents, last = where or [""]
    path = short(".".join(map(str, [*parents, last])))
    if error["type"] == "extra_forbidden":
        if kinds is not None and len(parents) == inside and kinds.takers(str(last)):
            return Mistake(kinds.refusal(str(last), tag), path)
        fields = (
            _fields_at(parents[inside:], kinds.models[tag])
            if kinds and tag in kinds.models
            else _fields_at(parents, model)
        )
        return Mistake("unknown field", path, remedy=nearest(str(last), fields))
    if kinds is not None and error["type"].startswith("union_tag"):
        return _unknown_kind(path, kinds, error["input"])
    message = error["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    if not where:
        return _of_whole(message, model)
    if error["type"] == "list_type":
        message = f"write a list, such as {path}=[{short(repr(error['input']))}]"
    got = f", got {short(repr(error['input']))}" if path and not isinstance(error["input"], dict) else ""
    return Mistake(message + got, path)


def _of_whole(message: str, model: type[Section]) -> Mistake:
    """What a check of the whole scenario found; it begins with the field, where it is about one."""
    field, colon, said = message.partition(": ")
    known = colon and field.split(".")[0] in model.model_fields and " " not in field
    return Mistake(said, field) if known else Mistake(message)


def _unknown_kind(path: str, kinds: Kinds, data: Any) -> Mistake:
    if not isinstance(data, dict):
        return Mistake(f"must be a table, got {short(repr(data))}", path)
    known = list(dict.fromkeys(tag.partition(", ")[0] for tag in kinds.models))
    known += names(kinds.role) if kinds.role else []
    words = ", ".join(map(repr, known[:-1])) + f" or {known[-1]!r}"
    return Mistake(f"input should be {words}, got {short(repr(data.get(kinds.key)))}", f"{path}.{kinds.key}")


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
