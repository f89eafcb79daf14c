"""The family of models of a command channel, in closed form: how it answers a step after a pure delay.

- first order:   y' = (g - y) / T, its rate of change bounded
- short turn:    the same towards a share of the command, as autopilots do that bank for a turn and do not
                 measure its rate
- second order:  y'' = w^2 (g - y) - 2 d w y'; in turns towards such a share
- tracked loop:  the command u moves a reference that is followed: y' = (f u + b / L - y) / T, b' = u - y. Of
                 a climb rate this is a height loop, b the height that is missing
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

KINDS = ("first order", "short turn", "second order", "tracked loop")
# Parameters of each kind, all above zero; times in s, radps in rad/s, falls and rises in the unit per second.
PARAMETERS = {
    "first order": ("time_constant_s", "delay_s", "falls", "rises"),
    "short turn": ("time_constant_s", "delay_s", "falls", "rises", "share"),
    "second order": ("radps", "damping", "delay_s", "share"),
    "tracked loop": ("time_constant_s", "delay_s", "loop_s", "forward"),
}
# Which are tried for a channel; a share is fitted in turns only.
OF_CHANNEL = {
    "v": ("first order", "second order", "tracked loop"),
    "omega": ("first order", "short turn", "second order"),
    "zeta": ("first order", "second order", "tracked loop"),
}
BOUNDS = {
    "time_constant_s": (5e-3, 30.0),
    "delay_s": (1e-3, 3.0),
    "radps": (0.05, 60.0),
    "damping": (0.1, 5.0),
    "share": (0.5, 1.5),
    "loop_s": (0.1, 600.0),
    "forward": (1e-3, 1.5),
}


def names(kind: str, channel: str) -> tuple[str, ...]:
    """Parameters that are fitted of a kind for a channel."""
    return tuple(n for n in PARAMETERS[kind] if n != "share" or channel == "omega")


@dataclass(frozen=True)
class Steps:
    """Steps of one channel: from `before` to `after` (S,) at t = 0, and what was flown (S, n) every dt s."""

    before: Array
    after: Array
    flown: Array
    dt: float

    @property
    def size(self) -> Array:
        return np.abs(self.after - self.before)

    def errors(self, modelled: Array) -> Array:
        """(..., S, n): modelled less flown, as shares of each step."""
        return (modelled - self.flown) / self.size[:, None]


def simulate(kind: str, values: Mapping[str, Any], steps: Steps) -> Array:
    """The model's answer (..., S, n) to the steps; values are numbers or arrays (...,) of one shape."""
    v = {name: np.asarray(value, dtype=float)[..., None, None] for name, value in values.items()}
    before, asked = steps.before[:, None], (steps.after - steps.before)[:, None]
    n = steps.flown.shape[1]
    t = np.maximum(steps.dt * np.arange(1.0, n + 1) - v["delay_s"], 0.0)
    change = v.get("share", np.ones(1)) * asked
    if kind == "second order":
        w, d = v["radps"], v["damping"]
        return np.asarray(before + change * _second_order(t, w * w, 2 * d * w, np.zeros(1)))
    constant = v["time_constant_s"]
    if kind == "tracked loop":
        stiff = 1.0 / (constant * v["loop_s"])
        return np.asarray(before + change * _second_order(t, stiff, 1.0 / constant, v["forward"] / constant))
    # At the largest rate until the rest is T times that rate, then a decay.
    size, rate = np.abs(change), np.where(change > 0, v["rises"], v["falls"])
    bounded = np.maximum(size / rate - constant, 0.0)
    early = np.minimum(t, bounded)
    moved = rate * early - (size - rate * bounded) * np.expm1((early - t) / constant)
    return np.asarray(before + np.sign(change) * moved)


def _second_order(t: Array, stiff: Array, damped: Array, begin: Array) -> Array:
    """y(t) of y'' = stiff (1 - y) - damped y' from y(0) = 0, y'(0) = begin."""
    apart = damped * damped - 4.0 * stiff
    # Equal roots have a form of their own; roots that nearly are equal give the same numbers.
    least = 1e-6 * damped * damped
    root = np.sqrt(np.where(np.abs(apart) < least, least, apart).astype(complex))
    one, two = 0.5 * (-damped + root), 0.5 * (-damped - root)
    first = (begin + two) / (one - two)
    return np.asarray((1.0 + first * np.exp(one * t) - (1.0 + first) * np.exp(two * t)).real)
