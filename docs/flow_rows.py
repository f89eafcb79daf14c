"""Keeps the rows of the flow filter's tables: one file of flights, which grows flight by flight."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def flown(data: Path) -> list[dict[str, str]]:
    """The rows there are."""
    if not data.exists():
        return []
    with data.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def append(data: Path, columns: Sequence[str], row: Mapping[str, Any]) -> None:
    """One row more, and the columns' names before the first; numbers with six digits."""
    new = not data.exists()
    with data.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})
