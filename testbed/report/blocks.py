"""Defines what a report page consists of: parts, one per folder, their sections and blocks."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

if TYPE_CHECKING:
    import pandas as pd

# How something stands, and the sign that says so without colour.
KEPT, LOST, OPEN = "kept", "lost", "open"
SIGNS = {KEPT: "✓", LOST: "✗", OPEN: "?"}
# Browsers refuse longer addresses; a table beyond it is thinned by who makes it, or not offered.
LONGEST_URI = 1_900_000
# Round-off, written as the zero it stands for.
NOTHING = 1e-9


@dataclass(frozen=True)
class Download:
    """A table that travels in the page as a data: address."""

    label: str
    file: str
    uri: str


@dataclass(frozen=True)
class Table:
    """Rows as they are; a column of verdict words gets signs. `marked` are rows to set apart, by number."""

    rows: Sequence[Mapping[str, Any]]
    caption: str = ""
    marked: frozenset[int] = frozenset()
    downloads: tuple[Download, ...] = ()
    kind: str = "table"

    @property
    def columns(self) -> list[str]:
        """Every name that a row has; rows need not have them all."""
        return list(dict.fromkeys(name for row in self.rows for name in row))


@dataclass(frozen=True)
class Picture:
    """A figure: SVG markup, or the address of an image; what it shows in words; its data."""

    name: str
    caption: str
    alt: str
    svg: str = ""
    image: str = ""
    downloads: tuple[Download, ...] = ()
    kind: str = "picture"


@dataclass(frozen=True)
class Note:
    text: str
    kind: str = "note"


@dataclass(frozen=True)
class Listing:
    """Text as it is, folded: a scenario's every field, a gains file."""

    title: str
    text: str
    downloads: tuple[Download, ...] = ()
    kind: str = "listing"


@dataclass(frozen=True)
class Scorecard:
    """Claims with a line for each run: see `testbed.report.scorecard`."""

    rows: Sequence[Mapping[str, Any]]
    downloads: tuple[Download, ...] = ()
    kind: str = "scorecard"


@dataclass(frozen=True)
class Playback:
    """The player's data, see `testbed.report.playback`."""

    data: Mapping[str, Any]
    kind: str = "playback"


Block = Table | Picture | Note | Listing | Scorecard | Playback


@dataclass(frozen=True)
class Section:
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Fact:
    """One line beside the verdict: who, how it stands, the value in words, and a bar.

    share  value / bound, drawn against the bound; with `rate`, the share of runs lost, drawn against all
    """

    name: str
    status: str
    text: str
    share: float | None = None
    color: str = ""
    rate: bool = False

    @property
    def width(self) -> float:
        """Of the bar, per cent; a bound stands at 40 %."""
        share = self.share or 0.0
        return round(100 * min(1.0, max(0.0, share if self.rate else 0.4 * share)), 2)


@dataclass(frozen=True)
class Part:
    """One folder's account. headline: the verdict in a few words; details: sentences below it."""

    title: str
    what: str
    status: str
    headline: str
    details: Sequence[str] = ()
    facts: Sequence[Fact] = ()
    sections: Sequence[Section] = field(default_factory=list)


def download(label: str, file: str, table: pd.DataFrame | str) -> tuple[Download, ...]:
    """The table, or the text of one, as a download; none where it is too long for an address."""
    text = table if isinstance(table, str) else table.to_csv(index=False, float_format="%.7g")
    kind = "application/json" if file.endswith(".json") else "text/csv"
    uri = f"data:{kind};charset=utf-8," + quote(text, safe=",.-_:;/+=()*!~@$")
    return (Download(label, file, uri),) if len(uri) <= LONGEST_URI else ()


def read_csv(text: str) -> list[dict[str, Any]]:
    """Rows of a CSV with numbers as numbers."""
    return [{k: number(v) for k, v in row.items()} for row in csv.DictReader(io.StringIO(text))]


def number(text: str) -> Any:
    if text in ("True", "False"):
        return text == "True"
    for kind in (int, float):
        try:
            return kind(text)
        except (TypeError, ValueError):
            continue
    return text


def cell(value: Any) -> str:
    """A value for a table: four digits, a dash where there is none."""
    if value is None or value == "" or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) > NOTHING else "0"
    if isinstance(value, list | tuple):
        return ", ".join(cell(v) for v in value)
    return str(value)
