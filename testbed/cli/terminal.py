"""Makes output fit any terminal: escapes for letters that it lacks, notes in one line."""

from __future__ import annotations

import sys
import warnings
from contextlib import suppress
from io import TextIOWrapper
from typing import TextIO

from testbed.errors import NoteWarning


def prepare() -> None:
    """Letters that stdout or stderr cannot encode become escapes; notes go to stderr in one line each."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    usual = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, NoteWarning):
            say(f"note: {message}")
        else:
            usual(message, category, filename, lineno, file, line)

    warnings.showwarning = show


def say(line: str) -> None:
    """A line on stderr; nothing where that is closed."""
    with suppress(OSError):
        print(line, file=sys.stderr, flush=True)
