"""Builds the filter's own barrier, row margins and wrappers from a scenario's [remedy] table."""

from __future__ import annotations

import math
from collections.abc import Callable
from math import radians
from typing import Any, TypeVar

import numpy as np

from aircraft.airframes.schema import Airframe, Channel
from aircraft.kinematic import Lag
from filters.barriers.pairs import Barrier
from filters.constraints import Margin
from filters.filter import Choose
from filters.wrappers.air_mass import AirMass
from filters.wrappers.pose_prediction import Horizon, LaggedPose, Predicted
from filters.wrappers.row_margins import BoundedError, InputToState, Sum
from testbed.errors import UserError
from testbed.scenario import fleet
from testbed.scenario.barrier import Euclidean, Manoeuvre, Pair, PairTurns, Rollout, Straight, Turn
from testbed.scenario.nonideal import TableLags
from testbed.scenario.remedy import OF_THE_BARRIER, Remedy
from testbed.scenario.scenario import Scenario

# Fields that the testbed applies to any filter: to the Ds and manoeuvre it is made for, or around it.
FOR_ANY_FILTER = frozenset(
    f"remedy.{name}" for name in (*OF_THE_BARRIER, "prediction_s", "predict_lags", "air_mass")
)

Moved = TypeVar("Moved", Manoeuvre, Pair)


def scenario(s: Scenario) -> Scenario:
    """The scenario that the filter's barrier is built from; `s` itself if no remedy changes it."""
    r, b = s.remedy, fleet.barrier(s)
    if not (r.ds_buffer_m or r.smoothing_m2 or r.derate != 1.0 or r.derate_speed != 1.0):
        return s
    changes: dict[str, Any]
    match b:
        case Rollout():
            changes = {"manoeuvres": [_derated(m, r) for m in b.manoeuvres]}
        case PairTurns():
            changes = {"pairs": [_derated(m, r) for m in b.pairs]}
        case Straight():
            changes = {"v_mps": b.v_mps * r.derate_speed}
        case Turn() | Euclidean():
            changes = {"v_mps": b.v_mps * r.derate_speed, "omega_degps": b.omega_degps * r.derate}
    if r.smoothing_m2:
        changes |= {"smoothing_m2": r.smoothing_m2, "delta_m2": 0.0}
    update: dict[str, Any] = {"d_safe_m": s.d_safe_m + r.ds_buffer_m, "barrier": b.model_copy(update=changes)}
    if b is not s.barrier:  # the vehicles' own manoeuvres stand in it now
        update["vehicle"] = [v.model_copy(update={"manoeuvre": None}) for v in s.vehicle]
    return s.model_copy(update=update)


def for_own_filter(s: Scenario) -> Scenario:
    """The scenario that a user's filter is made from: `scenario(s)` without the remedies that are applied.

    What remains in its [remedy] is for the filter itself to take.
    """
    applied = {name: type(s.remedy).model_fields[name].default for name in s.remedy.chosen}
    applied = {name: value for name, value in applied.items() if f"remedy.{name}" in FOR_ANY_FILTER}
    if not applied:
        return s
    return scenario(s).model_copy(update={"remedy": s.remedy.model_copy(update=applied)})


def _derated(m: Moved, r: Remedy) -> Moved:
    return m.model_copy(update={"v_mps": m.v_mps * r.derate_speed, "omega_degps": m.omega_degps * r.derate})


def margin(s: Scenario) -> Margin | None:
    """The margin added to the filter's rows; None for the paper's rows."""
    r = s.remedy
    margins: list[Margin] = []
    if r.robust_v_mps or r.robust_omega_degps or r.robust_zeta_mps:
        margins.append(BoundedError(r.robust_v_mps, radians(r.robust_omega_degps), r.robust_zeta_mps))
    if r.issf_epsilon is not None:
        margins.append(
            InputToState(r.issf_epsilon, r.issf_v_mps, radians(r.issf_omega_degps), r.issf_zeta_mps)
        )
    return Sum(tuple(margins)) if len(margins) > 1 else margins[0] if margins else None


def wrap(
    s: Scenario, made: Choose, own: Barrier, lags: Callable[[Scenario], list[tuple[Lag, ...]]]
) -> Choose:
    """`made` with what the remedies wrap around it: predicted poses, and the frame of the air.

    own  the filter's own barrier
    The prediction is inside: what holds for a unicycle in calm air holds relative to the moving air.
    """
    r = s.remedy
    if r.predict_lags:
        gamma = own.manoeuvre(s.vehicles)
        if gamma is None:
            raise UserError("remedy.predict_lags: the barrier has no one evading manoeuvre; use prediction_s")
        made = Predicted(made, LaggedPose(_of_filtered(s, lags(s)), gamma))
    elif r.prediction_s:
        made = Predicted(made, Horizon(r.prediction_s))
    if r.air_mass:
        speed, towards = s.wind.speed_mps, radians(s.wind.towards_deg)
        slowest = min(box.v_min_mps for box in fleet.limits(s))
        if speed >= slowest:
            raise UserError(
                f"remedy.air_mass: a wind of {speed:g} m/s is not slower than limits.v_min_mps {slowest:g}"
            )
        made = AirMass(made, speed * np.array([math.cos(towards), math.sin(towards)]))
    return made


def _of_filtered(s: Scenario, lags: list[tuple[Lag, ...]]) -> list[tuple[Lag, ...]]:
    """The lags of each vehicle; none of intruders, which are not about to fly gamma."""
    who = fleet.intruders(s)
    each = lags * s.vehicles if who and len(lags) == 1 else lags
    return [(Lag(0.0),) * 3 if k in who else of for k, of in enumerate(each)]


def lag_table(t: TableLags) -> tuple[Lag, Lag, Lag]:
    """The lags of v, omega and zeta as the numbers of the scenario's [lags] table say."""

    def limit(most: float | None) -> float:
        return math.inf if most is None or not t.limits else most

    def constant(seconds: float | None, absent: float) -> float:
        return absent if seconds is None else seconds

    fall, rise = -limit(t.v_fall_max_mps2), limit(t.v_rise_max_mps2)
    turn = limit(t.omega_change_max_degps2) * radians(1)
    climb = limit(t.zeta_change_max_mps2)
    return (
        Lag(constant(t.v_time_constant_s, 1.0), t.v_delay_s, fall, rise),
        Lag(constant(t.omega_time_constant_s, 0.35), t.omega_delay_s, -turn, turn),
        Lag(constant(t.zeta_time_constant_s, 0.3), t.zeta_delay_s, -climb, climb),
    )


def identified_lags(airframe: Airframe, limits: bool = True) -> tuple[Lag, Lag, Lag]:
    """The lags of v, omega and zeta identified on an airframe, with or without their rate limits."""
    known = airframe.identified
    if known is None:
        raise UserError(
            f"lags: airframe {airframe.name} has no identified channels; run: testbed aircraft identify"
            f' {airframe.argument}; or set lags.source = "table"'
        )
    from aircraft.autopilots.freshness import stale_lags

    if (why := stale_lags(airframe)) is not None:
        raise UserError(f'lags: airframe {airframe.name}: {why}; or set lags.source = "table"')

    def lag(c: Channel) -> Lag:
        rise = math.inf if c.rate_max is None or not limits else c.rate_max
        fall = -rise if c.rate_min is None or not limits else c.rate_min
        return Lag(c.time_constant_s, c.delay_s, fall, rise)

    return lag(known.v), lag(known.omega), lag(known.zeta)
