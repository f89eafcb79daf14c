"""Errors of people who use the program: mistakes in files and commands, each said in one line."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType

# Messages are cut to so many letters, since they may quote a file.
LONGEST_MESSAGE = 2000
# A message names at most so many mistakes.
NAMED_MISTAKES = 4


@dataclass(frozen=True)
class Mistake:
    """One mistake in a file.

    field   dotted path, with places in lists from 0; "" for the file itself
    line    from 1; None where no line says the field
    remedy  what to do about it, where the message does not say it
    """

    message: str
    field: str = ""
    line: int | None = None
    remedy: str = ""

    def __str__(self) -> str:
        said = f"{self.field}: {self.message}" if self.field else self.message
        return (
            said + (f"; {self.remedy}" if self.remedy else "") + (f" (line {self.line})" if self.line else "")
        )


class UserError(Exception):
    """Bad input from a person: the command line prints it in one line and exits with code 2.

    file      what the mistakes are in, "" where they are in no file
    mistakes  at least one; a message alone is one
    What is quoted of a file may be anything: line breaks and what a terminal obeys are shown as escapes, and
    beyond `LONGEST_MESSAGE` letters it is cut.
    """

    def __init__(self, *mistakes: str | Mistake, file: str = "") -> None:
        self.file = file
        self.mistakes = tuple(m if isinstance(m, Mistake) else Mistake(m) for m in mistakes)
        said = list(dict.fromkeys(map(str, self.mistakes)))
        more = len(said) - NAMED_MISTAKES
        message = "; ".join(said[:NAMED_MISTAKES]) + (f"; and {more} more" if more > 0 else "")
        super().__init__(printable(f"{file}: {message}" if file else message))

    def located(self, line: Callable[[str], int | None]) -> UserError:
        """The same with the lines of its fields, found by `line` of a dotted path."""
        found = [m if m.line or not m.field else replace(m, line=line(m.field)) for m in self.mistakes]
        return UserError(*found, file=self.file)


class NoteWarning(UserWarning):
    """What a person should know although it is no mistake, in one line."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


def printable(message: str) -> str:
    """`message` in one line: cut, with escapes for what is not printable."""
    if len(message) > LONGEST_MESSAGE:
        message = message[:LONGEST_MESSAGE] + "..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in message)


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


class ClashError(ImportError):
    """A package of somebody else has the name of one of ours. Not caught, it ends the program in one line."""


def check_packages(*names: str) -> None:
    """ClashError unless the packages of these names are those that stand beside this one."""
    root = Path(__file__).resolve().parents[1]
    for name in names:
        found = _package(name)
        if found is not None and not found.is_relative_to(root / name):
            sys.excepthook = _one_line(sys.excepthook)
            raise ClashError(
                f"{found} is found before the package {name!r} that testbed needs, in {root};"
                " rename yours, or start Python where it is not found first"
            )


def _package(name: str) -> Path | None:
    """Where a package was imported from, or would be; None if that is not known."""
    if name in sys.modules:
        file = getattr(sys.modules[name], "__file__", None)
    else:
        spec = find_spec(name)
        folders = list(spec.submodule_search_locations or []) if spec else []
        file = (spec.origin if spec else None) or next(iter(folders), None)
    return Path(file).resolve() if file else None


Hook = Callable[[type[BaseException], BaseException, TracebackType | None], object]


def _one_line(usual: Hook) -> Hook:
    def say(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if isinstance(error, ClashError):
            print(f"error: {error}", file=sys.stderr)
        else:
            usual(kind, error, trace)

    return say


class StoppedError(BaseException):
    """A signal asks the program to end. Not an Exception: handlers of failures must not catch it."""

    def __init__(self, number: int) -> None:
        self.number = number
