"""Reads how a part of the user's own is written: `[ROLE=]FILE.py:NAME(ARGUMENTS)`, or an installed NAME."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from testbed.errors import UserError, nearest, short

ROLES = ("plant", "filter", "guidance", "environment")
EXAMPLE = "write FILE.py:NAME, for example my_parts.py:Cone or 'my_parts.py:Cone(gain=2)'"
LONGEST_TEXT = 4000
_FORM = re.compile(r"(?:(?P<file>.+?\.py):)?(?P<name>[^\W\d][\w.-]*)\s*(?P<arguments>\(.*\))?", re.DOTALL)
_PREFIX = re.compile(r"(?P<role>[a-z]+)=(?P<rest>.+)", re.DOTALL)


@dataclass(frozen=True)
class Written:
    """A part as it was written.

    role       the role said before it, or None
    file       path of its file; None names an installed part
    name       of the class or function, or of the installed part
    arguments  keyword -> value
    """

    role: str | None
    file: str | None
    name: str
    arguments: dict[str, Any]

    @property
    def where(self) -> str:
        """File and name, as messages call it."""
        return f"{self.file}:{self.name}" if self.file else self.name


def written(text: str) -> Written:
    """The part that `text` names.

    Raises UserError where it is not written so, or an argument is no literal or has no name.
    """
    if len(text) > LONGEST_TEXT:
        raise UserError(f"--parts {short(text)}: longer than {LONGEST_TEXT} letters")
    role, rest = None, text.strip()
    if (prefix := _PREFIX.fullmatch(rest)) is not None and "(" not in prefix["role"]:
        role, rest = prefix["role"], prefix["rest"].strip()
        if role not in ROLES:
            raise UserError(f"--parts {short(text)}: no role {role!r}; {nearest(role, ROLES)}")
    found = _FORM.fullmatch(rest)
    if found is None:
        raise UserError(f"--parts {short(text)!r}: {EXAMPLE}")
    return Written(role, found["file"], found["name"], _arguments(found["arguments"] or "()", short(text)))


def label(name: str, arguments: Mapping[str, Any]) -> str:
    """What tables and campaign axes call a part: its name, with its arguments if it has any."""
    return name + (f"({said(arguments)})" if arguments else "")


def said(arguments: Mapping[str, Any]) -> str:
    """Arguments as they are written."""
    return ", ".join(f"{name}={value!r}" for name, value in arguments.items())


def split(text: str) -> list[str]:
    """The parts of a list with commas between; commas in brackets and quotes belong to arguments."""
    found, depth, quote, start = [], 0, "", 0
    for k, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "'\"":
            quote = letter
        else:
            depth += (letter in "([{") - (letter in ")]}")
            if letter == "," and depth <= 0:
                found.append(text[start:k])
                start = k + 1
    return [part for item in [*found, text[start:]] if (part := item.strip())]


def _arguments(text: str, where: str) -> dict[str, Any]:
    try:
        call = ast.parse(f"_{text}", mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        call = None
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
        raise UserError(f"--parts {where!r}: its arguments cannot be read; {EXAMPLE}")
    if call.args:
        raise UserError(f"--parts {where}: give arguments by name, for example NAME(gain=2)")
    values: dict[str, Any] = {}
    for keyword in call.keywords:
        if keyword.arg is None:
            raise UserError(f"--parts {where}: give arguments one by one, not by **")
        if keyword.arg in values:
            raise UserError(f"--parts {where}: {keyword.arg} is given twice")
        try:
            values[keyword.arg] = ast.literal_eval(keyword.value)
        except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
            raise UserError(
                f"--parts {where}: {keyword.arg} is not a literal; give a number, text, truth value, None,"
                " or a list, tuple or dict of them"
            ) from None
    return values
