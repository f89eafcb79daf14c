"""Flies departures in order for the falsifier, judges each by one guarantee, and keeps them all."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from filters.model import Array
from testbed.campaigns.display import say
from testbed.campaigns.inprocess import InProcess
from testbed.campaigns.job import Job
from testbed.claims.registry import CLAIMS
from testbed.components.components import Parts
from testbed.scenario.variants import changed
from testbed.studies.common.measure import job_of, override
from testbed.studies.falsify.space import Space

if TYPE_CHECKING:
    from testbed.campaigns.outcome import Executor


@dataclass(frozen=True)
class Flight:
    """One departure flown, or refused.

    margin    of the guarantee, in its unit (m for separation); nan if refused or not applicable
    violated  the guarantee's verdict is "violated": a start outside the safe set, a premise not met or a
              run that ended before anything happened are no counterexamples
    refused   why it could not be flown, or ""
    vehicles  the worst pair, from 1
    """

    number: int
    stage: str
    x: Array
    margin: float
    value: float
    violated: bool
    refused: str
    vehicles: tuple[int, ...]
    t_s: float

    def row(self) -> dict[str, Any]:
        """Without the departure itself, for tables."""
        return {k: v for k, v in vars(self).items() if k != "x"}


def fly(job: Job) -> dict[str, Any]:
    """Fly a scenario; what `Flight` has of it. A start that is refused says why.

    The job's guarantee is a claim's id, or the text of a requirement.
    """
    from testbed.errors import UserError
    from testbed.records.verdict import Status
    from testbed.requirements.requirement import entry as judged
    from testbed.simulation.simulate import run

    result = {"margin": nan, "value": nan, "violated": False, "refused": "", "vehicles": (), "t_s": nan}
    try:
        entry = judged(run(job.scenario(), parts=job.own()), job.guarantee)
    except UserError as error:
        return result | {"refused": str(error)}
    if entry["margin"] is None:  # not applicable, or not decided
        return result
    return result | {
        "margin": entry["margin"],
        "value": entry["value"],
        "violated": entry["verdict"] == Status.VIOLATED,
        "vehicles": tuple(entry["vehicles"]),
        "t_s": nan if entry["t_s"] is None else entry["t_s"],
    }


@dataclass
class Flights:
    """Flies departures of `space`, at most `most` of them, `pool.workers` at a time, in order.

    pool   None flies in this process
    work   what flies a job (for tests)
    parts  of the user's own, in every run
    flown  every flight so far
    """

    space: Space
    guarantee: str
    most: int
    pool: Executor | None = None
    work: Callable[[Job], dict[str, Any]] = fly
    parts: Parts | None = None
    flown: list[Flight] = field(default_factory=list)

    @property
    def left(self) -> int:
        return self.most - len(self.flown)

    def first(self, stage: str, points: Sequence[Array], stop: bool = True) -> int | None:
        """Fly `points` up to the first that violates (all of them, if not `stop`): its place, or None.

        What is flown, kept and answered is the same for any number of workers.
        """
        points, at_once = points[: self.left], self.pool.workers if self.pool else 1
        found = None
        for start in range(0, len(points), at_once):
            for place, flight in enumerate(self._fly(stage, points[start : start + at_once]), start):
                self.flown.append(flight)
                say(self._line(flight))
                if flight.violated and found is None:
                    found = place
                    if stop:
                        return found
        return found

    def _fly(self, stage: str, points: Sequence[Array]) -> list[Flight]:
        seed = self.space.scenario.seed
        data = [self._data(x) for x in points]
        jobs = [job_of(stage, of, seed, self.parts, self.guarantee) for of in data]
        pool = InProcess() if self.pool is None or len(jobs) < 2 else self.pool
        outcomes = sorted(pool.imap(self.work, jobs), key=lambda o: o.index)
        results = [outcome.value() for outcome in outcomes]
        number = len(self.flown) + 1
        return [
            Flight(number + k, stage, np.array(x), **result)
            for k, (x, result) in enumerate(zip(points, results, strict=True))
        ]

    def _data(self, x: Array) -> str:
        s = self.space.at(x)
        if self.guarantee in CLAIMS:
            return override(s, {})
        # A requirement is judged on the columns, as the scenario records them.
        made = changed(s, {"checks.manoeuvre_instants": 0})
        return json.dumps(made.model_dump(mode="json"), sort_keys=True)

    def _line(self, flight: Flight) -> str:
        said = f"refused, {flight.refused}" if flight.refused else f"margin {flight.margin:.3f}"
        violated = ", violated" if flight.violated else ""
        return f"{flight.number} of at most {self.most}, {flight.stage}: {said}{violated}"

    def least(self) -> Flight:
        """The flight of the least margin; if all were refused, the first."""
        return min(self.flown, key=lambda f: (np.isnan(f.margin), f.margin))
