"""Limits how far vehicles know of each other: those farther apart are not in each other's view."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from filters.model import View


def unseen_steps(age_s: float, dt: float) -> int:
    """Whole filter periods between two instants that bracket the crossing of the range, and the decision.

    age_s  s, age of what is known;  dt  s, the filter period
    A pair that is first known at step k was within the range one age earlier, and out of it one step before
    that.
    """
    return 1 + int(np.ceil(age_s / dt - 1e-9))


@dataclass
class KnownRange:
    """Two vehicles know of each other if they were within `range_m` one age ago; true distances decide.

    range_m  m;  steps  age of what is known, in whole filter periods
    At the start they know of each other if they start within it.
    """

    range_m: float
    steps: int
    _near: deque[NDArray[np.bool_]] = field(init=False)

    def __post_init__(self) -> None:
        self._near = deque(maxlen=self.steps + 1)

    def __call__(self, view: View) -> View:
        """`view` of the true poses (N,), with who knows whom (N, N). To be called once at every step."""
        place = view.state.position
        self._near.append(np.linalg.norm(place[:, None] - place, axis=-1) <= self.range_m)
        known = self._near[0]
        if view.known is not None:
            n = len(view.state)
            known = known & view.knows(*np.indices((n, n)))
        elif known.all():  # as if there were no limit, at no cost
            return view
        return View(view.state, view.rates, known)
