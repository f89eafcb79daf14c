"""Recording a baseline: its rungs flown from the same seeds, block by block."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from testbed.campaigns.distinct import check_random
from testbed.campaigns.engine import fly_all
from testbed.campaigns.job import Job
from testbed.claims.registry import SEPARATION
from testbed.components import catalogue
from testbed.components.components import Parts
from testbed.components.versions import versions
from testbed.errors import UserError, nearest
from testbed.regression.baseline import (
    Baseline,
    checked,
    differences,
    parse_file,
    place,
    relative,
    scenario_of,
    write,
)
from testbed.regression.judging import findings
from testbed.regression.own_parts import changed_parts, check_given, own_parts
from testbed.regression.quantities import fly, job, quantities
from testbed.regression.staleness import refuse_stale
from testbed.regression.tolerance import seeds_needed, tolerance
from testbed.scenario.scenario import Scenario
from testbed.studies.common.measure import Fields
from testbed.studies.ladder.ladder import rungs as ladder

Runs = dict[str, dict[str, np.ndarray]]
UNICYCLE, AIRCRAFT = "unicycle", "6-DOF"
DEFAULT_SEEDS, DEFAULT_BLOCKS = 20, 3


def rung_fields(s: Scenario, names: list[str]) -> dict[str, Fields]:
    """Rung -> scenario fields. All rungs keep the scenario's own rates and weather, the ladder adds to them.

    The ladder's first two rungs differ in the filter's rate, which is the scenario's here.
    """
    above = ladder(s)[2:]
    known = [UNICYCLE, *(r.name for r in above)]
    for name in names:
        if name not in known:
            raise UserError(f"--rungs {name!r}: unknown rung; {nearest(name, known)}")
    if len(set(names)) != len(names) or not names:
        raise UserError(f"--rungs {','.join(names) or '(none)'}: name each rung once")
    found: dict[str, Fields] = {UNICYCLE: {"plant": "unicycle"}}
    fields: Fields = {}
    for rung in above:
        fields = fields | dict(rung.fields)
        found[rung.name] = fields
    return {name: found[name] for name in known if name in names}


def fly_rungs(
    s: Scenario,
    rungs: dict[str, Fields],
    seeds: Iterable[int],
    workers: int | None = None,
    parts: Parts | None = None,
    requirements: Mapping[str, str] | None = None,
) -> Runs:
    """Rung -> quantity -> (n,) over `seeds`, nan where a run has no value.

    parts         of the user's own, in every run
    requirements  name -> formula
    """
    chosen, own_filter = list(seeds), "filter" in own_parts(s, parts)
    jobs = [
        job(s, rung, fields, seed, parts, requirements) for rung, fields in rungs.items() for seed in chosen
    ]
    rows = fly_all(fly, jobs, workers, said=_said)
    found: Runs = {}
    names = [q.name for q in quantities(s, own_filter, requirements)]
    for k, rung in enumerate(rungs):
        of = rows[k * len(chosen) : (k + 1) * len(chosen)]
        found[rung] = {name: np.array([r[name] for r in of], dtype=float) for name in names}
    return found


def _said(job: Job, row: dict[str, float | None]) -> str:
    distance = row[SEPARATION.id]
    return f"{job.label}, seed {job.seed}" + (f": {distance:.2f} m" if distance is not None else "")


def record(
    where: Path,
    name: str,
    source: str | None = None,
    overrides: list[str] | None = None,
    *,
    reason: str | None = None,
    seeds: int | None = None,
    blocks: int | None = None,
    rungs: list[str] | None = None,
    workers: int | None = None,
    parts: Parts | None = None,
    requirements: Mapping[str, str] | None = None,
) -> tuple[Baseline, Path]:
    """Fly and write baseline `name` in folder `where`; what is not given is as the old one has it.

    parts    of the user's own, in every run: a baseline that was recorded with some needs them again
    requirements  name -> formula, whose robustness becomes a quantity
    reason   why it may change: needed where it exists, kept in its history with what it changed
    Raises   UserError for an unknown scenario or rung, too few seeds, an existing baseline without a reason
    """
    path = place(where, name)
    old = _parse_old(path) if path.is_file() else None
    if path.is_file() and not (reason or "").strip():
        raise UserError(f'{path} exists; say why it may change: --reason "..."')
    if source is None:
        if old is None:
            raise UserError(f"{name}: a new baseline needs --scenario, for example --scenario paper-2-turn")
        overrides = [*old.overrides, *(overrides or [])]
        s, kept = scenario_of(old.source, overrides, where), old.source
    else:
        overrides = overrides or []
        s, kept = scenario_of(source, overrides), relative(source, where)
    if rungs is None:
        rungs = list(old.rungs) if old else [UNICYCLE, AIRCRAFT]
    chosen = rung_fields(s, rungs)
    own = own_parts(s, parts)
    asked = checked(requirements if requirements is not None else old.requirements if old else {}, s)
    remembered = quantities(s, "filter" in own, asked)
    needed = seeds_needed(len(chosen) * len(remembered))
    n = seeds if seeds is not None else old.seeds if old else max(DEFAULT_SEEDS, needed)
    m = blocks if blocks is not None else old.blocks if old else DEFAULT_BLOCKS
    if n < needed:
        raise UserError(
            f"--seeds {n}: too few to find anything significant among {len(chosen)} rungs; give {needed}"
        )
    if m < 2:
        raise UserError(f"--blocks {m}: give at least 2, the spread over seeds is estimated from them")
    refuse_stale(s)
    check_random(s, "a baseline", n * m, one_will_do=False)
    if old is not None:
        check_given(name, old.parts, own)
    runs = fly_rungs(s, chosen, range(1, n * m + 1), workers, parts, asked)
    tolerances = {
        rung: {q.name: tolerance(q, of[q.name], n) for q in remembered} for rung, of in runs.items()
    }
    flown = s.model_copy(update={"plant": "jsbsim"})
    said: dict[str, Any] = {
        "reason": reason or "first recording",
        "versions": versions(),
        "airframes": catalogue.airframe_hashes(flown),
    }
    if own:
        said["parts"] = own
    history = [*(old.history if old else []), said]
    made = Baseline(name, kept, overrides, s, chosen, n, m, tolerances, runs, history, asked)
    if old is not None:
        said["changed"] = _changed(old, made)
    return made, write(where, made)


def _parse_old(path: Path) -> Baseline | None:
    """What stands there, if this program can read it: one of another schema is replaced, not continued."""
    try:
        return parse_file(path)
    except UserError:
        return None


def _changed(old: Baseline, new: Baseline) -> list[str]:
    """In words, what a re-recording changed: scenario, airframes, and quantities on the seeds both flew."""
    said = [f"scenario: {d}" for d in differences(old.scenario, new.scenario)]
    said += changed_parts(old.parts, new.parts)
    said += [f"airframe {a}" for a in new.airframes if new.airframes[a] != old.airframes.get(a)]
    common = min(old.seeds * old.blocks, new.seeds * new.blocks)
    now = {rung: {q: v[:common] for q, v in of.items()} for rung, of in new.runs.items() if rung in old.runs}
    recorded = {rung: {q: v[:common] for q, v in old.runs[rung].items()} for rung in now}
    both = [f for f in findings(new.quantities, recorded, now, old.tolerances, paired=True) if f.moved]
    return said + [f.sentence() for f in both]
