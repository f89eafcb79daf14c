"""Judges a finished flight: its verdicts and its manifest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.replay import Replay
from filters.filter import declaration
from filters.model import Array, State
from testbed.claims import guarantees, judging, manoeuvre, own_filter, promises, registry
from testbed.claims.fences import fence_claims
from testbed.claims.flyable import unflyable
from testbed.claims.monitored import monitored
from testbed.claims.premises import premises
from testbed.claims.progress import progress
from testbed.claims.ranges import ranges
from testbed.components import catalogue
from testbed.components.border.contract import Breach, describe
from testbed.components.border.others import OwnFilter
from testbed.components.following.arrival import CircleAtGoal
from testbed.components.initial_conditions import generators
from testbed.components.provenance import Origin
from testbed.components.versions import versions
from testbed.measures.near_misses import NearMisses
from testbed.measures.run_statistics import RunStatistics
from testbed.measures.solo_time import solo_time
from testbed.records.run import Run
from testbed.records.store import SCHEMA_VERSION
from testbed.records.verdict import Verdict
from testbed.scenario import guidance_rules
from testbed.scenario.scenario import Scenario
from testbed.simulation.assembly import Assembled, Setting
from testbed.simulation.leaving import Leaving


def judge(
    setting: Setting,
    made: Assembled | None,
    statistics: RunStatistics,
    own: dict[str, Origin],
    end: str | None,
    left: Leaving | None = None,
) -> Run:
    """The run, with all claims judged; its tables and its wall time are left to the caller.

    made  None where a part could not be made
    own   the parts that are not the scenario's -> where they come from
    left  who has left, and when; None where vehicles do not leave
    end   why the run ended before its time, or None
    """
    s, barrier, limits = setting.scenario, setting.barrier, setting.limits
    start = setting.start.position
    straight = np.linalg.norm(setting.goal - start, axis=-1)
    aircraft = made.aircraft if made else ()
    alone = _solo_time(setting, made, "nominal" in own) if made else None
    pairs, safe = (setting.i, setting.j), (setting.started_safe, setting.started_in_fences)
    flown = guarantees.Flown(s, statistics, *pairs, safe[0], end, straight, alone, safe[1], setting.roles)
    # What a user's plant can fly steadily is unknown: that is no pass.
    unknown = [f"unknown whether {own['plant'].name} can fly it"] if "plant" in own else []
    verdicts = premises(flown, barrier, limits, unknown or unflyable(s, barrier, aircraft))
    verdicts += ranges(flown) + guarantees.judge(flown) + progress(flown) + fence_claims(flown)
    if made and made.replay and statistics.near_misses and end is None:
        statistics.near_misses.close()
        try:
            verdicts.append(_fly_manoeuvre(setting, made, made.replay, statistics.near_misses, left))
        except Exception as error:
            unflown = flown.unjudged(registry.MANOEUVRE_KEEPS_DS)
            why = str(error) if isinstance(error, Breach) else describe(error)
            verdicts.append(judging.premise_not_met(unflown, f"while flying gamma: {why}"))
    parts = {part: where.to_json() for part, where in own.items()}
    manifest = _manifest(s, statistics, end, aircraft) | ({"parts": parts} if own else {})
    if made and isinstance(made.filter, OwnFilter) and made.filter.declared:
        manifest["declared"] = made.filter.declared
        verdicts = own_filter.judged_by_its_own(verdicts, s, statistics, setting.i, setting.j, end)
    elif "filter" not in own:
        verdicts = own_filter.excused(verdicts, promises.excused(declared=False, kind=s.filter.kind))
    if left is not None:
        manifest["left_s"] = left.summary()
    if statistics.tracks is not None:
        manifest["track_error"] = statistics.tracks.summary()
    record = declaration(made.filter).record if made else None
    if record is not None:
        verdicts += monitored(record, s)
    if record is not None and record.numbers:
        manifest["flow"] = dict(record.numbers)
    if record is not None and record.compares:
        manifest["qp_cost"] = {
            "steps": record.compared,
            "centralised": record.cost,
            "limited": record.cost_limited,
        }
    return Run(manifest, judging.void(verdicts, end), {})


def _solo_time(setting: Setting, made: Assembled, own: bool) -> Array | None:
    """See `solo_time`; None where a user's guidance does not answer there, nan for other paths.

    own  whether the guidance is a user's. The scenario's is made again: the one flown knows who has arrived
    """
    start, goal = setting.start.position, setting.goal
    straight = guidance_rules.straight_to_goal(setting.scenario)
    if not any(straight):
        return None
    try:
        law = made.guidance if own else catalogue.guidance(setting.scenario, goal, setting.barrier)
        law = law.law if isinstance(law, CircleAtGoal) else law
        alone = solo_time(law, setting.limits, start, goal, setting.scenario.goal_radius_m)
    except Breach:
        return None
    return np.where(straight, alone, np.nan)


def _fly_manoeuvre(
    setting: Setting, made: Assembled, replay: Replay, near_misses: NearMisses, left: Leaving | None
) -> Verdict:
    """G9: the evading manoeuvre flown from instants of the flight that `replay` remembers."""
    s = setting.scenario

    def wind(t: float, state: State) -> Array:
        air = made.environment.wind(t, state)
        return np.zeros((s.vehicles, 3)) if air is None else air

    when = manoeuvre.instants(s, near_misses, s.duration_s)
    pairs = setting.i, setting.j
    rest = setting.barrier, setting.limits, when, *pairs, made.arcs, setting.roles
    if left is not None:
        return manoeuvre.fly(s, replay.branch, wind, *rest, left_s=left.left_s)
    return manoeuvre.fly(s, replay.branch, wind, *rest)


def _manifest(
    s: Scenario, statistics: RunStatistics, end: str | None, aircraft: Sequence[Airframe]
) -> dict[str, Any]:
    steps = max(1, statistics.filter_steps)
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": s.model_dump(mode="json"),
        "seed_streams": list(generators(s.seed)),
        "versions": versions(),
        "airframes": catalogue.airframe_hashes(s, aircraft),
        "ended_early": end,
        "filter_steps": statistics.filter_steps,
        "worst_qp_residual": statistics.worst_residual,
        "override_share": (statistics.override_steps / steps).tolist(),
    }
