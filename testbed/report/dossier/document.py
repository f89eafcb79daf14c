"""Writes a dossier: one HTML document with a title, contents and chapters, made to be printed to PDF."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from testbed.components.versions import versions
from testbed.errors import UserError, short
from testbed.report.dossier import evidence
from testbed.report.dossier.chapters import Chapter, chapters
from testbed.report.page import markup, part, rendered, written
from testbed.report.registry import Kind

FILE = "dossier.html"
MOST = 200


@dataclass(frozen=True)
class Heading:
    """What stands on the title page, as it was handed in."""

    title: str
    author: str
    date: str

    def __post_init__(self) -> None:
        for name in ("title", "author"):
            said = getattr(self, name)
            if not said.strip():
                raise UserError(f"--{name}: give one; a dossier says what it is and who answers for it")
            if len(said) > MOST or any(unicodedata.category(c) == "Cc" for c in said):
                raise UserError(f"--{name} {short(repr(said))}: give one line of at most {MOST} characters")
        try:
            date.fromisoformat(self.date)
        except ValueError:
            raise UserError(f"--date {short(repr(self.date))}: give a day as 2026-01-31") from None


def write(folders: Sequence[Path], out: Path, heading: Heading, kinds: Sequence[Kind] = ()) -> Path:
    """Write the dossier of `folders` as the file `out`, replaced at once.

    Raises  UserError if a folder is of no kind or damaged, the folders do not belong together, or `out`
            cannot be written
    """
    parts = [part(folder, folder.resolve().name, kinds) for folder in folders]
    return written(out, document(heading, chapters(folders, parts, kinds)))


def document(heading: Heading, made: Sequence[Chapter]) -> str:
    """The document; equal chapters of one commit give equal text."""
    return rendered(
        "dossier.html",
        ["templates/report.css", "templates/dossier.css"],
        heading=heading,
        chapters=made,
        commit=evidence.commit(),
        versions=versions(),
        footer=markup(css_text(f"{heading.title}, {heading.date}")),
        policy="default-src 'none'; style-src 'unsafe-inline'; img-src data:",
    )


def css_text(text: str) -> str:
    """A string of CSS; whatever is no plain letter or digit is written by its number."""
    return '"' + "".join(c if c.isascii() and c.isalnum() else f"\\{ord(c):x} " for c in text) + '"'
