"""Compares the models of a command channel on manoeuvres that they were not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aircraft.airframes.schema import Airframe
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


def validate(airframe: Airframe, channel: str, fitted: tuple[float, float, float, float]) -> Validation:
    """How well both models predict the held-out steps of a channel.

    fitted  time constant, delay [s], largest fall and rise, as `identification.identify` gives them
    Raises  FdmError if the airframe cannot fly level at the speeds of the steps
    """
    from scipy.optimize import minimize

    index, dt = CHANNELS.index(channel), _EVERY * DT_S
    fits, checks = steps_for(airframe, channel), held_out(airframe, channel)
    before, after, flown = _data(flown_steps(airframe, channel, fits), fits, index)

    def misfit(logs: Array) -> float:
        radps, damping, delay = np.exp(logs).tolist()
        modelled = _second_order(before, after, radps, damping, delay, flown.shape[1], dt)
        return _rms(modelled, flown, before, after)

    starts = ([1.0, 0.7, 0.1], [5.0, 0.9, 0.1])
    found = [minimize(misfit, np.log(s), method="Nelder-Mead", options={"maxfev": 200}) for s in starts]
    radps, damping, delay = np.exp(min(found, key=lambda f: float(f.fun)).x).tolist()
    before, after, flown = _data(flown_steps(airframe, channel, checks), checks, index)
    n = flown.shape[1]
    return Validation(
        _rms(model(before, after, *fitted, n, dt), flown, before, after),
        _rms(_second_order(before, after, radps, damping, delay, n, dt), flown, before, after),
    )


def _data(flown: Array, flights: list[Step], index: int) -> tuple[Array, Array, Array]:
    before = np.array([b for _, b, _ in flights], dtype=float)
    after = np.array([c[index] for _, _, c in flights], dtype=float)
    return before, after, flown[:, _EVERY - 1 :: _EVERY]


def _rms(modelled: Array, flown: Array, before: Array, after: Array) -> float:
    return float(np.sqrt(np.mean(((modelled - flown) / np.abs(after - before)[:, None]) ** 2)))


def _second_order(
    before: Array, after: Array, radps: float, damping: float, delay: float, n: int, dt: float
) -> Array:
    """n periods of a step (S,) through a second-order lag behind a delay: (S, n)."""
    x, rate = np.zeros(len(before)), np.zeros(len(before))
    out = np.empty((len(before), n))
    for k in range(n):
        heard = min(max((k + 1) * dt - delay, 0.0) / dt, 1.0)
        rate = (rate + heard * dt * radps * radps * (1.0 - x)) / (1.0 + 2.0 * damping * radps * dt)
        x = x + dt * rate
        out[:, k] = x
    return before[:, None] + (after - before)[:, None] * out
