"""Sets fields of scenarios by name: finds what a name means, reads values, changes plain data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from aircraft.textfile import parse_toml
from testbed.errors import UserError, nearest, short
from testbed.scenario.spelling import table_of, today

Path = tuple[str, ...]
# Lists of tables whose entries paths and messages name by their numbers, from 1: vehicle.2.speed_mps.
NUMBERED = ("fence", "vehicle")


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
    list_, _, rest = name.partition(".")
    if list_ in NUMBERED and rest:
        return _of_numbered(list_, rest, paths, where)
    found = paths.get(name)
    if found is None:
        raise UserError(f"{where}{short(name)}: unknown field; {nearest(name, paths)}")
    # A field of the scenario itself wins over one of the same name in a table.
    path = min(found, key=len)
    if sum(len(p) == len(path) for p in found) > 1:
        raise UserError(f"{where}{name}: could be " + " or ".join(".".join(p) for p in found))
    return path


def _of_numbered(name: str, rest: str, paths: Mapping[str, list[Path]], where: str) -> Path:
    """The path of `vehicle.NUMBER.FIELD`; the fields of the tables are known as `vehicle.*.FIELD`."""
    number, _, field = rest.partition(".")
    if not (number.isascii() and number.isdigit() and field):
        said = short(f"{name}.{rest}")
        raise UserError(f"{where}{said}: write {name}.NUMBER.FIELD, such as {name}.2.filter")
    known = {path.removeprefix(f"{name}.*."): path for path in paths if path.startswith(f"{name}.*.")}
    if field not in known:
        raise UserError(f"{where}{short(f'{name}.{rest}')}: unknown field; {nearest(field, known)}")
    return (name, number.lstrip("0") or "0", *field.split("."))


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
    for k, part in enumerate(path[:-1]):
        if isinstance(target, list):
            target = _numbered(target, path[:k], part)
        else:
            target = target.setdefault(part, [] if part in NUMBERED else {})
        if not isinstance(target, dict | list):
            raise UserError(f"{part}: must be a table")
    target[path[-1]] = value


def _numbered(tables: list[Any], where: Path, number: str) -> Any:
    """The table of a list that has a number, from 1."""
    if not 1 <= int(number) <= len(tables):
        name, have = ".".join(where), f"{len(tables)} [[{'.'.join(where)}]] tables" if tables else "none"
        raise UserError(f"{name}.{number}: there is no such table; the scenario has {have}")
    return tables[int(number) - 1]


def remove(data: dict[str, Any], path: str) -> None:
    """Leave out the field at a dotted path of a scenario's plain data."""
    *tables, leaf = path.split(".")
    inner: Any = data
    for table in tables:
        inner = inner[int(table) - 1] if isinstance(inner, list) else inner[table]
    del inner[leaf]


def is_within(path: str, asked: Sequence[Path]) -> bool:
    """Whether one of the paths is a field, given dotted, or the table that it is in."""
    parts = tuple(path.split("."))
    return any(parts[: len(one)] == one for one in asked)
