"""Reads older spellings of scenario fields: [nominal] with `controller` is now [guidance] with `kind`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from testbed.errors import Mistake, UserError

# Older name -> today's: of tables, and of fields in a table of today's name.
TABLES = {"nominal": "guidance"}
FIELDS = {"guidance": {"controller": "kind"}}
# A field's last part alone, as overrides may name it.
ALONE = {"controller": ("guidance", "kind")}


def current(data: Mapping[str, Any]) -> dict[str, Any]:
    """A scenario's plain data in today's spelling; what is spelt so already is left as it is.

    Raises UserError where a table is there under both names.
    """
    found: dict[str, Any] = {}
    for name, value in data.items():
        table = TABLES.get(name, name)
        if table != name and table in data:
            raise UserError(Mistake(f"is the older name of {table}, which is there too; leave it out", name))
        found[table] = table_of(table, value)
    return found


def table_of(table: str, value: Any) -> Any:
    """One table's plain data in today's spelling."""
    renamed = FIELDS.get(table)
    if not renamed or not isinstance(value, dict):
        return value
    # One that is there under both names is left, and refused as unknown.
    return {name if (new := renamed.get(name, name)) in value else new: v for name, v in value.items()}


def today(path: tuple[str, ...]) -> tuple[str, ...]:
    """A field's path in today's spelling."""
    table = TABLES.get(path[0], path[0])
    return (table, *(FIELDS.get(table, {}).get(leaf, leaf) for leaf in path[1:2]), *path[2:])


def older(path: tuple[Any, ...]) -> list[tuple[Any, ...]]:
    """The paths under which older files say what is at `path` today."""
    if not path:
        return []
    heads = [path[0], *(old for old, new in TABLES.items() if new == path[0])]
    leaves = [old for old, new in FIELDS.get(path[0], {}).items() if path[1:2] == (new,)]
    rests = [path[1:], *((old, *path[2:]) for old in leaves)]
    return [found for head in heads for rest in rests if (found := (head, *rest)) != path]
