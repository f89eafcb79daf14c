"""Flies one encounter under one filter on one plant, and returns what the benchmark counts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from testbed.claims.nearest import nearest_approach
from testbed.claims.registry import QP_FEASIBILITY
from testbed.errors import UserError, short
from testbed.measures.encounter_measures import measured
from testbed.records.run import Run
from testbed.records.verdict import Status
from testbed.requirements.requirement import recorded_at_every_step
from testbed.scenario.scenario import Scenario, parse
from testbed.scenario.variants import changed

Fields = dict[str, Any]


@dataclass(frozen=True)
class Flight:
    """One run: `data` is an encounter's scenario, of which `fields` set plant and filter.

    id    hash of all that its row depends on but the code
    code  that of the code
    """

    filter: str
    plant: str
    set: str
    encounter: str
    data: Fields = field(repr=False)
    fields: Fields = field(repr=False)
    id: str = ""
    code: str = ""

    def scenario(self) -> Scenario:
        """What is flown, recorded at every filter step. Raises UserError for fields it cannot have."""
        s = changed(parse(self.data, self.encounter, keep_idle=True), self.fields, self.encounter)
        return recorded_at_every_step(s)


def fly(flight: Flight) -> dict[str, Any]:
    """The row of one run, and by what code; one that cannot be flown says why, and counts as lost."""
    from testbed.simulation.simulate import run

    of = {"id": flight.id, "code": flight.code}
    try:
        return of | row(run(flight.scenario(), force=True))
    except (OSError, MemoryError):
        raise
    except UserError as error:
        return of | {"refused": str(error), "lost": True}
    except Exception as error:
        text = f"{type(error).__name__}: {short(' '.join(str(error).split()))}"
        return of | {"refused": text, "lost": True}


def row(done: Run) -> dict[str, Any]:
    """What is counted of a run.

    lost        whether a pair came closer than Ds, or the run ended before its end
    distance_m  least distance of any pair of which one is under the filter
    and all that `testbed.measures.encounter_measures.measured` gives
    """
    nearest = nearest_approach(done)
    return {
        "refused": "",
        "lost": nearest.status is not Status.HOLDS,
        "ended_early": done.manifest["ended_early"] or "",
        "distance_m": nearest.value,
        "at_s": nearest.instant,
        "infeasible": done.guarantee(QP_FEASIBILITY.id)["value"],
        **measured(done),
    }
