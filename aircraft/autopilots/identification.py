"""Command channels as lag, delay and rate limits, fitted to step responses of the aircraft in JSBSim.

`testbed aircraft identify` writes them as the `[identified]` tables of airframe.toml, which the lagged
kinematic plant flies and a filter that predicts poses knows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import INVERTING, Airframe, Speeds
from aircraft.autopilots.specification import CLIMB, climb_max, climb_rate, duration, turn_rate
from aircraft.autopilots.tuning import fly
from aircraft.jsbsim.steady import Trim

Array = NDArray[np.floating[Any]]

DT_S = 0.005
_DURATION_S = 6.0
_PEOPLES_S = {"v": 24.0, "omega": 6.0, "zeta": 12.0}  # of autopilots that people fly, which are slower
TURN_RADPS = 0.2

Step = tuple[float, float, tuple[float, float, float]]  # start speed, value before, command
CHANNELS = ("v", "omega", "zeta")


def steps(speeds: Speeds) -> dict[str, list[Step]]:
    """The steps that are fitted, by channel: for 15 to 25 m/s, from 16 to 20, 20 to 24 and back."""
    slow, middle, brisk, fast = (speeds.within(share) for share in (0.1, 0.5, 0.9, 1.0))
    return {
        "v": [
            (v, v, (to, 0, 0)) for v, to in ((slow, middle), (middle, brisk), (middle, slow), (brisk, middle))
        ],
        "omega": [
            (v, 0, (v, sign * share * min(TURN_RADPS, turn_rate(speeds, v)), 0))
            for v in (slow, middle, fast)
            for sign in (1, -1)
            for share in (1.0, 0.5)
        ],
        "zeta": [
            (v, 0, (v, 0, zeta * (climb_rate(speeds) / CLIMB)))
            for v in (slow, middle, fast)
            for zeta in (2.0, CLIMB, -1.5)
        ],
    }


def model(
    before: Array,
    after: Array,
    time_constant: float,
    delay: float,
    falls: float,
    rises: float,
    n: int,
    dt: float = DT_S,
) -> Array:
    """n periods of a step (S,) through `aircraft.kinematic`'s channel, with a delay of any length: (S, n)."""
    y = before.astype(float).copy()
    share = 1.0 - np.exp(-dt / time_constant)
    out = np.empty((len(y), n))
    for k in range(n):
        # the period in which the delay ends obeys for the rest of it
        heard = np.clip((k + 1) * dt - delay, 0.0, dt) / dt
        y += heard * np.clip(share * (after - y), -falls * dt, rises * dt)
        out[:, k] = y
    return out


def steps_for(airframe: Airframe, channel: str) -> list[Step]:
    """The steps that are fitted for an airframe: no climb is faster than its autopilot allows."""
    most = climb_max(airframe)
    return [(v, b, (c[0], c[1], min(c[2], most))) for v, b, c in steps(airframe.speeds)[channel]]


def flown_steps(
    airframe: Airframe,
    channel: str,
    flights: list[Step],
    near: Callable[[float], Trim | None] | None = None,
) -> Array:
    """The channel's response to each step, (S, T) every DT_S. Raises FdmError as `identify` does."""
    # Predictions begin from the rates that `Plant.achieved` gives: the lags are those of the same signal.
    signal = {"omega": "omega_measured"}.get(channel, channel)
    lasts = _lasts(airframe, channel)
    responses = [
        getattr(fly(airframe, v, c, lasts, DT_S, near=None if near is None else near(v)), signal)
        for v, _, c in flights
    ]
    return np.array(responses)


def _lasts(airframe: Airframe, channel: str) -> float:
    seconds = _DURATION_S if airframe.autopilot == INVERTING else _PEOPLES_S[channel]
    return duration(airframe.speeds, seconds)


def identify(
    airframe: Airframe, channel: str, every: int = 1, near: Callable[[float], Trim | None] | None = None
) -> tuple[float, float, float, float]:
    """Time constant, delay [s], largest fall and rise [unit / s] that fit `steps` best in least squares.

    channel  one of CHANNELS
    every    periods from one instant that is compared to the next; more for flights that last longer
    near     a trim near a speed [m/s], which makes starting quicker
    Raises   FdmError if the airframe cannot fly level at the speeds of the steps
    """
    from scipy.optimize import minimize

    index, flights = CHANNELS.index(channel), steps_for(airframe, channel)
    before = np.array([b for _, b, _ in flights], dtype=float)
    after = np.array([c[index] for _, _, c in flights], dtype=float)
    flown = flown_steps(airframe, channel, flights, near)
    lasts = _lasts(airframe, channel)
    fastest = float(np.abs(np.diff(flown, axis=1)).max()) / DT_S
    every *= max(1, round(lasts / _DURATION_S))
    flown, dt = flown[:, every - 1 :: every], every * DT_S
    size = np.abs(after - before)[:, None]

    def misfit(logs: Array) -> float:
        t, delay, falls, rises = np.exp(logs).tolist()
        return float(
            np.mean(((model(before, after, t, delay, falls, rises, flown.shape[1], dt) - flown) / size) ** 2)
        )

    guesses = [[0.3, 0.1, fastest, fastest]]
    if airframe.autopilot != INVERTING:
        guesses.append([3.0, 0.3, fastest, fastest])
    fits = [minimize(misfit, np.log(g), method="Nelder-Mead", options={"maxfev": 400}) for g in guesses]
    time_constant, delay, falls, rises = np.exp(min(fits, key=lambda f: float(f.fun)).x).tolist()
    return time_constant, delay, falls, rises
