"""Finds where pairs came nearest inside their safe set; from there the evading manoeuvre is flown."""

from __future__ import annotations

import numpy as np

from filters.model import Array


class NearMisses:
    """Each pair's deepest descent of h that stayed inside the safe set, from h at every filter step.

    near   h below which a pair counts as near
    least  (P,) h where that descent ended: at a minimum, or at the last instant before h < 0; inf if none
    last   (P,) s, when that was
    first  (P,) s, when the same descent came below `near`, or began
    """

    def __init__(self, pairs: int, near: float) -> None:
        self.near = near
        self.least = np.full(pairs, np.inf)
        self.last, self.first = np.full(pairs, np.nan), np.full(pairs, np.nan)
        self._h: Array | None = None
        self._t = 0.0
        # As if h had always fallen: a pair may start at its smallest h.
        self._falling = np.ones(pairs, dtype=bool)
        self._since = np.zeros(pairs)

    def update(self, t: float, h: Array) -> None:
        """Take in h (P,) at time t [s]."""
        if self._h is not None:
            falling = h < self._h
            self._take(self._falling & ((h < 0.0) | ~falling))
            begun = np.where(self._falling, self._since, self._t)
            self._since = np.where(h > self.near, t, begun)
            self._falling = falling
        self._h, self._t = h, t

    def close(self) -> None:
        """End the flight, and with it all descents."""
        if self._h is not None:
            self._take(self._falling)

    def _take(self, ended: np.ndarray) -> None:
        assert self._h is not None
        better = ended & (self._h >= 0.0) & (self._h < self.least)
        self.least = np.where(better, self._h, self.least)
        self.last = np.where(better, self._t, self.last)
        self.first = np.where(better, np.minimum(self._since, self._t), self.first)
