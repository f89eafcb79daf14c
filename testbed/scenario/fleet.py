"""Works out what each vehicle of a scenario has, from its [[vehicle]] table and the scenario's own tables."""

from __future__ import annotations

import numpy as np

from testbed.scenario.barrier import Barrier, Manoeuvre, PairTurns, Rollout, Straight, Turn
from testbed.scenario.contents import Contents
from testbed.scenario.guidance import Guidance
from testbed.scenario.tables import InputSet


def airframes(s: Contents) -> list[str]:
    """The airframe of each vehicle, as it is named."""
    common = [s.airframes[k % len(s.airframes)] for k in range(s.vehicles)]
    return [v.airframe or name for v, name in zip(s.vehicle, common, strict=True)] if s.vehicle else common


def named_airframes(s: Contents) -> list[str]:
    """What the scenario lists and its vehicles name, as often as they do."""
    return [*s.airframes, *(v.airframe for v in s.vehicle if v.airframe is not None)]


def speeds(s: Contents) -> list[float]:
    """Ground speed of each vehicle at the start [m/s]."""
    common = s.start.speed_mps
    if not s.vehicle:
        return [common] * s.vehicles
    return [common if v.speed_mps is None else v.speed_mps for v in s.vehicle]


def limits(s: Contents) -> list[InputSet]:
    """The input set of each vehicle.

    Raises  ValueError naming the vehicle whose own limits and [limits] are no set together
    """
    if not s.vehicle:
        return [s.limits] * s.vehicles
    made = []
    for number, v in enumerate(s.vehicle, 1):
        own = {name: value for name, value in v.limits if value is not None}
        low, high = (own.get(name, getattr(s.limits, name)) for name in ("v_min_mps", "v_max_mps"))
        if low > high:
            raise ValueError(f"vehicle.{number}.limits: v_min_mps {low:g} is above v_max_mps {high:g}")
        made.append(s.limits.model_copy(update=own))
    return made


def guidances(s: Contents) -> list[Guidance]:
    """The guidance table of each vehicle: its own, completed by the scenario's where that is of its kind."""
    made = []
    for v in s.vehicle:
        own, common = v.guidance, s.guidance
        if own is not None and type(own) is type(common):
            absent = {name: x for name, x in common if name not in own.model_fields_set}
            own = own.model_copy(update=absent)
        made.append(own or common)
    return made or [s.guidance] * s.vehicles


def intruders(s: Contents) -> tuple[int, ...]:
    """Vehicles that fly without the filter and do not cooperate, from 0."""
    return tuple(k for k, v in enumerate(s.vehicle) if not v.filter)


def barrier(s: Contents) -> Barrier:
    """The [barrier] table, or the rollout over each vehicle's manoeuvre where vehicles have their own."""
    if not any(v.manoeuvre for v in s.vehicle):
        return s.barrier
    b = s.barrier
    manoeuvres = [v.manoeuvre or manoeuvre(b, k) for k, v in enumerate(s.vehicle)]
    return Rollout(
        kind="rollout",
        form=b.form,
        gradient=b.gradient,
        gradient_step=b.gradient_step,
        manoeuvres=manoeuvres,
    )


def manoeuvre(b: Barrier, k: int) -> Manoeuvre:
    """The manoeuvre of vehicle k (from 0) by a [barrier] table that has one for it.

    Raises  ValueError for a barrier whose pairs have one each
    """
    match b:
        case Rollout():
            return b.manoeuvres[k if len(b.manoeuvres) > 1 else 0]
        case Straight():
            climb = np.ravel(b.zeta_mps)
            speed = b.v_mps * (1.0 + b.speed_step * (k + 1))
            return Manoeuvre(v_mps=speed, zeta_mps=float(climb[k % climb.size]))
        case Turn():
            ratio = np.ravel(b.sigma)
            return Manoeuvre(v_mps=b.v_mps * float(ratio[k % ratio.size]), omega_degps=b.omega_degps)
        case PairTurns():
            raise ValueError("barrier.shared: each pair has a manoeuvre of its own, no vehicle has one")
    return Manoeuvre(v_mps=b.v_mps, omega_degps=b.omega_degps)
