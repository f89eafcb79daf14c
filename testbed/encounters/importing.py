"""Reads encounters from files of any known format."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from testbed.encounters.bluesky import read_bluesky
from testbed.encounters.encounter import Encounter
from testbed.encounters.formats import TABLES
from testbed.encounters.state_table import read_states
from testbed.encounters.tracks import encounters
from testbed.errors import UserError, nearest

SUFFIXES = {"daa": (".daa",), "scn": (".scn",), "table": (".txt", ".csv", ".dat"), "csv": (".csv",)}
FORMATS = tuple(SUFFIXES)


def read(sources: Sequence[Path], format_: str, skip_unknown: bool = False) -> list[Encounter]:
    """The encounters in files, and in folders of files with the format's suffix.

    format_       one of `FORMATS`
    skip_unknown  of BlueSky files, leave out commands that are not read
    Raises        UserError with the file, the line and what to do
    """
    if format_ not in FORMATS:
        raise UserError(f"--format {format_}: give one of {', '.join(FORMATS)}; {nearest(format_, FORMATS)}")
    files = _files(sources, SUFFIXES[format_])
    if format_ == "scn":
        found = [read_bluesky(file, skip_unknown) for file in files]
    else:
        known, needed = TABLES[format_]
        found = encounters([(file.stem, read_states(file, known, needed)) for file in files])
    return _named(found)


def _files(sources: Sequence[Path], suffixes: Sequence[str]) -> list[Path]:
    files: list[Path] = []
    for source in sources:
        if not source.is_dir():
            files.append(source)
            continue
        inside = sorted(f for f in source.iterdir() if f.suffix.lower() in suffixes and f.is_file())
        if not inside:
            raise UserError(f"{source} has no file that ends in {' or '.join(suffixes)}")
        files += inside
    return files


def _named(found: list[Encounter]) -> list[Encounter]:
    """With names that files can have, each once."""
    taken: set[str] = set()
    made = []
    for e in found:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", e.name).strip("-.")[:80] or "encounter"
        name, k = plain, 1
        while name.lower() in taken:
            k += 1
            name = f"{plain}-{k}"
        taken.add(name.lower())
        made.append(replace(e, name=name))
    return made
