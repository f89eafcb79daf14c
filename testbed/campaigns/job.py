"""Describes one run to fly: what a campaign or a study sends to a worker."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from testbed.campaigns.sent_parts import SentParts
from testbed.components.components import Parts
from testbed.measures.encounter_measures import Settings
from testbed.scenario.scenario import Scenario, parse


@dataclass(frozen=True)
class Job:
    """One run to fly.

    label      what messages and tables call its setting
    data       the scenario as JSON
    seed       replaces the scenario's own
    guarantee  the one that the work judges by; "" where it judges by none
    force      fly starts outside the safe set too
    code       `code_id` that the worker must have; "" if any will do
    folder     where the run folder goes; None keeps none. It is removed again where `guarantee` holds
    requirements  (name, formula) each, that the run is judged by besides
    measures   what is measured of it besides; None for nothing
    """

    label: str
    data: str
    seed: int
    guarantee: str = ""
    force: bool = True
    code: str = ""
    folder: Path | None = None
    parts: SentParts | None = None
    requirements: tuple[tuple[str, str], ...] = ()
    measures: Settings | None = None

    def own(self) -> Parts | None:
        """The user's parts in this process. Raises UserError if they are others than where the job began."""
        return self.parts.here() if self.parts is not None else None

    def scenario(self) -> Scenario:
        """The scenario to fly. Raises UserError if it is not a valid one."""
        return parse(json.loads(self.data) | {"seed": self.seed})
