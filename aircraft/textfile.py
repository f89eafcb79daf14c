"""Reads untrusted text and TOML files: of bounded size, in any usual encoding, with errors in one line."""

from __future__ import annotations

import re
import stat
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

# A scenario that lists a thousand vehicles one by one has 0.2 MB.
LARGEST_BYTES = 2_000_000
# Byte order marks that editors and Windows write, the longer ones first.
MARKS = (
    (b"\xff\xfe\x00\x00", "utf-32-le"),
    (b"\x00\x00\xfe\xff", "utf-32-be"),
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)
_WHERE = re.compile(r" \(at line (\d+), column \d+\)$")
_HEADER = re.compile(r"\[(\[?)\s*([^\[\]]+?)\s*\]")
_KEY = re.compile(r"((?:[\w-]+|\"[^\"]*\"|'[^']*')(?:\s*\.\s*(?:[\w-]+|\"[^\"]*\"|'[^']*'))*)\s*=")


class TextError(ValueError):
    """What is wrong with a text file, in one line and without its name; `line` is from 1, or None."""

    def __init__(self, message: str, line: int | None = None) -> None:
        super().__init__(message)
        self.line = line


def read_text(path: Path, largest: int = LARGEST_BYTES) -> str:
    """A file as text with line feeds, whatever its byte order mark and line ends.

    largest  bytes that it may have
    Raises  FileNotFoundError; TextError for a file that is no text, or cannot be read
    """
    try:
        found = path.stat()
        # Reading a pipe or a device could wait for ever.
        if not stat.S_ISREG(found.st_mode):
            raise TextError("is not an ordinary file")
        if found.st_size > largest:
            raise TextError(f"is larger than {largest / 1e6:g} MB")
        content = path.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        raise TextError(f"cannot be read: {error.strerror}") from None
    return decode(content)


def decode(content: bytes) -> str:
    """The text of a file's bytes: UTF-8, or what its byte order mark says. Raises TextError."""
    encoding, mark = next(((name, m) for m, name in MARKS if content.startswith(m)), ("utf-8", b""))
    content = content[len(mark) :]
    if encoding == "utf-8" and content[:4].count(0) >= 2:
        raise TextError("is UTF-16 or UTF-32 without a byte order mark; save it as UTF-8", 1)
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        bad = content[error.start]
        what = f"is not {encoding.upper()} text: byte 0x{bad:02x} in line {line}; save it as UTF-8"
        raise TextError(what, line) from None
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise TextError(f"is no text: a NUL in line {line}; remove it, or save the file as UTF-8", line)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises  FileNotFoundError; TextError saying in one line what is wrong with the file, without its name
    """
    return parse_toml(read_text(path))


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text; raises TextError, in one line, for text that is not TOML."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        said = _WHERE.search(str(error))
        raise TextError(f"not valid TOML: {error}", int(said[1]) if said else None) from None
    except RecursionError:
        raise TextError("not valid TOML: arrays or tables nested too deeply") from None
    except ValueError:  # what Python says of an integer of thousands of digits
        raise TextError("not valid TOML: a number with too many digits") from None


def line_of(text: str, path: Sequence[str | int]) -> int | None:
    """The line, from 1, in which a TOML text says the field at `path`, or the inline table or list it is in.

    path  keys, and places in lists from 0; None where no line says it
    """
    table: tuple[str | int, ...] = ()
    counts: dict[tuple[str, ...], int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if header := _HEADER.match(line):
            keys = _keys(header[2])
            if header[1]:
                counts[keys] = counts.get(keys, -1) + 1
            table = _counted(keys, counts)
            if table == tuple(path):
                return number
        elif key := _KEY.match(line):
            said = (*table, *_keys(key[1]))
            if tuple(path[: len(said)]) == said:
                return number
    return None


def _counted(keys: tuple[str, ...], counts: Mapping[tuple[str, ...], int]) -> tuple[str | int, ...]:
    """The path of a table's header: behind a list of tables comes the place of its last one so far."""
    path: list[str | int] = []
    for k, key in enumerate(keys, 1):
        path.append(key)
        if keys[:k] in counts:
            path.append(counts[keys[:k]])
    return tuple(path)


def _keys(dotted: str) -> tuple[str, ...]:
    return tuple(key.strip().strip("\"'") for key in dotted.split("."))
