"""Flies one run of a campaign in a worker: takes a job, returns a row of plain data."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from typing import Any

from testbed.campaigns.identity import code_id
from testbed.campaigns.job import Job
from testbed.claims.registry import INTERVENTION
from testbed.components.components import Parts
from testbed.errors import UserError, short
from testbed.measures.encounter_measures import measured
from testbed.measures.progress import seeking
from testbed.records.checksums import plain
from testbed.records.run import Run
from testbed.records.verdict import Status
from testbed.requirements.requirement import Requirement, recorded_at_every_step
from testbed.scenario.scenario import Scenario, parse
from testbed.simulation.simulate import run

FLOWN, REFUSED, FAILED = "flown", "refused", "failed"

# Faults of the machine, not of the run: without disk or memory the campaign stops, and can be resumed.
NOT_THE_RUNS = (OSError, MemoryError)


def fly(job: Job) -> dict[str, Any]:
    """The row of one run: status, reason, (value, verdict) of every guarantee, and who arrived.

    A scenario that is refused, or an error within the run, is a row. Raises UserError if this process runs
    other code or has other parts, OSError or MemoryError if the machine has no room.
    """
    if code_id() != job.code:
        raise UserError(f"a worker runs other code ({code_id()}) than this campaign began with ({job.code})")
    own = job.own()
    try:
        return _flown(job.scenario(), job, own)
    except NOT_THE_RUNS:
        raise
    except UserError as error:
        if isinstance(error.__context__, NOT_THE_RUNS):
            raise
        return blank(REFUSED, str(error))
    except Exception as error:
        return blank(FAILED, f"{type(error).__name__}: {short(' '.join(str(error).split()))}")


def blank(status: str, reason: str) -> dict[str, Any]:
    """The row of a run without results."""
    return {"status": status, "reason": reason, "ended_early": None, "guarantees": {}}


def row(done: Run, requirements: Sequence[tuple[str, str]] = ()) -> dict[str, Any]:
    """Value and verdict of every claim, robustness and verdict of every requirement, by name; who arrived.

    arrived  how many vehicles passed their goal, of how many that have one, and the mean time [s] that this
             took them longer than alone; None where that is not known of any
    """
    found = {g.id: [_number(g.value), g["verdict"]] for g in done.guarantees}
    for name, text in requirements:
        judged = Requirement(text).judge(done)
        found[name] = [judged.value, judged.status]
    return {
        "status": FLOWN,
        "reason": None,
        "ended_early": done.manifest["ended_early"],
        "guarantees": plain(found),
        "arrived": _arrived(done),
    }


def _arrived(done: Run) -> list[Any]:
    detail = done.guarantee(INTERVENTION.id)["detail"]
    due = seeking(parse(done.manifest["scenario"], keep_idle=True))
    paths, times = (detail.get(name, [None] * len(due)) for name in ("path_added_m", "time_added_s"))
    known = [added for added, of in zip(times, due, strict=True) if added is not None and of]
    arrived = sum(path is not None and bool(of) for path, of in zip(paths, due, strict=True))
    return [arrived, int(due.sum()), sum(known) / len(known) if known else None]


def lost(result: dict[str, Any], guarantee: str) -> bool:
    """Whether a run did not keep the guarantee: one that is missing, void or ended early did not."""
    return bool(result["guarantees"].get(guarantee, [None, ""])[1] != Status.HOLDS)


def _flown(s: Scenario, job: Job, own: Parts | None) -> dict[str, Any]:
    if job.requirements or job.measures:
        # They are judged and measured on the columns.
        s = recorded_at_every_step(s)
    elif job.folder is None:
        # Verdicts are tracked at every step whatever is recorded.
        steps = max(1, s.filter_steps)
        rates = s.rates.model_copy(update={"record_dt_s": steps * s.rates.filter_dt_s})
        s = s.model_copy(update={"rates": rates})
    done = run(s, job.folder, force=job.force, overwrite=True, parts=own)
    made = row(done, job.requirements)
    if job.measures is not None:
        made["measures"] = plain(measured(done, job.measures))
    if job.folder is not None and job.guarantee and not lost(made, job.guarantee):
        shutil.rmtree(job.folder)
    return made


def _number(value: Any) -> float | None:
    return None if value is None else float(value)
