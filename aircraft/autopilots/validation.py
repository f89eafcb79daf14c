"""Compares the models of a command channel on manoeuvres that they were not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.autopilots.channel_models import Steps
from aircraft.autopilots.identification import (
    CHANNELS,
    DT_S,
    TURN_RADPS,
    Array,
    Step,
    flown_steps,
    model,
    steps_for,
)
from aircraft.autopilots.specification import climb_max, climb_rate, turn_rate

_EVERY = 4  # periods between two instants that are compared


@dataclass(frozen=True)
class Validation:
    """Rms errors on held-out steps, as shares of the step: of the lag that is written, of a second order."""

    first_order_rms: float
    second_order_rms: float


def held_out(airframe: Airframe, channel: str) -> list[Step]:
    """Steps of other sizes, from other speeds than those that are fitted."""
    at, most = airframe.speeds.within, climb_max(airframe)
    if channel == "v":
        return [(at(0.3), at(0.3), (at(0.6), 0.0, 0.0)), (at(0.7), at(0.7), (at(0.4), 0.0, 0.0))]
    if channel == "omega":
        turns = [(at(0.3), 0.75), (at(0.8), -0.75)]
        rates = [(v, share * min(TURN_RADPS, turn_rate(airframe.speeds, v))) for v, share in turns]
        return [(v, 0.0, (v, rate, 0.0)) for v, rate in rates]
    climbs = [(at(0.3), 0.3), (at(0.7), 0.7), (at(0.7), -0.25)]
    return [(v, 0.0, (v, 0.0, min(share * climb_rate(airframe.speeds), most))) for v, share in climbs]


def flown_data(airframe: Airframe, channel: str) -> tuple[Steps, Steps]:
    """The steps that are fitted and the held-out ones, flown. Raises FdmError as `identify` does."""
    fits, checks = (
        _data(airframe, channel, flights)
        for flights in (steps_for(airframe, channel), held_out(airframe, channel))
    )
    return fits, checks


def validate(fits: Steps, checks: Steps, fitted: tuple[float, float, float, float]) -> Validation:
    """How well both models predict the held-out steps `checks` of a channel.

    fitted  time constant, delay [s], largest fall and rise, as `identification.identify` gives them
    """
    from scipy.optimize import minimize

    def misfit(logs: Array) -> float:
        radps, damping, delay = np.exp(logs).tolist()
        return _rms(_second_order(fits, radps, damping, delay), fits)

    starts = ([1.0, 0.7, 0.1], [5.0, 0.9, 0.1])
    found = [minimize(misfit, np.log(s), method="Nelder-Mead", options={"maxfev": 200}) for s in starts]
    radps, damping, delay = np.exp(min(found, key=lambda f: float(f.fun)).x).tolist()
    first = model(checks.before, checks.after, *fitted, checks.flown.shape[1], checks.dt)
    return Validation(_rms(first, checks), _rms(_second_order(checks, radps, damping, delay), checks))


def _data(airframe: Airframe, channel: str, flights: list[Step]) -> Steps:
    index = CHANNELS.index(channel)
    before = np.array([b for _, b, _ in flights], dtype=float)
    after = np.array([c[index] for _, _, c in flights], dtype=float)
    flown = flown_steps(airframe, channel, flights)
    return Steps(before, after, flown[:, _EVERY - 1 :: _EVERY], _EVERY * DT_S)


def _rms(modelled: Array, steps: Steps) -> float:
    return float(np.sqrt(np.mean(steps.errors(modelled) ** 2)))


def _second_order(steps: Steps, radps: float, damping: float, delay: float) -> Array:
    """A second-order lag behind a delay, period by period: (S, n)."""
    before, after, dt = steps.before, steps.after, steps.dt
    x, rate = np.zeros(len(before)), np.zeros(len(before))
    out = np.empty(steps.flown.shape)
    for k in range(len(out.T)):
        heard = min(max((k + 1) * dt - delay, 0.0) / dt, 1.0)
        rate = (rate + heard * dt * radps * radps * (1.0 - x)) / (1.0 + 2.0 * damping * radps * dt)
        x = x + dt * rate
        out[:, k] = x
    return before[:, None] + (after - before)[:, None] * out
