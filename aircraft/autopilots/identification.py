"""Command channels as lag, delay and rate limits, fitted to step responses of the aircraft in JSBSim.

    python -m aircraft.autopilots.identification x8

prints the `[identified]` tables of airframe.toml, which the lagged kinematic plant flies.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe, folder_of, read_airframe
from aircraft.autopilots.tuning import fly

Array = NDArray[np.floating[Any]]

DT_S = 0.005
_DURATION_S = 6.0
_TURN = 0.2  # rad/s

# Per channel: (start speed, value before, command) of the steps that are fitted.
STEPS: dict[str, list[tuple[float, float, tuple[float, float, float]]]] = {
    "v": [(16, 16, (20, 0, 0)), (20, 20, (24, 0, 0)), (20, 20, (16, 0, 0)), (24, 24, (20, 0, 0))],
    "omega": [(v, 0, (v, sign * size, 0)) for v in (16, 20, 25) for sign in (1, -1) for size in (_TURN, 0.1)],
    "zeta": [(v, 0, (v, 0, zeta)) for v in (16, 20, 25) for zeta in (2.0, 3.9, -1.5)],
}


def model(
    before: Array, after: Array, time_constant: float, delay: float, falls: float, rises: float, n: int
) -> Array:
    """n periods of a step (S,) through `aircraft.kinematic`'s channel, with a delay of any length: (S, n)."""
    y = before.astype(float).copy()
    share = 1.0 - np.exp(-DT_S / time_constant)
    out = np.empty((len(y), n))
    for k in range(n):
        # the period in which the delay ends obeys for the rest of it
        heard = np.clip((k + 1) * DT_S - delay, 0.0, DT_S) / DT_S
        y += heard * np.clip(share * (after - y), -falls * DT_S, rises * DT_S)
        out[:, k] = y
    return out


def identify(airframe: Airframe, channel: str) -> tuple[float, float, float, float]:
    """Time constant, delay [s], largest fall and rise [unit / s] that fit STEPS best in least squares."""
    from scipy.optimize import minimize

    index = ("v", "omega", "zeta").index(channel)
    before = np.array([b for _, b, _ in STEPS[channel]], dtype=float)
    after = np.array([c[index] for _, _, c in STEPS[channel]], dtype=float)
    flown = np.array([getattr(fly(airframe, v, c, _DURATION_S, DT_S), channel) for v, _, c in STEPS[channel]])
    size = np.abs(after - before)[:, None]

    def misfit(logs: Array) -> float:
        t, delay, falls, rises = np.exp(logs).tolist()
        return float(
            np.mean(((model(before, after, t, delay, falls, rises, flown.shape[1]) - flown) / size) ** 2)
        )

    fastest = float(np.abs(np.diff(flown, axis=1)).max()) / DT_S
    guess = np.log([0.3, 0.1, fastest, fastest])
    fitted = minimize(misfit, guess, method="Nelder-Mead", options={"maxfev": 400})
    time_constant, delay, falls, rises = np.exp(fitted.x).tolist()
    return time_constant, delay, falls, rises


def main(name: str) -> None:
    """Print the tables of an airframe's channels."""
    airframe = read_airframe(folder_of(name))
    print(f'[identified]\ncommand = "python -m aircraft.autopilots.identification {name}"')
    for channel in STEPS:
        time_constant, delay, falls, rises = identify(airframe, channel)
        print(f"\n[identified.{channel}]\ntime_constant_s = {time_constant:.3f}\ndelay_s = {delay:.3f}")
        print(f"rate_min = {-falls:.3g}\nrate_max = {rises:.3g}")


if __name__ == "__main__":
    main(sys.argv[1])
