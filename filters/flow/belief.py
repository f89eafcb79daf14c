"""Keeps what is believed of the vehicles between periods: the commands on their way, and their rates.

What gusts do to a course rate is gone before a channel would have let it go, and a flow that starts from it
circles elsewhere. So the rates are the model's own, drawn by a share towards those measured in each period.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from filters.flow.rollout import Flow
from filters.model import Array


class Belief:
    """Rates and queued commands of N vehicles.

    trust   share of the difference between measured and modelled rates believed in a period, in [0, 1]
    Raises  ValueError for another share
    """

    def __init__(self, flow: Flow, trust: float) -> None:
        if not 0 <= trust <= 1:
            raise ValueError(f"trust is a share in [0, 1], got {trust}")
        self._flow, self._trust = flow, trust
        self._depth = max(flow.depth, 1)
        self._queued: deque[Array] = deque(maxlen=self._depth)
        self._modelled: Array | None = None
        self.rates = np.zeros_like(flow.gamma)

    @property
    def queued(self) -> Array:
        """Commands (depth, N, 3) on their way, the latest first."""
        return np.stack(self._queued)

    def see(self, measured: Array) -> None:
        """Rates (N, 3) as measured now."""
        while len(self._queued) < self._depth:
            self._queued.append(measured)  # before the start all flew as they fly now
        modelled = measured if self._modelled is None else self._modelled
        self.rates = modelled + self._trust * (measured - modelled)

    def told(self, u: Array) -> None:
        """Inputs (N, 3) commanded for the period that begins now."""
        self._modelled = self._flow.after(self.rates, np.concatenate([u[None], self.queued]))
        self._queued.appendleft(u.copy())
