"""Finds out what a part of a run is: its Python name, its source file, and the checksum of its source."""

from __future__ import annotations

import functools
import hashlib
import inspect
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Origin:
    """Where a part comes from.

    name    Python name of its maker, or what it is in words
    file    name of the source file, without its folder; None where there is none
    sha256  of that file's bytes, or of the source text where there is no file; None where neither can be had
    """

    name: str
    file: str | None = None
    sha256: str | None = None

    def to_json(self) -> dict[str, str | None]:
        return asdict(self)


def origin(maker: Any) -> Origin:
    """Where a maker of a part (a class, a function, anything callable) comes from."""
    while isinstance(maker, functools.partial):
        maker = maker.func
    made = maker if hasattr(maker, "__qualname__") else type(maker)
    name = f"{getattr(made, '__module__', '?')}.{made.__qualname__}"
    try:
        file = Path(inspect.getsourcefile(made) or "")
        if file.is_file():
            return Origin(name, file.name, hashlib.sha256(file.read_bytes()).hexdigest())
        return Origin(name, None, hashlib.sha256(inspect.getsource(made).encode()).hexdigest())
    except (OSError, TypeError):  # built in, or made at a prompt
        return Origin(name)
