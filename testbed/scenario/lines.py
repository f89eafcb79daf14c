"""Finds the line of a scenario file that says a field, in today's spelling or an older one."""

from __future__ import annotations

from aircraft.textfile import line_of
from testbed.scenario.overrides import NUMBERED
from testbed.scenario.spelling import older


def line_in(text: str, field: str) -> int | None:
    """The line, from 1, that says a field given by its dotted path; None where no line does.

    A field that an entry of a list of tables leaves out is looked for where its table begins.
    """
    path = tuple(int(part) if part.isdigit() else part for part in field.split("."))
    if path[0] not in NUMBERED or len(path) < 2 or not isinstance(path[1], int):
        return next((found for way in (path, *older(path)) if (found := line_of(text, way))), None)
    path = (path[0], path[1] - 1, *path[2:])
    lines = (line_of(text, path[:k]) for k in range(len(path), 1, -1))
    return next((line for line in lines if line is not None), None)
