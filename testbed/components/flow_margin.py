"""Finds the flow filter's margin: what its model misses of an airframe's own flight, and between samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from filters.constraints import Indices
from filters.flow.belief import Belief
from filters.flow.channels import Channels, Lag
from filters.flow.flow_filter import FlowFilter
from filters.flow.margin import ErrorSum, ModelError, grid_margin
from filters.model import Array, Command, Limits, State, View
from testbed.scenario.control import Flow as Said
from testbed.scenario.scenario import Scenario

# So many of an airframe meet in the middle of a circle, in so many encounters, each so long; kept apart by a
# first guess of the margin.
VEHICLES, ENCOUNTERS, SECONDS, RADIUS_M, GUESS_M = 4, 3, 14.0, 200.0, 2.0
_SEED = 1
SPARE_MPS = 1.0
Triple = tuple[float, ...]


@dataclass(frozen=True)
class Case:
    """All that a flight's errors depend on.

    low, high  (v, omega, zeta), the limits
    d_safe     m, Ds
    """

    airframe: Any = field(compare=False)
    fingerprint: str
    lags: tuple[Lag, ...]
    gamma: Triple
    low: Triple
    high: Triple
    d_safe: float
    kappa: float
    trust: float
    slew: Triple | None
    filter_dt: float
    fdm_dt: float


def flow_margin(
    s: Scenario, gamma: Command, lags: Sequence[Sequence[Lag]], limits: Limits, airframes: Sequence[Any]
) -> tuple[float, dict[str, float]]:
    """The margin m [m] of a scenario's flow filter, and how it came about; of a number given, nothing.

    Were every period off by the largest change eps that was seen, and always the same way, the clearance
    would fall to -eps / kappa; to that comes what may be missed between samples.

    airframes  of the vehicles, whose flights are compared with the model; none of plants that are the model
    """
    said = s.filter
    assert isinstance(said, Said)
    if not isinstance(said.margin_m, str):
        return said.margin_m, {}
    low = np.stack([limits.v_min, -limits.omega_max, -limits.zeta_max], axis=-1)
    high = np.stack([limits.v_max, limits.omega_max, limits.zeta_max], axis=-1)
    slew = flow_slew(said)
    channels = Channels.of(lags, s.vehicles)
    if slew is not None:
        channels = channels.slewed(slew)
    grid = grid_margin(s.d_safe_m, channels, low, high, s.rates.filter_dt_s)
    each = gamma.array()
    errors = [ModelError(0.0, 0.0)]
    for k, airframe in enumerate(airframes):
        case = Case(
            airframe,
            airframe.fingerprint(),
            tuple(lags[k % len(lags)]),
            tuple(each[k]),
            tuple(low[k]),
            tuple(high[k]),
            s.d_safe_m,
            said.kappa,
            said.trust,
            None if slew is None else tuple(slew),
            s.rates.filter_dt_s,
            s.rates.fdm_dt_s,
        )
        errors.append(flown(case))
    one_step = max(e.one_step for e in errors)
    margin = one_step / said.kappa + grid
    return margin, {
        "margin_m": margin,
        "one_step_m": one_step,
        "accumulated_m": max(e.accumulated for e in errors),
        "between_samples_m": grid,
    }


def flow_slew(said: Said) -> Array | None:
    """What the filter's commands change by at most (3,) a second; None without a bound."""
    if said.speed_slew_mps2 is None and said.climb_slew_mps2 is None:
        return None
    each = (said.speed_slew_mps2, None, said.climb_slew_mps2)
    return np.array([np.inf if x is None else x for x in each])


def spare_airspeed(s: Scenario, gamma: Command, airframes: Sequence[Any]) -> tuple[Array, Indices]:
    """What gamma's ground speed leaves in a tail wind above the least airspeed of the autopilots [m/s].

    Returns the numbers, less 1 m/s, and their vehicles, from 0; none of airframes that name no such airspeed.
    """
    found, who = [], []
    for k, airframe in enumerate(airframes):
        least = airframe.gains.get("envelope", {}).get("airspeed_min_mps")
        if least is not None:
            found.append(float(gamma.v[k]) - s.wind.speed_mps - least - SPARE_MPS)
            who.append(k)
    return np.array(found), np.array(who, dtype=np.intp)


@lru_cache(maxsize=64)
def flown(case: Case) -> ModelError:
    """What the model is off while some of the airframe meet in calm air, under the flow filter."""
    from aircraft.jsbsim.fleet import JsbsimFleet

    rng = np.random.default_rng(_SEED)
    plant = JsbsimFleet([case.airframe] * VEHICLES, case.fdm_dt)
    errors = []
    try:
        for _ in range(ENCOUNTERS):
            angle = np.arange(VEHICLES) * (2 * np.pi / VEHICLES)
            course = angle + np.pi + np.radians(rng.uniform(-5.0, 5.0, VEHICLES))
            height = rng.uniform(-1.0, 1.0, VEHICLES)
            place = [RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), course, height]
            start = State.of(np.stack(place, axis=-1))
            speed = np.full(VEHICLES, 0.5 * (case.low[0] + case.high[0]))
            plant.reset(start, rng, np.zeros((VEHICLES, 3)), speed)
            errors.append(_encounter(plant, case, speed))
    finally:
        plant.close()
    return ModelError(max(e.one_step for e in errors), max(e.accumulated for e in errors))


def _encounter(plant: Any, case: Case, speed: Array) -> ModelError:
    """One of them, from where the plant is: everybody flies to the other side."""
    n, gamma = VEHICLES, np.tile(case.gamma, (VEHICLES, 1))
    slew = None if case.slew is None else np.array(case.slew)
    choose = FlowFilter(
        [case.lags],
        Command.of(gamma),
        case.d_safe,
        case.filter_dt,
        GUESS_M,
        case.kappa,
        trust=case.trust,
        slew=slew,
    )
    flow = choose.flow
    belief, total = Belief(flow, case.trust), ErrorSum(flow, case.kappa, case.d_safe + GUESS_M)
    limits = Limits(*(np.full(n, x) for x in (case.low[0], *case.high)))
    goal, still = -plant.state().position, np.zeros((n, 3))
    for _ in range(round(SECONDS / case.filter_dt)):
        state, rates = plant.state(), plant.achieved()
        off = np.angle(np.exp(1j * (np.arctan2(goal[:, 1] - state.y, goal[:, 0] - state.x) - state.theta)))
        wanted = Command(speed, np.clip(off, -case.high[1], case.high[1]), -0.1 * state.z)
        u = choose(View(state, rates), wanted, limits).command
        belief.see(rates.array())
        total.see(state, belief.rates, belief.queued, u.array())
        belief.told(u.array())
        plant.step(u, still, round(case.filter_dt / case.fdm_dt))
        if any(plant.faults()):
            break
    return total.error
