"""Has vehicles circle their goal once they have arrived, whatever their guidance wants."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.model import Array, Command, Limits, View
from testbed.components.following.loiter import Loiter
from testbed.components.guidance import Guidance

# Of the turn rate limit, what the circle takes where no manoeuvre turns.
SHARE = 0.5
COURSE_GAIN, HEIGHT_GAIN = 0.5, 0.3


class CircleAtGoal:
    """`law` until a vehicle comes within the goal radius of its goal; from then on the circle around it.

    goal   (N, 3) m;  radius  m, of the goal;  seeks  (N,) who has a goal
    gamma  the evading manoeuvre (N,): its speed, radius and sense are those of the circle. Where it does not
           turn, or there is none, the circle takes half of the turn rate limit, to the left
    """

    def __init__(
        self,
        law: Guidance,
        goal: Array,
        radius: float,
        seeks: NDArray[np.bool_],
        gamma: Command | None,
        limits: Limits,
    ) -> None:
        self.law, self._goal, self._radius, self._seeks = law, goal, radius, seeks
        if gamma is None:
            gamma = Command(limits.v_min, np.zeros(len(limits)), np.zeros(len(limits)))
        gamma = limits.clip(gamma)
        turn = np.where(np.abs(gamma.omega) > 1e-9, gamma.omega, SHARE * np.maximum(limits.omega_max, 1e-6))
        circle = gamma.v / np.abs(turn)
        self._circle = Loiter(goal, circle, gamma.v, np.sign(turn), COURSE_GAIN, HEIGHT_GAIN, limits)
        self._arrived = np.zeros(len(goal), dtype=bool)

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        wanted = self.law(t, view)
        near = np.linalg.norm(view.state.position - self._goal, axis=-1) <= self._radius
        self._arrived = self._arrived | (near & self._seeks)
        if not self._arrived.any():
            return wanted
        around = self._circle(t, view)
        return Command.of(np.where(self._arrived[:, None], around.array(), wanted.array()))
