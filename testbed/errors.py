"""What a person can mistake, said in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

# Of what a file says a message quotes a little; longer ones are cut.
LONGEST_MESSAGE = 2000


class UserError(Exception):
    """Bad input from a person: the command line prints it in one line and exits with code 2.

    What it quotes of a file may be anything: line breaks and what a terminal obeys are shown as escapes, and
    beyond `LONGEST_MESSAGE` letters it is cut.
    """

    def __init__(self, message: str) -> None:
        if len(message) > LONGEST_MESSAGE:
            message = message[:LONGEST_MESSAGE] + "..."
        super().__init__("".join(c if c.isprintable() else ascii(c)[1:-1] for c in message))


# Longer words are cut in messages, and compared no further.
LONGEST = 80
# Of a long list of known names, so many are given.
LISTED = 40


def short(text: str) -> str:
    """`text`, or its beginning."""
    return text if len(text) <= LONGEST else text[:LONGEST] + "..."


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint naming the known names closest to `name`, or all of them where none is close."""
    known = sorted(known)
    close = difflib.get_close_matches(name[:LONGEST], known, n=3, cutoff=0.5)
    if close:
        return "did you mean " + " or ".join(close) + "?"
    more = len(known) - LISTED
    between = "; " if any("," in name for name in known) else ", "
    return "known: " + between.join(known[:LISTED]) + (f" and {more} more" if more > 0 else "")


class NoteWarning(UserWarning):
    """What a person should know although it is no mistake, in one line."""
