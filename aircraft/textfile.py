"""TOML files from anybody, read without trusting them: ordinary files of bounded size, one line of error."""

from __future__ import annotations

import stat
import tomllib
from pathlib import Path
from typing import Any

# A scenario that lists a thousand vehicles one by one has 0.2 MB.
LARGEST_BYTES = 2_000_000


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises  FileNotFoundError; ValueError saying in one line what is wrong with the file, without its name
    """
    try:
        found = path.stat()
        # A pipe or a device would be waited for, or never end.
        if not stat.S_ISREG(found.st_mode):
            raise ValueError("is not an ordinary file")
        if found.st_size > LARGEST_BYTES:
            raise ValueError(f"is larger than {LARGEST_BYTES / 1e6:g} MB")
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"is not UTF-8 text, from byte {error.start} on") from None
    return parse_toml(text)


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text; raises ValueError, in one line, for whatever is none."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"not valid TOML: {error}") from None
    except RecursionError:
        raise ValueError("not valid TOML: arrays or tables nested too deeply") from None
    except ValueError:  # what Python says of an integer of thousands of digits
        raise ValueError("not valid TOML: a number with too many digits") from None
