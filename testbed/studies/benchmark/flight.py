"""Flies one encounter under one filter on one plant, and returns what the benchmark counts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from testbed.claims.nearest import nearest_approach
from testbed.claims.registry import INTERVENTION, QP_FEASIBILITY
from testbed.errors import UserError, short
from testbed.measures.progress import seeking
from testbed.records.run import Run
from testbed.records.verdict import Status
from testbed.scenario.scenario import Scenario, parse
from testbed.scenario.variants import changed

Fields = dict[str, Any]


@dataclass(frozen=True)
class Flight:
    """One run: `data` is an encounter's scenario, of which `fields` set plant and filter."""

    filter: str
    plant: str
    set: str
    encounter: str
    data: Fields = field(repr=False)
    fields: Fields = field(repr=False)

    def scenario(self, record_dt_s: float | None = None) -> Scenario:
        """What is flown; recorded only at the begin and the end unless a period is given.

        Raises  UserError where the scenario cannot have these fields
        """
        s = changed(parse(self.data, self.encounter, keep_idle=True), self.fields, self.encounter)
        period = record_dt_s or max(1, s.filter_steps) * s.rates.filter_dt_s
        return s.model_copy(update={"rates": s.rates.model_copy(update={"record_dt_s": period})})


def fly(flight: Flight) -> dict[str, Any]:
    """The row of one run; one that cannot be flown says why, and counts as lost."""
    from testbed.simulation.simulate import run

    try:
        return row(run(flight.scenario(), force=True))
    except (OSError, MemoryError):
        raise
    except UserError as error:
        return {"refused": str(error), "lost": True}
    except Exception as error:
        return {"refused": f"{type(error).__name__}: {short(' '.join(str(error).split()))}", "lost": True}


def row(done: Run) -> dict[str, Any]:
    """What is counted of a run.

    lost        whether a pair came closer than Ds, or the run ended before its end
    distance_m  least distance of any pair of which one is under the filter
    overridden  share of filter steps at which the most altered vehicle's command was altered
    arrived, due  vehicles that came to their goals, of those with one
    added_s     mean time that this took them longer than alone; added_m: largest path added
    """
    nearest = nearest_approach(done)
    altered = done.guarantee(INTERVENTION.id)
    s = parse(done.manifest["scenario"], keep_idle=True)
    due = seeking(s)
    added = {
        name: [x for x, of in zip(altered["detail"].get(name, []), due, strict=False) if of]
        for name in ("path_added_m", "time_added_s")
    }
    known = [x for x in added["time_added_s"] if x is not None]
    paths = [x for x in added["path_added_m"] if x is not None]
    return {
        "refused": "",
        "lost": nearest.status is not Status.HOLDS,
        "ended_early": done.manifest["ended_early"] or "",
        "distance_m": nearest.value,
        "at_s": nearest.instant,
        "overridden": altered["value"],
        "infeasible": done.guarantee(QP_FEASIBILITY.id)["value"],
        "arrived": len(paths),
        "due": int(due.sum()),
        "added_s": float(np.mean(known)) if known else None,
        "added_m": max(paths) if paths else None,
    }
