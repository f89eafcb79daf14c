"""Holds what a study found, for the command line to print, and what its numbers depend on."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbed.components import catalogue
from testbed.scenario.scenario import Scenario


@dataclass
class Found:
    """What a study wrote, and what to print of it.

    title, rows  a table to print
    lines        sentences to print beneath it
    """

    folder: Path
    title: str
    rows: list[dict[str, Any]]
    lines: list[str] = field(default_factory=list)
    data: dict[str, Any] = field(default_factory=dict)


def provenance(s: Scenario, plant: str) -> dict[str, Any]:
    """What the numbers depend on, besides the code; `plant` knows the airframes."""
    return {
        "scenario": s.model_dump(mode="json"),
        "versions": catalogue.versions(),
        "airframes": catalogue.airframe_hashes(s.model_copy(update={"plant": plant})),
    }


def hundredths(value: float | None) -> float | None:
    return None if value is None else round(value, 2) + 0.0
