"""Controllers that seek the goal and know nothing of the other vehicles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from filters.model import Array, Command, State


class Guidance(Protocol):
    """The controller that the filter alters: the input u_hat (N,) wanted at time t [s] in `state` (N,)."""

    def __call__(self, t: float, state: State) -> Command:
        """The input u_hat (N,) wanted at time t [s] in `state` (N,); it may lie outside the limits."""
        ...


@dataclass(frozen=True)
class NearIdentity:
    """Drives a point `lookahead` ahead of each vehicle to its goal (Olfati-Saber 2002).

    goal       (N, 3)  m
    lookahead  m, the paper's lambda
    gain       1/s, on position and on height
    The result is not clamped: the filter's box does that (Squires et al. 2022, III.D). The state may also be
    (instants, N).
    """

    goal: Array
    lookahead: float = 1.0
    gain: float = 0.1

    def __call__(self, t: float, state: State) -> Command:
        ex = self.gain * (self.goal[:, 0] - state.x)
        ey = self.gain * (self.goal[:, 1] - state.y)
        c, s = np.cos(state.theta), np.sin(state.theta)
        return Command(
            c * ex + s * ey, (c * ey - s * ex) / self.lookahead, self.gain * (self.goal[:, 2] - state.z)
        )


@dataclass(frozen=True)
class Constant:
    """One command for ever, such as the evading manoeuvre itself."""

    command: Command

    def __call__(self, t: float, state: State) -> Command:
        return self.command
