"""Makes values plain for JSON, computes checksums, and reads JSON files that may be damaged."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from testbed.errors import UserError


def plain(value: Any) -> Any:
    """`value` with numpy scalars and arrays as plain ones and non-finite numbers as None, for JSON."""
    if isinstance(value, Mapping):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def sha256(path: Path) -> str:
    """Checksum of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def seal(value: dict[str, Any]) -> str:
    """Checksum of what JSON says, however it is written."""
    text = json.dumps(plain(value), sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def sealed(value: dict[str, Any]) -> dict[str, Any]:
    """`value` with the checksum of itself."""
    return value | {"sha256": seal(value)}


def read_json(path: Path, kind: type = dict) -> Any:
    """What the file says; UserError in one line if that is not JSON of that kind."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path} is damaged: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path} is damaged: {error}") from None
    if not isinstance(said, kind):
        raise UserError(f"{path} is damaged: no JSON {kind.__name__}")
    return said
