"""Keeps finished runs on the disk, one JSON line each, so that an interruption costs no finished run."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from testbed.records.checksums import plain

Row = dict[str, Any]


class Journal:
    """Rows of finished runs by id. An id states everything that its row depends on.

    file     None keeps the rows in memory only
    entries  id -> {"row": ..., "timing": ...}; timing is what differs between equal runs
    found    ids that were in the file when it was opened
    """

    def __init__(self, file: Path | None = None) -> None:
        self.file = file
        self.entries: dict[str, dict[str, Any]] = {}
        if file is not None:
            with suppress(FileNotFoundError), file.open("rb") as lines:
                for line in lines:
                    # A line that a crash cut short is a run to fly again.
                    with suppress(ValueError, KeyError, TypeError):
                        entry = json.loads(line)
                        self.entries[entry["id"]] = {"row": entry["row"], "timing": entry["timing"]}
        self.found = frozenset(self.entries)

    @property
    def rows(self) -> dict[str, Row]:
        """Id -> row."""
        return {key: entry["row"] for key, entry in self.entries.items()}

    def keep(self, key: str, row: Mapping[str, Any], timing: Mapping[str, Any] | None = None) -> None:
        """Add a finished run; it is on the disk when this returns. OSError if it cannot be written."""
        text = json.dumps({"id": key, "row": plain(row), "timing": dict(timing or {})}, allow_nan=False)
        if self.file is not None:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            append(self.file, text)
        # As read back from the file: equal rows, whether flown now or before an interruption.
        entry = json.loads(text)
        self.entries[key] = {"row": entry["row"], "timing": entry["timing"]}


@contextmanager
def journal_beside(out: Path, name: str) -> Iterator[Journal]:
    """A journal in a hidden file beside `out`, removed when the block ends without an exception.

    The block should also write what it makes of the rows: then a full disk costs no flight.
    """
    journal = Journal(out.parent / f".{out.name}.{name}.jsonl")
    try:
        yield journal
    except BaseException:
        if journal.entries:
            kept = f"{len(journal.entries)} finished runs are kept; the same command goes on from there"
            print(kept, file=sys.stderr)
        raise
    if journal.file is not None:
        journal.file.unlink(missing_ok=True)


def append(path: Path, line: str) -> None:
    """Add a line that is on the disk when this returns; after a line cut short it begins a new one."""
    with path.open("a+b") as file:
        torn = b""
        if file.seek(0, os.SEEK_END):
            file.seek(-1, os.SEEK_END)
            torn = b"" if file.read(1) == b"\n" else b"\n"
        file.write(torn + line.encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())
