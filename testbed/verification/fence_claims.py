"""Checks G10 and G11 and the table of fences: how near each vehicle came to its fences, and the least h."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from testbed.claims import registry
from testbed.records.verdict import Status
from testbed.verification.fences import FAR, FenceRows, combinations, fence_rows, fences
from testbed.verification.finding import Finding, Judge, Values, compared
from testbed.verification.future import Pose, manoeuvre
from testbed.verification.pair_claims import H_ALLOWED, unicycle
from testbed.verification.path_bounds import ROUNDING, PathBounds
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import Scenario, box

# How closely a clearance between samples is known [m].
BETWEEN_M = 1e-9
# Instants looked at together: what the edges of all fences take of memory stays below some hundred megabytes.
BLOCK = 20_000


@dataclass(frozen=True)
class Fenced:
    """The clearances and h of K combinations of a fence and a vehicle."""

    run: Recorded
    paths: PathBounds

    @property
    def s(self) -> Scenario:
        return self.run.scenario

    @cached_property
    def who(self) -> Array:
        """(K, 2) fence and vehicle, from 0."""
        return combinations(self.s)

    @cached_property
    def now(self) -> FenceRows:
        """The rows at the true poses."""
        run = self.run
        rows = fence_rows(self.s, Pose(run.position, run.vehicles["theta_rad"]), manoeuvre(self.s))
        return rows.without(run.gone(run.t))

    @cached_property
    def h(self) -> Array:
        """(T, K) m"""
        return self.now.least(self.who)

    @property
    def unsafe(self) -> bool:
        """Whether the start is outside the safe set."""
        return bool(self.h[0].min() < -H_ALLOWED)

    def clearance(self, track: Array, gone: Array | None) -> Array:
        """(S, K) m along a track (S, N, 3), FAR of who has left, gone (S, N)."""
        listed = fences(self.s)
        found = np.stack([listed[k].clearance(track[:, v]) for k, v in self.who], axis=1)
        return found if gone is None else np.where(gone[:, self.who[:, 1]], FAR, found)

    def table(self) -> Iterator[Finding]:
        """The recorded clearances and h."""
        run, gone = self.run, self.run.gone(self.run.t)
        for name, what, own, off in (
            ("clearance_m", "clearance_m", self.clearance(run.position, gone), ROUNDING),
            ("h_m", "fence_h_m", self.h, H_ALLOWED + self.now.off),
        ):
            said = run.fences[name]
            # Nothing is said of who has left.
            said = np.where(gone[:, self.who[:, 1]] & np.isnan(said), own, said)
            yield compared(what, said, own, off)

    def findings(self) -> Iterator[Finding]:
        for claim, look in (
            (registry.FENCE_CLEARANCE, self._kept),
            (registry.FENCE_SAFE_SET, self._invariance),
        ):
            if claim.id in self.run.guarantees:
                yield look(Judge(self.run, self.run.guarantees[claim.id]))

    def _by_vehicle(self, values: Array) -> tuple[Array, list[list[int]]]:
        """The least of every vehicle's fences (S, V), and the vehicles from 1."""
        vehicles = np.unique(self.who[:, 1])
        least = [values[:, self.who[:, 1] == v].min(axis=1) for v in vehicles]
        return np.stack(least, axis=1), [[int(v) + 1] for v in vehicles]

    def _expect_fence(self, judge: Judge, t: Array, values: Array) -> None:
        """The fence named is the one that value belongs to."""
        e = judge.entry
        said = e["detail"].get("fence")
        own = [[int(k) + 1, [int(v) + 1]] for k, v in self.who]
        if [said, e["vehicles"]] not in own:
            judge.wrong.append(f"fence {said} is not one of vehicle {e['vehicles']}")
            return
        k = int(np.argmin(np.abs(t - e["t_s"])))
        here = float(values[k, own.index([said, e["vehicles"]])])
        if abs(t[k] - e["t_s"]) <= 1e-6 and abs(here - e["value"]) > ROUNDING:
            judge.wrong.append(f"it is {here:.6g} m from fence {said} at {e['t_s']:g} s")

    def _kept(self, judge: Judge) -> Finding:
        paths, e = self.paths, judge.entry
        at = self.clearance(paths.track, paths.gone_at(False))
        values, who = self._by_vehicle(at)
        floor, ceiling = None, np.inf
        if not paths.whole:
            length = np.linalg.norm(np.diff(paths.track, axis=0), axis=-1)[:, self.who[:, 1]]
            stray = paths.stray[:, self.who[:, 1]]
            last = np.where(at[1:] < FAR, at[1:], at[:-1] - length)  # who leaves in between flew no farther
            low = 0.5 * (last + at[:-1] - length) - stray
            floor = float(min(low.min(initial=np.inf), at[-1].min() - paths.tail))
        if e["value"] is None:
            return judge.least(
                Values.of(paths.t, values, ROUNDING, who, floor=floor), 0.0, lambda d: d >= 0.0
            )
        possible = e["detail"].get("possible_m", np.nan)
        possible = -np.inf if possible is None else float(possible)
        self._expect_fence(judge, paths.t, at)
        least, radius = self._between(at)
        sampled = float(at.min())
        if radius is None:
            if not possible <= e["value"] + ROUNDING:
                judge.wrong.append(f"possible_m is {possible:.6g}, above the value")
        elif not abs(possible - min(least - radius, e["value"])) <= ROUNDING:
            judge.wrong.append(f"possible_m is {possible:.6g}, should be {least - radius:.6g}")
        if radius is not None and e["value"] < 0.0 <= sampled:  # beyond the fence between samples alone
            judge.expect_near("value", e["value"], least + radius, ROUNDING)
            judge.expect("bound", e["bound"], 0.0)
            judge.expect("margin", e["margin"], e["value"])
            judge.expect("verdict", e["verdict"], judge.verdict(False))
            return judge.done(f"{least + radius:.6g}", ROUNDING)
        certain = possible >= -BETWEEN_M
        fails = Status.VIOLATED if e["value"] < 0.0 else Status.OPEN
        if fails is Status.OPEN and self.run.ended:
            fails = Status.PREMISE_NOT_MET
        seen = Values.of(paths.t, values, ROUNDING, who, floor=floor, ceiling=ceiling)
        return judge.least(seen, 0.0, lambda d: d >= 0.0 and certain, fails)

    def _between(self, at: Array) -> tuple[float, float | None]:
        """The least clearance on straight lines between samples of the vehicle that it may be least of.

        And how far its path may be from that line; None where the record does not tell.
        """
        paths, listed = self.paths, fences(self.s)
        if len(paths.t) < 2 or not paths.whole:
            return float(at.min()), None
        radius = self._bend()
        low, found, gone = np.inf, (np.inf, 0.0), paths.gone_at(True)
        for k, v in self.who:
            track = paths.track[:, v]
            first, last = track[:-1], track[1:]
            parts = (slice(p, p + BLOCK) for p in range(0, len(first), BLOCK))
            lines = np.concatenate([listed[k].along_chords(first[p], last[p]) for p in parts])
            least = float((lines if gone is None else np.where(gone[:, v], FAR, lines)).min())
            if least - radius[v] < low:
                low, found = least - radius[v], (least, float(radius[v]))
        return found

    def _bend(self) -> Array:
        """(N,) m: how far paths may be from the straight lines between steps."""
        run, rates = self.run, self.s["rates"]
        if unicycle(run):
            flown = run.command if run.flew_on else run.command[:-1]
            turning = np.abs(flown[..., 0] * flown[..., 1]).max(axis=0, initial=0.0)
            return np.asarray(turning * rates["fdm_dt_s"] ** 2 / 8.0)
        periods = round(rates["filter_dt_s"] / rates["fdm_dt_s"])
        second = np.linalg.norm(np.diff(self.paths.track, n=2, axis=0), axis=-1)
        if periods > 1:
            second = second[np.arange(1, len(second) + 1) % periods != 0]
        if not len(second):
            return np.full(self.paths.track.shape[1], np.inf)
        return np.asarray(second.max(axis=0) / 4.0)

    def _invariance(self, judge: Judge) -> Finding:
        values, who = self._by_vehicle(self.h)
        floor = None if self.run.complete else self._lowest()
        seen = Values.of(self.run.t, values, H_ALLOWED + self.now.off, who, floor=floor)
        if judge.entry["value"] is not None:
            self._expect_fence(judge, self.run.t, self.h)
        return judge.least(seen, -H_ALLOWED, lambda h: h >= -H_ALLOWED, void=self.unsafe)

    def _lowest(self) -> float:
        """What h may come down to between recorded instants, at the rates seen or allowed."""
        low, high = box(self.s)
        rates = np.abs(self.run.rates.reshape(-1, 3)).max(axis=0)
        most = np.maximum(np.maximum(np.abs(low), np.abs(high)).max(axis=0), rates)
        # Along and across the fence the circle moves as fast as its vehicle and its lever turn.
        gamma = manoeuvre(self.s)
        lever = np.where(
            gamma[:, 1] != 0.0, gamma[:, 0] / np.where(gamma[:, 1] != 0.0, gamma[:, 1], 1.0), 0.0
        )
        pace = most[0] + np.abs(lever).max() * most[1] + most[2]
        period, h = self.s["rates"]["record_dt_s"], self.h
        between = 0.5 * (h[1:] + h[:-1] - pace * period)
        return float(min(between.min(initial=np.inf), h[-1].min() - pace * period))


def without_fences(run: Recorded) -> Iterator[Finding]:
    """The claims of a run whose fences are for nobody, or that should have none."""
    for claim in registry.FENCES:
        if claim.id in run.guarantees:
            yield Judge(run, run.guarantees[claim.id]).nothing("no fence is for anybody")
