"""Reads and writes a campaign's folder: the campaign, the journal of finished runs, the tables.

campaign.json    the campaign and its base scenario; a folder without it holds no campaign
journal.jsonl    one line per finished run, on the disk before the run counts as finished
runs.parquet     one row per run, the same bytes however the runs were flown
timings.parquet  wall time and worker of each run: what differs between equal campaigns
summary.json     rates and quantiles per cell
runs/ID/         run folders, where they are kept
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from testbed.campaigns.journal import Journal
from testbed.errors import UserError
from testbed.records.store import staged, write_json

MANIFEST, JOURNAL, RUNS, TIMINGS, SUMMARY = (
    "campaign.json",
    "journal.jsonl",
    "runs.parquet",
    "timings.parquet",
    "summary.json",
)
# The lock, and who holds it.
LOCK, HOLDER = ".lock", ".holder"


def journal(path: Path) -> Journal:
    """The runs that a campaign's folder has."""
    return Journal(path / JOURNAL)


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
    """Hold the folder alone; UserError if another process holds it. The lock dies with its process."""
    lock = FileLock(path / LOCK, blocking=False)
    try:
        lock.acquire()
    except Timeout:
        holder = ""
        with suppress(OSError):
            holder = (path / HOLDER).read_text(encoding="utf-8")
        raise UserError(f"{path} is being flown by another process ({holder})") from None
    try:
        (path / HOLDER).write_text(f"{os.getpid()} on {platform.node()}", encoding="utf-8")
        yield
    finally:
        lock.release()


def is_locked(path: Path) -> bool:
    """Whether a process holds the campaign's folder now, as far as this machine can tell."""
    if not (path / LOCK).is_file():
        return False
    try:
        with FileLock(path / LOCK, blocking=False):
            return False
    except Timeout:
        return True


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
