"""Instants one filter period apart, and which command each channel hears at them: the same in every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.constraints import Indices
from filters.flow.channels import Channels
from filters.model import Array


@dataclass(frozen=True, eq=False)
class Grid:
    """The M instants dt, 2 dt, ... [s], and which command each channel (N, 3) hears at them.

    within, after  (N, 3, M) 1.0 in the period in which it hears the next command, and later; otherwise 0.0
    heard          (N, 3, 2) s for which it has heard that at the end of the first of them, and in all
    evading        (N, 3, M) s for which it has heard gamma
    decay          exp(-evading / time constant)
    """

    times: Array
    within: Array
    after: Array
    heard: Array
    evading: Array
    decay: Array

    @classmethod
    def of(cls, channels: Channels, dt: float, instants: int) -> Grid:
        times = dt * np.arange(1.0, instants + 1)
        delay = channels.delay
        # A command is heard for one period: only one of the instants lies inside it.
        inside = (np.floor(delay / dt + 1e-9) + 1.0)[..., None]
        index = np.arange(1.0, instants + 1)
        heard = np.concatenate([inside * dt - delay[..., None], np.full((*delay.shape, 1), dt)], axis=-1)
        evading = np.maximum(times - (delay + dt)[..., None], 0.0)
        decay = np.exp(-evading / channels.constant[..., None])
        within, after = (index == inside).astype(float), (index > inside).astype(float)
        return cls(times, within, after, heard, evading, decay)

    def some(self, vehicles: Indices | slice, instants: int) -> Grid:
        """Of some vehicles, the first instants."""
        v, m = vehicles, instants
        return Grid(
            self.times[:m],
            self.within[v, :, :m],
            self.after[v, :, :m],
            self.heard[v],
            self.evading[v, :, :m],
            self.decay[v, :, :m],
        )
