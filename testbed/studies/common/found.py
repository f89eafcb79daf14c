"""Holds what a study found, for the command line to print, and what its numbers depend on."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbed.components import catalogue
from testbed.components.border.making import WORDS
from testbed.components.components import Parts
from testbed.components.installed_parts import effective
from testbed.components.versions import versions
from testbed.records.run import called
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


def provenance(s: Scenario, plant: str, parts: Parts | None = None) -> dict[str, Any]:
    """What the numbers depend on, besides the code; `plant` knows the airframes.

    parts  of the user's own
    """
    own = effective(s, parts).own()
    known = {"parts": {role: origin.to_json() for role, origin in own.items()}} if own else {}
    return known | {
        "scenario": s.model_dump(mode="json"),
        "versions": versions(),
        "airframes": catalogue.airframe_hashes(s.model_copy(update={"plant": plant})),
    }


def titled(s: Scenario, parts: Parts | None = None) -> str:
    """What flies, for a title: the scenario, its plant, and the parts of the user's own."""
    plant = effective(s, parts).own().get("plant")
    return f"{s.name} on {called(plant.to_json()) if plant else s.plant}{flown_with(s, parts)}"


def flown_with(s: Scenario, parts: Parts | None = None) -> str:
    """Filter, guidance and environment of the user's own, for a title; "" if there are none."""
    own = {role: called(origin.to_json()) for role, origin in effective(s, parts).own().items()}
    return "".join(f", {WORDS[role]} {name}" for role, name in own.items() if role != "plant")


def hundredths(value: float | None) -> float | None:
    return None if value is None else round(value, 2) + 0.0
