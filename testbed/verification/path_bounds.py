"""Bounds the paths flown between recorded instants by how far each may have strayed from its chord.

Where every step of the flight dynamics was recorded, or a unicycle flew, the path is known at every step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from testbed.verification.future import Pose
from testbed.verification.pair_claims import unicycle
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import arc, box

ROUNDING = 1e-6
# The longest recording period that shows how an aircraft's velocity changes: rolls take two of it [s].
RESOLVED_S = 0.1 + 1e-9


@dataclass(frozen=True)
class PathBounds:
    """Where the vehicles were.

    t, track  (S,) s, (S, N, 3) m
    whole     whether those are all steps of the flight dynamics
    periods   steps of the track per recorded instant
    """

    run: Recorded
    t: Array
    track: Array
    whole: bool
    periods: int

    @classmethod
    def of(cls, run: Recorded) -> PathBounds:
        rates = run.scenario["rates"]
        steps = round(rates["filter_dt_s"] / rates["fdm_dt_s"])
        exact = run.complete and unicycle(run)
        if not exact or (run.every_step and not run.flew_on):
            return cls(run, run.t, run.position, run.every_step and not run.flew_on, 1)
        # A run that ended before a decision was taken flew the period before, whose end has no row.
        flown = len(run.t) - (0 if run.flew_on else 1)
        here = Pose(run.position[:flown], run.vehicles["theta_rad"][:flown])
        between = [arc(here, run.command[:flown], k * rates["fdm_dt_s"]).position for k in range(steps + 1)]
        n = run.scenario["vehicles"]
        last = between.pop()[-1:] if run.flew_on else run.position[-1:]
        track = np.concatenate([np.stack(between[:steps], axis=1).reshape(-1, n, 3), last])
        return cls(run, rates["fdm_dt_s"] * np.arange(len(track)), track, True, steps)

    @cached_property
    def stray(self) -> Array:
        """(S - 1, N) m: how far from the chord a vehicle may have been between two instants.

        Where the record resolves the motion, velocities are taken to vary by no more than twice what they do
        over the intervals around; elsewhere speeds and rates to stay within the limits and what was recorded.
        """
        run = self.run
        dt = np.diff(self.t)[:, None]
        if resolved(run):
            return np.asarray(0.5 * dt * self.changing)
        low, high = box(run.scenario)
        low, high = low.min(axis=0), high.max(axis=0)
        seen = run.rates.reshape(-1, 3)
        low, high = np.minimum(low, seen.min(axis=0)), np.maximum(high, seen.max(axis=0))
        rate = max(abs(low[1]), abs(high[1]))
        moved = np.diff(self.track, axis=0) / dt[..., None]
        along = _lag(np.hypot(moved[..., 0], moved[..., 1]), low[0], high[0])
        climb = _lag(moved[..., 2], low[2], high[2])
        return np.asarray(np.hypot(along, climb) * dt + high[0] * rate * dt**2 / 8.0)

    @cached_property
    def changing(self) -> Array:
        """(T - 1, N) m/s: the greatest change of velocity over a recorded interval or those beside it."""
        change = np.linalg.norm(np.diff(self.run.velocity, axis=0), axis=-1)
        padded = np.concatenate([change[:1], change, change[-1:]])
        return np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])

    @property
    def tail(self) -> float:
        """How far a vehicle may have flown after the last recorded instant of a run that went on [m]."""
        s = self.run.scenario
        end = s["duration_s"] if not self.run.ended else self.t[-1] + s["rates"]["record_dt_s"]
        velocity = self.run.velocity
        fastest, _, climb = box(s)[1].max(axis=0)
        fastest = max(fastest, float(np.linalg.norm(velocity, axis=-1).max()))
        left = max(0.0, end - float(self.t[-1]))
        return float(np.hypot(fastest, climb)) * left if left > 1e-9 else 0.0

    def passing(self) -> Array:
        """(S - 1, P) m: the nearest step of the flight dynamics to a pair's passing is within this."""
        pace = np.linalg.norm(np.diff(self.apart(), axis=0), axis=-1) / np.diff(self.t)[:, None]
        half = 0.5 * self.run.scenario["rates"]["fdm_dt_s"] * pace
        stray = self.stray[:, self.run.i] + self.stray[:, self.run.j]
        found = np.hypot(self.ways() + stray, half)
        if self.run.left_s is not None:  # one may have left before they passed
            found = np.where(self.run.apart()[1:][: len(found)], np.inf, found)
        return np.asarray(found)

    def distance(self) -> Array:
        """(S, P) m, of pairs that are both there"""
        run, apart = self.run, self.gone_at(False)
        found = np.linalg.norm(self.track[:, run.i] - self.track[:, run.j], axis=-1)
        return found if apart is None else np.where(apart[:, run.i] | apart[:, run.j], np.inf, found)

    def gone_at(self, between: bool) -> Array | None:
        """(S, N) who had left before each step; or (S - 1, N) before each way between two. None: nobody."""
        if self.run.left_s is None:
            return None
        return self.run.gone(self.t[:-1] if between else self.t - 2e-9)

    def ways(self) -> Array:
        """(S - 1, P) m: least distances of pairs that are both there, on straight lines between steps."""
        run, apart = self.run, self.gone_at(True)
        found = self.chords(self.apart())
        return found if apart is None else np.where(apart[:, run.i] | apart[:, run.j], np.inf, found)

    def chords(self, to: Array) -> Array:
        """Least distance (S - 1, K) m from 0 of offsets `to` (S, K, 3) that change along straight lines."""
        move = np.diff(to, axis=0)
        length = np.einsum("skx,skx->sk", move, move)
        share = -np.einsum("skx,skx->sk", to[:-1], move) / np.where(length > 0.0, length, 1.0)
        return np.linalg.norm(to[:-1] + np.clip(share, 0.0, 1.0)[..., None] * move, axis=-1)

    def apart(self) -> Array:
        """Offsets (S, P, 3) m of pairs."""
        return np.asarray(self.track[:, self.run.i] - self.track[:, self.run.j])


def resolved(run: Recorded) -> bool:
    """Whether changes of velocity show in the record: an aircraft's takes longer than a tenth of a second."""
    period = run.scenario["rates"]["record_dt_s"]
    seen = run.scenario["plant"] == "jsbsim" or (run.complete and run.scenario["plant"] == "lagged")
    return bool(period <= RESOLVED_S and seen and "plant" not in run.parts)


def _lag(mean: Array, low: float, high: float) -> Array:
    """How far ahead of its mean motion one can be, per second, within rates low to high."""
    m = np.clip(mean, low, high)
    return np.asarray((high - m) * (m - low) / max(high - low, 1e-12))
