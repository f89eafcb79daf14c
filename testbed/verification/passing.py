"""Bounds how near pairs came between steps of the flight dynamics, by formulas of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbed.verification.future import Pose
from testbed.verification.pair_claims import unicycle
from testbed.verification.path_bounds import ROUNDING, PathBounds
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import arc

# How closely two arcs' closest approach is known [m].
BETWEEN_M = 1e-9
# Points of an arc that are looked at, twice: the second time around the nearest of the first.
POINTS = 400

# The run bends its first path from where the start was asked for, an aircraft is recorded where it was put:
# a bound may be so much lower, never higher [m].
START_M = 1e-4


@dataclass(frozen=True)
class Passing:
    """The nearest passing of any pair between steps.

    least     m, of unicycles and where every step was recorded; otherwise the nearest that it can have been
    radius    m, how far it may be from that; None where the record does not tell
    vehicles  of that pair, from 1;  begin, end  s, when it was
    """

    least: float
    radius: float | None
    d_safe: float
    vehicles: list[int]
    begin: float
    end: float

    @classmethod
    def of(cls, run: Recorded, paths: PathBounds, d_safe: float) -> Passing:
        if len(paths.t) < 2:
            return cls(float(paths.distance().min(initial=np.inf)), None, d_safe, [], 0.0, 0.0)
        chords = paths.ways()
        if unicycle(run) and run.complete:
            return _on_arcs(run, chords, d_safe)
        radius = _bends(run, paths) if paths.whole else None
        if radius is None:
            return cls(float(chords.min()), None, d_safe, [], 0.0, 0.0)
        low = chords.min(axis=0) - radius
        q = int(np.argmin(low))
        near = chords.min(axis=0) + radius
        p = int(np.argmin(near))
        k = int(np.argmin(chords[:, p]))
        who = [int(run.i[p]) + 1, int(run.j[p]) + 1]
        end = float(paths.t[k + 1])
        # What may be and what must be: of two pairs, perhaps.
        return cls(float(near[p]), float(near[p] - low[q]), d_safe, who, end - ROUNDING, end + ROUNDING)

    def allows(self, possible: float, value: float) -> bool:
        """Whether `possible` can be a lower bound of the distances, `value` being the least one reported."""
        if self.radius is None:
            return possible <= value + ROUNDING
        if self.radius == 0.0:  # known: a bound need not be tight above Ds
            return min(self.d_safe, self.least) - ROUNDING <= possible <= self.least + ROUNDING
        if np.isinf(self.radius):
            return possible == -np.inf
        return -ROUNDING <= min(self.least - self.radius, value) - possible <= START_M

    def __str__(self) -> str:
        if self.radius is None:
            return "a bound below the value"
        return f"{self.least - self.radius:.6g}" + ("" if self.radius else ", or Ds at least")


def _bends(run: Recorded, paths: PathBounds) -> Array:
    """(P,) m: half the mean of both vehicles' largest second difference of positions between steps."""
    rates = run.scenario["rates"]
    periods = round(rates["filter_dt_s"] / rates["fdm_dt_s"])
    second = np.linalg.norm(np.diff(paths.track, n=2, axis=0), axis=-1)
    if periods > 1:
        second = second[np.arange(1, len(second) + 1) % periods != 0]
    most = second.max(axis=0) if len(second) else np.full(paths.track.shape[1], np.inf)
    return np.asarray((most[run.i] + most[run.j]) / 4.0)


def _on_arcs(run: Recorded, chords: Array, d_safe: float) -> Passing:
    """Of unicycles recorded at every filter step."""
    rates, i, j = run.scenario["rates"], run.i, run.j
    period, dt = rates["filter_dt_s"], rates["fdm_dt_s"]
    steps = len(run.t) - (0 if run.flew_on else 1)
    by_period = chords.reshape(steps, -1, i.size).min(axis=1)
    turning = np.abs(run.command[:steps, :, 0] * run.command[:steps, :, 1]) * dt**2 / 8.0
    low = by_period - turning[:, i] - turning[:, j]
    # Nearest bound first; a period whose bound is no nearer than what was reached needs no look.
    least, where = np.inf, (0, 0)
    for each in np.argsort(low, axis=None):
        k, p = divmod(int(each), i.size)
        if low[k, p] >= min(least, d_safe):
            break
        found = _nearest(run, k, int(i[p]), int(j[p]), period)
        if found < least:
            least, where = found, (k, p)
    k, p = where
    least = min(least, float(np.where(low < d_safe, np.inf, low).min()))
    return Passing(
        least, 0.0, d_safe, [int(i[p]) + 1, int(j[p]) + 1], float(run.t[k]), float(run.t[k]) + period
    )


def _nearest(run: Recorded, k: int, a: int, b: int, period: float) -> float:
    """Closest approach of two vehicles over the filter period that began at step k."""
    ends, least = (0.0, period), np.inf
    for _ in range(3):
        t = np.linspace(*ends, POINTS + 1)
        places = [
            arc(Pose(run.position[k, v], run.vehicles["theta_rad"][k, v]), run.command[k, v], t).position
            for v in (a, b)
        ]
        apart = np.linalg.norm(places[0] - places[1], axis=-1)
        m = int(np.argmin(apart))
        least = min(least, float(apart[m]))
        ends = float(t[max(m - 1, 0)]), float(t[min(m + 1, POINTS)])
    return least
