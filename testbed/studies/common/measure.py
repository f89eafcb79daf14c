"""Flies one run of a study and returns the few numbers that studies compare."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from testbed.campaigns.job import Job
from testbed.campaigns.sent_parts import SentParts
from testbed.claims.nearest import nearest_approach
from testbed.claims.registry import GOAL, INTERVENTION, PROGRESS, QP_FEASIBILITY, SAFE_SET, START_SAFE
from testbed.components.components import Parts
from testbed.components.installed_parts import effective
from testbed.scenario.scenario import Scenario, parse
from testbed.scenario.start import RandomGoals

Fields = dict[str, Any]
# The flow filter's own clearance: what flow.md calls F1.
FLOW_CLEAR = "monitor-flow_clear"
STARTS = {"lateral_perturbation_m": 10.0, "heading_perturbation_deg": 5.0, "height_perturbation_m": 1.0}


def measure(job: Job, parts: Parts | None = None) -> dict[str, Any]:
    """Fly `job` and return what studies compare.

    parts  instead of the job's own
    A run that cannot start has nan values and says why.
    """
    from testbed.errors import UserError
    from testbed.simulation.simulate import run

    try:
        done = run(job.scenario(), force=True, parts=parts or job.own())
    except UserError as error:
        return {"rung": job.label, "seed": job.seed, "refused": str(error)}
    row = {
        "rung": job.label,
        "seed": job.seed,
        "refused": "",
        "ended_early": done.manifest["ended_early"] or "",
    }
    row["start_safe"] = done.guarantee(START_SAFE.id)["verdict"] == "holds"
    for column, verdict in (
        ("distance_m", nearest_approach(done)),
        ("h_m", done.guarantee(SAFE_SET.id)),
        ("infeasible", done.guarantee(QP_FEASIBILITY.id)),
    ):
        row[column] = verdict["value"]
        row[f"{column.partition('_')[0]}_verdict"] = verdict["verdict"]
    row["overridden_share"] = done.guarantee(INTERVENTION.id)["value"]
    for name in ("path_added_m", "time_added_s"):
        added = done.guarantee(INTERVENTION.id)["detail"][name]
        home = [a for a in added if a is not None]
        row["arrived_share"] = len(home) / len(added)
        # The cost is not known before every vehicle has arrived.
        row[name] = max(home) if len(home) == len(added) else None
    row["goal_m"] = done.guarantee(GOAL.id)["value"]
    row["goal_passed_s"] = done.guarantee(GOAL.id)["detail"].get("last_passed_s")
    others = {v.id: v for v in done.guarantees}
    # Vehicles that waited longer than G7b allows, and the longest wait; a run too short to tell has neither.
    row["waiting"] = others[PROGRESS.id].detail.get("waiting") if PROGRESS.id in others else None
    row["wait_s"] = others[PROGRESS.id].value if PROGRESS.id in others else None
    row["flow_m"] = others[FLOW_CLEAR].value if FLOW_CLEAR in others else None
    return row


def keys(jobs: Iterable[Job]) -> list[str]:
    """Per job, the name of all that its row depends on; UserError for an airframe that is not there."""
    from testbed.campaigns.identity import RunIds

    ids = RunIds(__name__)
    return [ids.of(job.data, job.seed, job.parts.origins if job.parts else "") for job in jobs]


def job_of(
    label: str, data: str, seed: int, parts: Parts | None = None, guarantee: str = "", force: bool = True
) -> Job:
    """One run of a study: the scenario of `data` (JSON) with the parts that were given.

    Raises  UserError for a part that cannot be told apart by checksum, or sent to a worker
    """
    return Job(label, data, seed, guarantee, force, parts=_sent(data, parts))


@lru_cache(maxsize=256)
def _sent(data: str, parts: Parts | None) -> SentParts | None:
    # A scenario may name parts of installed packages.
    return SentParts.of(effective(parse(json.loads(data), keep_idle=True), parts))


def said(job: Job, row: dict[str, Any]) -> str:
    """A run in a few words: its least distance, or why it could not start."""
    value = row.get("distance_m")
    return f"{job.label}, seed {job.seed}: " + (row["refused"] if value is None else f"{value:.2f} m")


def override(s: Scenario, fields: Fields) -> str:
    """The scenario's data with `fields` set, as JSON; recording thinned, the manoeuvre not flown.

    Raises UserError where the scenario cannot have them: better now than as a run that could not start.
    """
    from testbed.scenario.variants import changed

    dt = fields.get("rates.filter_dt_s", s.rates.filter_dt_s)
    thin = {"checks.manoeuvre_instants": 0, "rates.record_dt_s": dt * max(1, round(1.0 / dt))}
    return json.dumps(changed(s, fields | thin).model_dump(mode="json"), sort_keys=True)


def default_starts(s: Scenario) -> Scenario:
    """The scenario, its starts perturbed by +-10 m, +-5 deg, +-1 m.

    If it perturbs them itself, says that it does not (a perturbation of 0), or draws starts and goals, it is
    left as it is.
    """
    start = s.start
    own = any(getattr(start, name) or name in start.model_fields_set for name in STARTS)
    if own or isinstance(start, RandomGoals):
        return s
    return s.model_copy(update={"start": start.model_copy(update=STARTS)})
