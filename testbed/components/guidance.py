"""Guidance laws: they seek the goal and know nothing of the other vehicles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from filters.model import Array, Command, View


class Guidance(Protocol):
    """What the vehicles want: the nominal command that the filter alters.

    A guidance law of your own may ask for the poses alone instead of the view: name its second parameter
    anything but `view`, such as `state`, and it is called with the `State` (N,) that each vehicle knows of
    itself (see `testbed.components.border`).
    """

    def __call__(self, t: float, view: View) -> Command:
        """The nominal command u_hat (N,) at time t [s]; it may lie outside the limits.

        view  what each vehicle knows of itself, arrays (N,)
        """
        ...


@dataclass(frozen=True)
class NearIdentity:
    """Drives a point `lookahead` ahead of each vehicle to its goal (Olfati-Saber 2002).

    goal       (N, 3)  m
    lookahead  m, the paper's lambda
    gain       1/s, on position and on height
    The result is not clamped: the filter's box does that (Squires et al. 2022, III.D). The view's arrays may
    also be (instants, N).
    """

    goal: Array
    lookahead: float = 1.0
    gain: float = 0.1

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        state = view.state
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

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        return self.command
