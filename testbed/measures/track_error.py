"""Measures how far vehicles are from the recorded tracks that they are to follow."""

from __future__ import annotations

from typing import Any

import numpy as np

from filters.model import Array
from testbed.components.following.track import Track
from testbed.scenario import fleet
from testbed.scenario.contents import Contents
from testbed.scenario.guidance import RecordedTrack


class TrackErrors:
    """Distances from each followed track at the same time, at every filter step up to the track's last row.

    In three dimensions where the track has heights, else level.
    """

    def __init__(self, s: Contents) -> None:
        self._tracks = [
            (k, Track(np.array(table.rows)))
            for k, table in enumerate(fleet.guidances(s))
            if isinstance(table, RecordedTrack)
        ]
        count = len(self._tracks)
        self._largest, self._squares = np.zeros(count), np.zeros(count)
        self._steps = np.zeros(count, dtype=int)

    def update(self, t: Array, truth: Array) -> None:
        """Take in true poses (S, N, 4) as x, y, theta, z at times t (S,)."""
        for n, (k, track) in enumerate(self._tracks):
            during = t <= track.end + 1e-9
            if not during.any():
                continue
            place = track.at(t[during])[0]
            off = truth[during, k][:, [0, 1, 3][: place.shape[1]]] - place
            square = (off * off).sum(axis=-1)
            self._largest[n] = max(self._largest[n], float(np.sqrt(square.max())))
            self._squares[n] += square.sum()
            self._steps[n] += square.size

    def summary(self) -> list[dict[str, Any]]:
        """Per followed track: vehicle (from 1), largest and root-mean-square distance [m]; None if none."""
        return [
            {
                "vehicle": k + 1,
                "largest_m": float(self._largest[n]) if self._steps[n] else None,
                "rms_m": float(np.sqrt(self._squares[n] / self._steps[n])) if self._steps[n] else None,
            }
            for n, (k, _track) in enumerate(self._tracks)
        ]
