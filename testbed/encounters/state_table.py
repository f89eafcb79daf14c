"""Reads tables of aircraft states from text: column names, units, and a row per aircraft and time."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from aircraft.textfile import TextError, read_text
from filters.model import Array
from testbed.encounters.units import factor, is_unit
from testbed.errors import Mistake, UserError, nearest, short

# Sixty bytes a row: a thousand encounters of two aircraft and a thousand rows.
LARGEST_BYTES = 150_000_000
_BRACKETED = re.compile(r"(.*?)\s*[\[(]\s*([^\])]+?)\s*[\])]")
_REFERENCE = re.compile(r"_(msl|agl)$", re.IGNORECASE)
_PARAMETER = re.compile(r"[\w.]+ = ")


@dataclass(frozen=True)
class Column:
    """A column that a format knows.

    names     that it may have, in small letters and without a unit
    measured  length, time, speed, angle or word
    unit      taken where the file says none; None: the file has to say one
    hint      what to do where it is missing
    """

    names: tuple[str, ...]
    measured: str
    unit: str | None = None
    hint: str = ""


@dataclass
class StateTable:
    """The rows of a file.

    words    column -> (R,) text, of columns that are words
    numbers  column -> (R,) in m, s, m/s and rad
    lines    (R,) of each row, from 1
    unused   names of columns that were not read
    """

    file: str
    words: dict[str, Sequence[str]] = field(default_factory=dict)
    numbers: dict[str, Array] = field(default_factory=dict)
    lines: Sequence[int] = ()
    unused: tuple[str, ...] = ()


def read_lines(path: Path) -> list[str]:
    """The lines of a text file; UserError with the file where there is none, or it is no text."""
    try:
        return read_text(path, LARGEST_BYTES).split("\n")
    except FileNotFoundError:
        raise UserError(f"{path} does not exist") from None
    except TextError as error:
        raise UserError(Mistake(str(error), line=error.line), file=str(path)) from None


def read_states(path: Path, known: Mapping[str, Column], needed: Sequence[Sequence[str]]) -> StateTable:
    """The states in a file.

    known   column -> what it may be called
    needed  each a list of columns of which the file has to have one
    Fields are separated by commas, semicolons or tabs where the header or a row has any, else by spaces. A
    unit stands in brackets, after an underscore in the column's name, or in a line of units below the names.
    Raises  UserError with the file, the line and what to do
    """
    file = str(path)
    told = [
        (number, line.strip())
        for number, line in enumerate(read_lines(path), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    while told and _PARAMETER.match(told[0][1]):
        told.pop(0)
    if not told:
        raise UserError("is empty; a line of column names and rows are needed", file=file)
    number, header = told[0]
    names, units = _header(_split(header))
    rows = told[1:]
    if rows and (said := _units(_split(rows[0][1]))) is not None:
        if len(said) != len(names):
            what = f"{len(said)} units for {len(names)} columns"
            raise UserError(Mistake(what, line=rows[0][0], remedy="give each column one"), file=file)
        units = [unit or own for unit, own in zip(said, units, strict=True)]
        number, rows = rows[0][0], rows[1:]
    places = _places(names, known, file, told[0][0])
    for choice in needed:
        if not any(column in places for column in choice):
            wanted = " or ".join(known[column].names[0] for column in choice)
            hint = known[choice[0]].hint or nearest(known[choice[0]].names[0], names)
            raise UserError(Mistake(f"has no column {wanted}; {hint}", line=told[0][0]), file=file)
    table = StateTable(file, lines=[line for line, _ in rows])
    table.unused = tuple(name for k, name in enumerate(names) if k not in places.values())
    cells = _cells(rows, len(names), file)
    for column, k in places.items():
        of = known[column]
        if of.measured == "word":
            table.words[column] = cells[k] if cells else []
            continue
        unit = units[k] or of.unit
        if unit is None:
            what = f"column {names[k]} has no unit"
            example = {"length": "ft", "time": "s", "speed": "kt", "angle": "deg"}[of.measured]
            remedy = f"write {names[k]}_{example}, or a line of units such as [{example}]"
            raise UserError(Mistake(what, line=told[0][0], remedy=remedy), file=file)
        try:
            by = factor(unit, of.measured, names[k])
        except ValueError as error:
            raise UserError(Mistake(str(error), line=number), file=file) from None
        table.numbers[column] = by * _numbers(cells[k] if cells else (), names[k], of, table.lines, file)
    return table


def _split(line: str) -> list[str]:
    separator = next((s for s in (",", ";", "\t") if s in line), None)
    return [cell.strip() for cell in line.split(separator)]


def _header(cells: Sequence[str]) -> tuple[list[str], list[str]]:
    """Names without units, in small letters, and the units that stand with them; "" for none."""
    names, units = [], []
    for cell in cells:
        if found := _BRACKETED.fullmatch(cell):
            name, unit = found[1], found[2]
        else:
            name, _, unit = _REFERENCE.sub("", cell).rpartition("_")
            if not name or not is_unit(unit):
                name, unit = cell, ""
        names.append(name.lower())
        units.append(unit)
    return names, units


def _units(cells: Sequence[str]) -> list[str] | None:
    """A line of units, without their brackets; None if it is none."""
    bare = [cell.strip("[]() ") for cell in cells]
    bracketed = any(cell.startswith("[") for cell in cells)
    return bare if bracketed or all(is_unit(cell) for cell in bare) else None


def _places(names: Sequence[str], known: Mapping[str, Column], file: str, line: int) -> dict[str, int]:
    """Column -> where it stands."""
    found: dict[str, int] = {}
    for column, of in known.items():
        here = [k for k, name in enumerate(names) if name in of.names]
        if len(here) > 1:
            both = f"columns {names[here[0]]} and {names[here[1]]} are both the {of.names[0]}"
            raise UserError(Mistake(both, line=line, remedy="leave one of them out"), file=file)
        if here:
            found[column] = here[0]
    return found


def _cells(rows: Sequence[tuple[int, str]], columns: int, file: str) -> list[tuple[str, ...]]:
    """The columns of all rows, as text."""
    split = []
    for number, line in rows:
        cells = _split(line)
        if len(cells) != columns:
            what = f"{len(cells)} values for {columns} columns"
            raise UserError(Mistake(what, line=number, remedy="complete the line"), file=file)
        split.append(cells)
    return list(zip(*split, strict=True))


def _numbers(cells: Sequence[str], name: str, of: Column, lines: Sequence[int], file: str) -> Array:
    try:
        found = np.array(cells, dtype=float)
    except ValueError:
        found = np.array([_number(c, name, of, n, file) for c, n in zip(cells, lines, strict=True)])
    wrong = np.flatnonzero(~np.isfinite(found))
    if wrong.size:
        what = f"column {name} has {cells[wrong[0]]}, not a finite number"
        raise UserError(
            Mistake(what, line=lines[wrong[0]], remedy="give a number, or leave the row out"), file=file
        )
    return found


def _number(cell: str, name: str, of: Column, line: int, file: str) -> float:
    """A number, or a time as hours:minutes:seconds."""
    try:
        if of.measured == "time" and cell.count(":") in (1, 2):
            seconds = 0.0
            for part in cell.split(":"):
                seconds = 60.0 * seconds + float(part)
            return seconds
        return float(cell)
    except ValueError:
        what = f"column {name} has {short(repr(cell)) if cell else 'nothing'}, not a number"
        raise UserError(Mistake(what, line=line, remedy="give a number"), file=file) from None
