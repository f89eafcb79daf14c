"""Estimates the probability of an event over a scenario's random starts, and writes what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from testbed.campaigns.display import Display
from testbed.campaigns.engine import open_pool
from testbed.campaigns.journal import journal_beside
from testbed.components.components import Parts
from testbed.errors import UserError, nearest
from testbed.rare_events import importance, subset
from testbed.rare_events.estimate import Estimate
from testbed.records.checksums import plain
from testbed.records.store import staged, write_json
from testbed.statistics import rate
from testbed.studies.common.found import Found, provenance, titled
from testbed.studies.falsify.space import Space
from testbed.studies.rare.flights import Event, Flights

METHODS = ("subset", "importance", "plain")
_AT_ONCE = 200


@dataclass(frozen=True)
class Plan:
    """How the probability is estimated.

    runs         subset: of each level; importance: from the final proposal; plain: in all
    repetitions  of subset simulation
    adapting     importance: runs of each level of the adaptation
    modes        importance: normal distributions of the adapted proposal
    shifts       importance: the user's own proposal, number -> its mean; empty: adapted
    spread       importance: deviation of that proposal
    """

    method: str
    runs: int
    repetitions: int = 10
    adapting: int = 150
    modes: int = 2
    shifts: Mapping[str, float] = field(default_factory=dict)
    spread: float = 1.0
    seed: int = 1


def numbers(space: Space) -> list[str]:
    """What the numbers of a start are called: lateral-1 is the first vehicle's offset to its left."""
    return [f"{atom.kind.rpartition('_')[0]}-{atom.vehicle}" for atom in space.atoms]


def rare(
    space: Space,
    event: Event,
    plan: Plan,
    out: Path,
    workers: int | None,
    overwrite: bool = False,
    parts: Parts | None = None,
) -> Found:
    """Fly, estimate, and write `out`: rare.json. Interrupted, the same command goes on from the runs kept."""
    names = numbers(space)
    proposal = _proposal(plan, names)
    rng = np.random.default_rng(plan.seed)
    with (
        journal_beside(out, "rare") as journal,
        Display() as display,
        open_pool(_AT_ONCE, workers) as pool,
    ):
        state = Flights(space, event, journal, pool, display, parts)
        match plan.method:
            case "subset":
                found = subset.estimate(state, space.size, rng, plan.runs, plan.repetitions)
            case "importance":
                found = importance.estimate(
                    state, space.size, rng, plan.runs, plan.adapting, proposal, plan.modes
                )
            case _:
                found = _plain(state, space.size, rng, plan.runs)
        with staged(out, overwrite) as folder:
            data = _account(space, event, plan, found, state, parts)
            write_json(folder / "rare.json", data)
    return Found(out, _title(space, event, parts), [_row(found)], sentences(found, plan, names), data)


def _proposal(plan: Plan, names: list[str]) -> importance.Proposal | None:
    if not plan.shifts:
        return None
    mean = np.zeros(len(names))
    for name, value in plan.shifts.items():
        if name not in names:
            raise UserError(f"--shift {name}={value:g}: a start has no such number; {nearest(name, names)}")
        mean[names.index(name)] = value
    return importance.Proposal.stated(mean, plan.spread)


def _plain(state: Flights, size: int, rng: np.random.Generator, runs: int) -> Estimate:
    """Plain sampling, some runs at a time."""
    values = np.concatenate(
        [state(rng.standard_normal((min(_AT_ONCE, runs - k), size))) for k in range(0, runs, _AT_ONCE)]
    )
    missing = int(np.isnan(values).sum())
    doubts = (f"{missing} runs have no value and count as no event",) if missing else ()
    seen = rate(values < 0.0)
    p = seen.value
    error = float(np.sqrt((1 - p) / (p * runs))) if p else np.nan
    method = f"plain sampling; {seen.method}"
    return Estimate(
        p, seen.low, seen.high, runs, error, seen.confidence, method, doubts, {"events": seen.count}
    )


def _account(
    space: Space, event: Event, plan: Plan, found: Estimate, state: Flights, parts: Parts | None
) -> dict[str, Any]:
    s = space.scenario
    said = asdict(found) | {"plain_runs": found.plain_runs if np.isfinite(found.plain_runs) else None}
    said["error"] = found.error if np.isfinite(found.error) else None
    return {
        "event": str(event),
        "plan": plain(asdict(plan)),
        "bounds": {k: v for k, v in vars(space.bounds).items() if k not in ("wind_mps", "latency_s")},
        "numbers": numbers(space),
        "estimate": plain(said),
        "refused": len(state.refused),
        "refusals": sorted(set(state.refused))[:5],
        **provenance(s, s.plant, parts),
    }


def _title(space: Space, event: Event, parts: Parts | None) -> str:
    return f"{titled(space.scenario, parts)}: probability of {event}"


def _row(found: Estimate) -> dict[str, Any]:
    plain_runs = found.plain_runs
    return {
        "probability": f"{found.probability:.3g}",
        f"{100 * found.confidence:.3g} % interval": f"{found.low:.3g} to {found.high:.3g}",
        "runs": found.runs,
        "plain sampling needs": f"{plain_runs:.3g}" if np.isfinite(plain_runs) else "",
    }


def sentences(found: Estimate, plan: Plan, names: list[str]) -> list[str]:
    """What the estimate says, in words."""
    lines = [found.method]
    if plan.method == "importance":
        seen = found.detail
        lines.append(
            f"{seen['events']} of {plan.runs} runs had the event"
            + (f", of the weight of {seen['effective_events']:.0f} equal ones" if seen["events"] else "")
        )
        parts = list(zip(seen["shares"], seen["means"], seen["deviations"], strict=True))
        for share, mean, deviation in parts[: max(1, len(parts) // 2)]:
            each = ", ".join(
                f"{n} {m:+.2f} ({d:.2f})" for n, m, d in zip(names, mean, deviation, strict=True)
            )
            lines.append(f"proposal, share {share:.2f}, in deviations: {each}")
    if plan.method == "subset":
        lines.append("levels: " + ", ".join(f"{level:.3g}" for level in found.detail["levels"]))
    return lines + [f"doubt: {doubt}" for doubt in found.doubts]
