"""Finds out what a part of a run is: its Python name, its source file, and the checksum of its source."""

from __future__ import annotations

import ast
import functools
import hashlib
import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Origin:
    """Where a part comes from.

    name       Python name of its maker, or what it is in words
    file       name of the source file, without its folder; None where there is none
    sha256     of that file's bytes, or of the source text where there is no file; of all sources of an
               installed package; None where none can be had
    arguments  keyword -> value as Python writes it, of the arguments that the user gave
    imports    file beside it -> SHA-256, of the modules that it imports from there
    package    name and version of the installed package that it comes from; "" if from none
    """

    name: str
    file: str | None = None
    sha256: str | None = None
    arguments: Mapping[str, str] = field(default_factory=dict)
    imports: Mapping[str, str] = field(default_factory=dict)
    package: str = ""

    def to_json(self) -> dict[str, Any]:
        """As the manifest has it; what is empty is left out."""
        said: dict[str, Any] = {"name": self.name, "file": self.file, "sha256": self.sha256}
        more = {"arguments": dict(self.arguments), "imports": dict(self.imports), "package": self.package}
        return said | {key: value for key, value in more.items() if value}


def origin(maker: Any) -> Origin:
    """Where a maker of a part (a class, a function, anything callable) comes from."""
    arguments: dict[str, str] = {}
    while isinstance(maker, functools.partial):
        arguments = _literals(maker) | arguments
        maker = maker.func
    made = maker if hasattr(maker, "__qualname__") else type(maker)
    name = f"{getattr(made, '__module__', '?')}.{made.__qualname__}"
    try:
        file = Path(inspect.getsourcefile(made) or "")
        if file.is_file():
            return Origin(name, file.name, hashlib.sha256(file.read_bytes()).hexdigest(), arguments)
        text = inspect.getsource(made).encode()
        return Origin(name, None, hashlib.sha256(text).hexdigest(), arguments)
    except (OSError, TypeError):  # built in, or made at a prompt
        return Origin(name, arguments=arguments)


def _literals(partial: functools.partial[Any]) -> dict[str, str]:
    """The arguments of a partial function that are literals; a repr of others may differ in every process."""
    given = {str(place): value for place, value in enumerate(partial.args)} | partial.keywords
    return {name: repr(value) for name, value in given.items() if is_literal(value)}


def is_literal(value: Any) -> bool:
    """Whether Python reads back from its text what a value is."""
    try:
        return bool(ast.literal_eval(repr(value)) == value)
    except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
        return False
