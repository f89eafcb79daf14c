"""Reads recorded tracks from CSV files, and puts them into a scenario's plain data."""

from __future__ import annotations

import csv
import hashlib
import itertools
import json
from collections.abc import Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from aircraft.textfile import TextError, read_text
from testbed.errors import UserError, nearest, short

NEEDED = ("t_s", "x_m", "y_m")
COLUMNS = (*NEEDED, "z_m")
# An hour at ten rows a second would make every manifest larger than its tables.
MOST_ROWS = 20_000
LARGEST = 1e6


def sha256(rows: Sequence[Sequence[float]]) -> str:
    """SHA-256 of a track's rows, whatever the layout of the file they came from."""
    text = json.dumps([[float(x) for x in row] for row in rows], separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def faulty(rows: Sequence[Sequence[float]]) -> str:
    """What is wrong with a track's rows, the first thing; "" if they are one."""
    if len(rows) < 2:
        return f"a track of {len(rows)} row{'s' if len(rows) != 1 else ''}; it needs two or more"
    if len({len(row) for row in rows}) > 1:
        return "some rows have a height and some have none"
    for k, row in enumerate(rows, 1):
        bad = next((x for x in row if not (isfinite(x) and abs(x) <= LARGEST)), None)
        if bad is not None:
            return f"row {k} has {bad:g}; every number must be finite and within {LARGEST:g}"
    for k, (one, other) in enumerate(itertools.pairwise(rows), 1):
        if not other[0] > one[0]:
            return f"t_s goes from {one[0]:g} s in row {k} to {other[0]:g} s in row {k + 1}; times must grow"
    return ""


def read_track(path: Path) -> list[list[float]]:
    """The rows (t [s], x, y [m] and, if the file has it, z [m]) of a CSV file; other columns are not used.

    Raises  UserError with the file, and the line of what is wrong
    """
    try:
        cells = list(csv.reader(read_text(path).splitlines()))
    except FileNotFoundError:
        raise UserError(f"track {path} does not exist") from None
    except (TextError, csv.Error) as error:
        raise UserError(f"{error}", file=str(path)) from None
    lines = [(number, line) for number, line in enumerate(cells, 1) if any(cell.strip() for cell in line)]
    if not lines:
        raise UserError("is empty; a track has a line of column names and rows", file=str(path))
    names = [cell.strip() for cell in lines[0][1]]
    for name in NEEDED:
        if name not in names:
            raise UserError(f"has no column {name}; {nearest(name, names)}", file=str(path))
    if twice := next((name for name in COLUMNS if names.count(name) > 1), None):
        raise UserError(f"has two columns {twice}", file=str(path))
    place = [names.index(name) for name in COLUMNS if name in names]
    if len(lines) - 1 > MOST_ROWS:
        raise UserError(f"has more than {MOST_ROWS} rows; thin it out", file=str(path))
    rows = [[_number(line, k, names[k], number, path) for k in place] for number, line in lines[1:]]
    if wrong := faulty(rows):
        raise UserError(wrong, file=str(path))
    return rows


def _number(line: Sequence[str], k: int, name: str, number: int, path: Path) -> float:
    said = line[k].strip() if k < len(line) else ""
    try:
        return float(said)
    except ValueError:
        what = short(repr(said)) if said else "nothing"
        raise UserError(f"line {number} has {what} for {name}, not a number", file=str(path)) from None


def with_tracks(data: dict[str, Any], homes: Sequence[Path]) -> dict[str, Any]:
    """Plain data with the rows of the tracks that its guidance tables name and do not hold.

    homes  where relative files start: the first that has the file
    Raises UserError as `read_track` does
    """
    made = dict(data)
    if isinstance(own := data.get("guidance"), dict):
        made["guidance"] = _filled(own, homes)
    if isinstance(listed := data.get("vehicle"), list):
        made["vehicle"] = [
            one | {"guidance": _filled(one["guidance"], homes)}
            if isinstance(one, dict) and isinstance(one.get("guidance"), dict)
            else one
            for one in listed
        ]
    return made


def _filled(table: dict[str, Any], homes: Sequence[Path]) -> dict[str, Any]:
    file = table.get("file")
    if not isinstance(file, str) or not file or table.get("rows"):
        return table
    found = next((home / file for home in homes if (home / file).is_file()), homes[0] / file)
    rows = read_track(found)
    return table | {"sha256": sha256(rows), "rows": rows}


def shorter(said: Sequence[tuple[str, float]], duration_s: float) -> Iterator[str]:
    """Notes on tracks, by table and last time [s], that end before a run of `duration_s` does."""
    for where, end in said:
        if end < duration_s - 1e-9:
            yield (
                f"{where}: the track ends at {end:g} s and the run at {duration_s:g} s; after it the last"
                " course, speed and height are held"
            )
