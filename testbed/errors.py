"""What a person can mistake, said in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UserError(Exception):
    """Bad input from a person: the command line prints it in one line and exits with code 2."""


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint naming the known names closest to `name`, or all of them where none is close."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    if close:
        return "did you mean " + " or ".join(close) + "?"
    return "known: " + ", ".join(known)
