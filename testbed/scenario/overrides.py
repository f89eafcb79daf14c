"""Sets fields of scenarios by name: finds what a name means, reads values, changes plain data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from aircraft.textfile import parse_toml
from testbed.errors import UserError, nearest, short
from testbed.scenario.spelling import table_of, today

Path = tuple[str, ...]
# Lists of tables whose entries a message names by their numbers, from 1: fence.2.radius_m.
NUMBERED = ("fence",)


def meanings(tables: Mapping[str, Iterable[str]]) -> dict[str, list[Path]]:
    """Every name an override may use -> the paths it can mean.

    tables  a scenario's own field -> the fields in it, where it is a table; nothing where it is none
    """
    paths: dict[str, list[Path]] = {}
    for name, fields in tables.items():
        inner = list(fields)
        if not inner:
            paths.setdefault(name, []).append((name,))
        for leaf in inner:
            paths.setdefault(leaf, []).append((name, leaf))
            paths[f"{name}.{leaf}"] = [(name, leaf)]
    for name in tables:  # a whole table, unless a field has its name
        paths.setdefault(name, [(name,)])
    return paths


def resolve(name: str, paths: Mapping[str, list[Path]], where: str = "") -> Path:
    """The path that a field's whole or last name means; UserError, begun by `where`, if there is none."""
    found = paths.get(name)
    if found is None:
        raise UserError(f"{where}{short(name)}: unknown field; {nearest(name, paths)}")
    # A field of the scenario itself wins over one of the same name in a table.
    path = min(found, key=len)
    if sum(len(p) == len(path) for p in found) > 1:
        raise UserError(f"{where}{name}: could be " + " or ".join(".".join(p) for p in found))
    return path


def read_value(text: str) -> Any:
    """A value as TOML writes it (`[0, 1]`, `true`, `20`), or else a plain word."""
    try:
        read = parse_toml(f"value = {text}")
    except ValueError:
        return text.strip()
    # A text of several lines would be several fields, and all but the first dropped.
    return read["value"] if len(read) == 1 else text.strip()


def assign(data: dict[str, Any], path: Path, value: Any) -> None:
    """Set the field at `path` in a scenario's plain data; path and value may have an older spelling."""
    path = today(path)
    if len(path) == 1:
        value = table_of(path[0], value)
    target = data
    for part in path[:-1]:
        target = target.setdefault(part, {})
        if not isinstance(target, dict):
            raise UserError(f"{part}: must be a table")
    target[path[-1]] = value


def remove(data: dict[str, Any], path: str) -> None:
    """Leave out the field at a dotted path of a scenario's plain data."""
    *tables, leaf = path.split(".")
    inner = data
    for table in tables:
        inner = inner[table]
    del inner[leaf]


def is_within(path: str, asked: Sequence[Path]) -> bool:
    """Whether one of the paths is a field, given dotted, or the table that it is in."""
    parts = tuple(path.split("."))
    return any(parts[: len(one)] == one for one in asked)
