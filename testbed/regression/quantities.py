"""What a baseline remembers of a run: guarantee values, verdicts, tracking errors, ledger quantiles."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from testbed.campaigns.job import Job
from testbed.claims import registry
from testbed.components.components import Parts
from testbed.measures import hdot_ledger
from testbed.records.run import Run
from testbed.records.verdict import Status
from testbed.requirements.requirement import Requirement
from testbed.scenario import fleet
from testbed.scenario.scenario import Scenario, parse
from testbed.simulation.simulate import run
from testbed.studies.common.measure import Fields, job_of, override


@dataclass(frozen=True)
class Quantity:
    """One number of a run.

    worse       +1 where a larger one is worse, -1 where a smaller one is
    resolution  the smallest change that is reported, in `unit`; 0 for verdicts
    verdict     1 where the claim was lost and 0 where it held, not a measurement
    """

    name: str
    unit: str
    worse: int
    resolution: float
    verdict: bool = False


# claim -> which way is worse, resolution.
_VALUES = {
    registry.SEPARATION: (-1, 0.01),
    registry.SAFE_SET: (-1, 0.01),
    registry.BARRIER_CONDITION: (-1, 0.01),
    registry.ZCBF_CONDITION: (-1, 0.01),
    registry.QP_FEASIBILITY: (+1, 1.0),
    registry.GOAL: (+1, 0.1),
    registry.INTERVENTION: (+1, 0.01),
}
# Of scenarios with fences alone.
_FENCED = {registry.FENCE_CLEARANCE: (-1, 0.01), registry.FENCE_SAFE_SET: (-1, 0.01)}
_BESIDE = {registry.SEPARATION_INTRUDERS: (-1, 0.01)}
# Commands and rows come to their bound within rounding: of these two only the status is compared.
_JUDGED = (
    *(claim for claim in _VALUES if claim is not registry.INTERVENTION),
    registry.COMMAND_LIMITS,
    registry.ROWS_SATISFIED,
)
_PROMISED = {claim: (-1, 0.01) for claim in registry.OWN}
_TRACKING = {
    "speed": ("v_mps", "v_command_mps", 1.0, "m/s"),
    "turn-rate": ("omega_radps", "omega_command_radps", 180.0 / np.pi, "deg/s"),
    "climb-rate": ("zeta_mps", "zeta_command_mps", 1.0, "m/s"),
}
# Part of the ledger's residual -> quantile; the low ones, for a residual below zero loses h.
_LEDGER = (("total", "0.01"), ("total", "0.05"), *((name, "0.05") for name in hdot_ledger.CHANNELS))
# Pairs with h below this are in the ledger; stated here, for baselines are kept for years [m].
_NEAR_H_M = 10.0
_END = "flown to the end"
DIGITS = 6


def quantities(
    s: Scenario, own_filter: bool = False, requirements: Mapping[str, str] | None = None
) -> list[Quantity]:
    """All that is remembered of a run of `s`, in the order it is shown.

    own_filter    whether the filter is a user's own: then what it promises by its declaration is remembered
                  too
    requirements  name -> formula: their robustness is remembered, and whether it was lost
    """
    h = "m" if s.barrier.form == "root" else "m^2"
    values = _values(s, own_filter)
    found = [
        Quantity(claim.id, claim.unit_of(s.barrier.form), worse, size)
        for claim, (worse, size) in values.items()
    ]
    found += [Quantity(f"{n} tracking", unit, +1, 0.01) for n, (*_, unit) in _TRACKING.items()]
    found += [Quantity(_ledger_name(part, q), f"{h}/s", -1, 0.01) for part, q in _LEDGER]
    asked = requirements or {}
    found += [Quantity(name, Requirement(text).unit, -1, 0.01) for name, text in asked.items()]
    judged = [*(claim.id for claim in _judged(s, own_filter)), *asked]
    found += [Quantity(f"{name} lost", "", +1, 0.0, verdict=True) for name in judged]
    return [*found, Quantity(f"not {_END}", "", +1, 0.0, verdict=True)]


def job(
    s: Scenario,
    label: str,
    fields: Fields,
    seed: int,
    parts: Parts | None = None,
    requirements: Mapping[str, str] | None = None,
) -> Job:
    """A run of `s` with `fields` set, recorded at every filter step: tracking and ledger need all of them."""
    data = json.loads(override(s, fields))
    data["rates"]["record_dt_s"] = data["rates"]["filter_dt_s"]
    made = job_of(label, json.dumps(data, sort_keys=True), seed, parts)
    return replace(made, requirements=tuple((requirements or {}).items()))


def fly(job: Job) -> dict[str, float | None]:
    """Quantity -> its value, to six digits; None where the run has none, as one that ended early."""
    s = parse(json.loads(job.data) | {"seed": job.seed})
    parts = job.own()
    own = parts is not None and "filter" in parts.own()
    done = run(s, force=True, parts=parts)
    names = [q.name for q in quantities(s, own, dict(job.requirements))]
    if done.manifest["ended_early"]:
        return {n: 1.0 if n.endswith(" lost") or n == f"not {_END}" else None for n in names}
    verdicts = {v.id: v for v in done.guarantees}
    # A filter that declares no barrier has no promise of its own.
    row = {claim.id: verdicts[claim.id].value if claim.id in verdicts else None for claim in _values(s, own)}
    row |= _tracking(done, s.vehicles)
    quantiles = hdot_ledger.summary(done, _NEAR_H_M)["quantiles"]
    row |= {_ledger_name(part, q): quantiles[part][q] if quantiles else None for part, q in _LEDGER}
    for claim in _judged(s, own):
        status = verdicts[claim.id].status if claim.id in verdicts else Status.NOT_APPLICABLE
        row[f"{claim.id} lost"] = (
            None if status is Status.NOT_APPLICABLE else float(status is not Status.HOLDS)
        )
    for name, text in job.requirements:
        judged = Requirement(text).judge(done)
        row[name], row[f"{name} lost"] = judged.value, float(judged.status is not Status.HOLDS)
    row[f"not {_END}"] = 0.0
    return {n: _rounded(row[n]) for n in names}


def _judged(s: Scenario, own_filter: bool) -> tuple[registry.Claim, ...]:
    """The claims whose statuses are compared."""
    return (*_JUDGED, *(claim for claim in _values(s, own_filter) if claim not in _VALUES))


def _values(s: Scenario, own_filter: bool) -> dict[registry.Claim, tuple[int, float]]:
    """The claims whose values are compared: of fences, intruders and a user's filter where there are some."""
    more = (_FENCED if s.fence else {}) | (_PROMISED if own_filter else {})
    return _VALUES | more | (_BESIDE if fleet.intruders(s) else {})


def _tracking(done: Run, vehicles: int) -> dict[str, float | None]:
    """RMS of what was achieved at the end of each filter period minus what was commanded for it."""
    rows = done.tables["vehicles"]
    errors = {}
    for name, (achieved, commanded, factor, _) in _TRACKING.items():
        error = rows[achieved].reshape(-1, vehicles)[1:] - rows[commanded].reshape(-1, vehicles)[:-1]
        errors[f"{name} tracking"] = float(np.sqrt(np.mean(error**2))) * factor if error.size else None
    return errors


def _ledger_name(part: str, quantile: str) -> str:
    return f"ledger {part} {100 * float(quantile):g} %"


def _rounded(value: float | None) -> float | None:
    if value is None or not np.isfinite(value):
        return None
    return float(f"{value:.{DIGITS}g}")
