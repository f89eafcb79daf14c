"""A campaign's folder: what was asked, a journal of what is done, and the tables once all is.

campaign.json    the campaign and its base scenario; a folder without it is no campaign
journal.jsonl    one line per finished run, on the disk before the run counts as finished
runs.parquet     one row per run, the same bytes however the runs were flown
timings.parquet  wall time and worker of each run: what differs between equal campaigns
summary.json     rates and quantiles per cell
runs/ID/         run folders, where they are kept
"""

from __future__ import annotations

import fcntl
import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from testbed.errors import UserError
from testbed.records.store import staged, write_json

MANIFEST, JOURNAL, RUNS, TIMINGS, SUMMARY = (
    "campaign.json",
    "journal.jsonl",
    "runs.parquet",
    "timings.parquet",
    "summary.json",
)


def create(path: Path, manifest: dict[str, Any], overwrite: bool = False) -> None:
    """A new campaign's folder. UserError if something is there, unless `overwrite`."""
    with staged(path, overwrite) as folder:
        write_json(folder / MANIFEST, manifest)


def manifest(path: Path) -> dict[str, Any]:
    """What a campaign's folder was made for; UserError if it is none."""
    try:
        found: dict[str, Any] = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(f"{path} holds no campaign (no {MANIFEST})") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path / MANIFEST} is damaged: {error}") from None
    return found


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """The folder for oneself; UserError if another process has it. The lock dies with its process."""
    with (path / ".lock").open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            file.seek(0)
            raise UserError(f"{path} is being flown by another process ({file.read().strip()})") from None
        file.truncate(0)
        file.write(f"{os.getpid()} on {platform.node()}")
        file.flush()
        yield


def is_locked(path: Path) -> bool:
    """Whether somebody is flying the campaign now, as far as this machine can tell."""
    try:
        with (path / ".lock").open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False


class Journal:
    """Finished runs by id, one JSON line each. A line that a crash cut short is work to do again."""

    def __init__(self, path: Path) -> None:
        self._path = path / JOURNAL
        self.entries: dict[str, dict[str, Any]] = {}
        with suppress(FileNotFoundError), self._path.open("rb") as file:
            for line in file:
                with suppress(ValueError, KeyError, TypeError):
                    entry = json.loads(line)
                    self.entries[entry["id"]] = {"row": entry["row"], "timing": entry["timing"]}

    def keep(self, run: str, row: dict[str, Any], timing: dict[str, Any]) -> None:
        """On the disk when this returns. Raises OSError if it cannot be; nothing counts then."""
        text = json.dumps({"id": run, "row": row, "timing": timing}, allow_nan=False)
        append(self._path, text)
        # As read back from the file: equal rows, whether flown now or before an interruption.
        self.entries[run] = {"row": json.loads(text)["row"], "timing": timing}


def append(path: Path, line: str) -> None:
    """One more line, on the disk when this returns; behind one that a crash cut short it begins anew."""
    with path.open("a+b") as file:
        torn = b""
        if file.seek(0, os.SEEK_END):
            file.seek(-1, os.SEEK_END)
            torn = b"" if file.read(1) == b"\n" else b"\n"
        file.write(torn + line.encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def replace(path: Path, write: Any) -> None:
    """`write(temporary)`, which becomes `path` once it is whole and on the disk."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        write(partial)
        with partial.open("rb") as file:
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
