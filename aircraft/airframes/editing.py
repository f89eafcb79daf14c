"""Edits TOML files of airframes and gains in place: comments and everything else stay as they are."""

from __future__ import annotations

import re
from collections.abc import Mapping

_NEXT_TABLE = r"^\s*\["


def set_values(text: str, table: str, values: Mapping[str, str]) -> str:
    """`text` with `values` (key -> TOML) in [table]: existing lines keep their comments, others are appended.

    Raises  ValueError if there is no such table
    """
    lines = text.splitlines()
    heads = [k for k, line in enumerate(lines) if re.match(rf"\s*\[{re.escape(table)}\]", line)]
    if not heads:
        raise ValueError(f"there is no table [{table}]")
    left, last = dict(values), heads[0]
    for k in range(heads[0] + 1, len(lines)):
        if re.match(_NEXT_TABLE, lines[k]):
            break
        if found := re.match(r"\s*(\w+)\s*=\s*([^#]*?)\s*(?:#.*)?$", lines[k]):
            last = k
            if found[1] in left:
                begin, end = found.span(2)
                lines[k] = lines[k][:begin] + left.pop(found[1]) + lines[k][end:]
    lines[last + 1 : last + 1] = [f"{key} = {value}" for key, value in left.items()]
    return "\n".join([*lines, ""])


def replace_tables(text: str, name: str, tables: str) -> str:
    """`text` with [name] and all [name.*] replaced by `tables`, at the place of the first; else appended."""
    lines = text.splitlines(keepends=True)
    kept: list[str] = []
    at, inside = None, False
    for line in lines:
        if re.match(_NEXT_TABLE, line):
            inside = re.match(rf"\s*\[{re.escape(name)}[\].]", line) is not None
            if inside and at is None:
                at = len(kept)
        if inside and line.lstrip().startswith("#") and not re.match(_NEXT_TABLE, line):
            inside = False  # a comment before the next table belongs to that
        if not inside:
            kept.append(line)
    if at is None:
        return text.rstrip("\n") + "\n\n" + tables.strip("\n") + "\n"
    rest = "".join(kept[at:])
    return "".join(kept[:at]) + tables.strip("\n") + "\n" + ("\n" + rest if rest else "")
