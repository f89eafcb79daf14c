"""Checks the [[vehicle]] tables of a scenario against one another and against the scenario's own tables."""

from __future__ import annotations

from testbed.scenario import fleet
from testbed.scenario.barrier import Euclidean, Manoeuvre, PairTurns
from testbed.scenario.contents import Contents
from testbed.scenario.tables import InputSet


def check_tables(s: Contents) -> None:
    """Raises ValueError naming the first vehicle, from 1, whose table does not fit the scenario."""
    if not s.vehicle:
        return
    count, lost = len(s.vehicle), fleet.intruders(s)
    if s.vehicles != count:
        raise ValueError(
            f"vehicles: {s.vehicles}, but {count} [[vehicle]] table{'s' if count > 1 else ''};"
            " leave vehicles out, or write a table for each"
        )
    if len(lost) == count:
        raise ValueError("vehicle: every vehicle is an intruder (filter = false); leave one under the filter")
    if lost and getattr(s.filter, "monitor", False):
        raise ValueError("filter.monitor: it checks theorems that do not cover intruders; set it to false")
    if lost and isinstance(s.barrier, PairTurns):
        raise ValueError("barrier.shared: intruders need a manoeuvre of each vehicle; set it to true")
    if lost and s.remedy.air_mass and s.intruders.assume == "nothing":
        raise ValueError(
            "intruders.assume: 'nothing' bounds an intruder over the ground, and remedy.air_mass filters in"
            " the moving air; use 'keep-course'"
        )
    boxes = fleet.limits(s)
    for k, v in enumerate(s.vehicle):
        if v.manoeuvre is not None:
            _own_manoeuvre(s, k)
        if v.guidance is not None and "delay_steps" in v.guidance.model_fields_set:
            raise ValueError(
                f"vehicle.{k + 1}.guidance.delay_steps: one for all; guidance.delay_steps says it"
            )
        own = v.manoeuvre is not None or any(value is not None for _, value in v.limits)
        if own and k not in lost and not isinstance(s.barrier, PairTurns | Euclidean):
            _within(k, v.manoeuvre or fleet.manoeuvre(s.barrier, k), boxes[k])


def _own_manoeuvre(s: Contents, k: int) -> None:
    where = f"vehicle.{k + 1}.manoeuvre"
    if isinstance(s.barrier, PairTurns):
        raise ValueError(f"{where}: barrier.shared = false gives each pair its own; leave out one of them")
    if isinstance(s.barrier, Euclidean):
        raise ValueError(f"{where}: a 'euclidean' barrier uses no manoeuvre; barrier.kind = 'rollout' does")


def _within(k: int, m: Manoeuvre, box: InputSet) -> None:
    """ValueError where a vehicle with limits or a manoeuvre of its own cannot be commanded the latter."""
    where, table = f"vehicle.{k + 1}", "[vehicle.manoeuvre]"
    out = ""
    if m.v_mps < box.v_min_mps:
        out = f"v_mps {m.v_mps:g} is below v_min_mps {box.v_min_mps:g}"
    elif m.v_mps > box.v_max_mps:
        out = f"v_mps {m.v_mps:g} is above v_max_mps {box.v_max_mps:g}"
    elif abs(m.omega_degps) > box.omega_max_degps:
        out = f"omega_degps {m.omega_degps:g} is beyond omega_max_degps {box.omega_max_degps:g}"
    elif abs(m.zeta_mps) > box.zeta_max_mps:
        out = f"zeta_mps {m.zeta_mps:g} is beyond zeta_max_mps {box.zeta_max_mps:g}"
    if out:
        raise ValueError(
            f"{where}: its limits exclude its manoeuvre: {out}; change {where}.limits, or give it another"
            f" {table}"
        )
