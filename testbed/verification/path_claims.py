"""Checks G1, G7 and G8 from the paths flown: distances, goals, cost of the filter's interventions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from testbed.claims import registry
from testbed.records.verdict import Status
from testbed.verification import fleet, guidance_laws
from testbed.verification.finding import Finding, Judge, Values, thin
from testbed.verification.future import manoeuvre
from testbed.verification.passing import BETWEEN_M, Passing
from testbed.verification.path_bounds import ROUNDING, PathBounds
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import box, goals, seeking

# Smallest change of a command that counts as the filter's doing.
OVERRIDE = 1e-6
# The solo time of a run is a sum over points of the straight path; ours is an integral [s].
ALONE = 1e-3


@dataclass(frozen=True)
class PathClaims:
    """The claims about where the vehicles were."""

    run: Recorded
    paths: PathBounds

    @property
    def s(self) -> dict[str, Any]:
        return self.run.scenario

    def findings(self) -> Iterator[Finding]:
        for claim, kind in ((registry.SEPARATION, "ours"), (registry.SEPARATION_INTRUDERS, "beside")):
            if claim.id in self.run.guarantees:
                of = self._among(kind)
                yield of._separation(Judge(of.run, self.run.guarantees[claim.id]))
        for claim, look in (
            (registry.GOAL, self._goal),
            (registry.INTERVENTION, self._intervention),
        ):
            if claim.id in self.run.guarantees:
                yield look(Judge(self.run, self.run.guarantees[claim.id]))
        yield self.added()

    def _among(self, kind: str) -> PathClaims:
        """Of a kind of pairs alone, see `fleet.which`; all where there are no intruders."""
        if not fleet.strangers(self.s):
            return self
        run = fleet.among(self.run, fleet.which(self.run, kind))
        return PathClaims(run, replace(self.paths, run=run))

    def _separation(self, judge: Judge) -> Finding:
        run, paths, e = self.run, self.paths, judge.entry
        who = [[int(a) + 1, int(b) + 1] for a, b in zip(run.i, run.j, strict=True)]
        if not run.i.size:
            return judge.nothing("nobody else")
        d_safe, distance = self.s["d_safe_m"], paths.distance()
        chords = paths.ways()
        floor, ceiling = None, np.inf
        if not paths.whole:
            ceiling = float(paths.passing().min(initial=np.inf))
            stray = paths.stray[:, run.i] + paths.stray[:, run.j]
            floor = float(min((chords - stray).min(initial=np.inf), distance[-1].min() - 2.0 * paths.tail))
        between = e["detail"].get("between_steps_m")
        if between is not None and e["value"] is not None:
            most = e["value"] if floor is not None else float(chords.min(initial=np.inf))
            most += ROUNDING
            least = float(chords.min(initial=np.inf)) - ROUNDING if floor is None else floor
            if not least <= between <= most:
                judge.wrong.append(f"between_steps_m is {between:.6g}, should be {least:.6g} to {most:.6g}")
        elif len(run.t) > 1:
            judge.wrong.append("between_steps_m is missing")
        passing = Passing.of(run, paths, d_safe)
        possible = e["detail"].get("possible_m", np.nan)
        possible = -np.inf if possible is None else float(possible)  # no bound
        if e["value"] is not None:
            least = float(distance.min(initial=np.inf))
            if not passing.allows(possible, e["value"]):
                judge.wrong.append(f"possible_m is {possible}, should be {passing}")
            elif e["value"] < d_safe <= least and paths.whole:
                return self._between_samples(judge, passing)
        certain = possible >= d_safe - BETWEEN_M
        fails = Status.VIOLATED if e["value"] is None or e["value"] < d_safe else Status.OPEN
        if fails is Status.OPEN and run.ended:
            fails = Status.PREMISE_NOT_MET
        seen = Values.of(paths.t, distance, ROUNDING, who, floor=floor, ceiling=ceiling)
        return judge.least(seen, d_safe, lambda d: d >= d_safe and certain, fails)

    def _between_samples(self, judge: Judge, passing: Passing) -> Finding:
        """A pair that came nearer than Ds between steps of the flight dynamics, and not at any of them."""
        e, d_safe = judge.entry, self.s["d_safe_m"]
        judge.expect_near("value", e["value"], passing.least, ROUNDING)
        judge.expect("bound", e["bound"], float(d_safe))
        judge.expect("margin", e["margin"], float(e["value"] - d_safe))
        judge.expect("verdict", e["verdict"], judge.verdict(False))
        if e["vehicles"] != passing.vehicles or not passing.begin <= e["t_s"] <= passing.end:
            where = f"{passing.vehicles}, {passing.begin:g} to {passing.end:g} s"
            judge.wrong.append(f"it is {e['vehicles']} at {e['t_s']:g} s, should be {where}")
        return judge.done(f"{passing.least:.6g}", ROUNDING)

    @cached_property
    def _to_goal(self) -> Array:
        """Offsets (S, N, 3) m."""
        return np.asarray(self.paths.track - goals(self.s))

    def _goal(self, judge: Judge) -> Finding:
        paths, e = self.paths, judge.entry
        radius, said = self.s["goal_radius_m"], e["value"]
        due = seeking(self.s) & self.under
        if not due.any():
            judge.expect("verdict", e["verdict"], Status.NOT_APPLICABLE)
            judge.expect("value", said, None)
            return judge.done("no goal", None)
        distance = np.linalg.norm(self._to_goal, axis=-1)
        if (gone := paths.gone_at(False)) is not None:
            distance = np.where(gone, np.inf, distance)
        nearest = np.where(due, distance.min(axis=0), -np.inf)
        high = float(nearest.max())
        low = high
        if not paths.whole:
            closest = (paths.chords(self._to_goal) - paths.stray).min(axis=0, initial=np.inf)
            low = float(np.maximum(np.minimum(closest, distance[-1] - paths.tail), 0.0)[due].max())
        if not low - ROUNDING <= said <= high + ROUNDING:
            judge.wrong.append(f"value is {said:.6g}, should be {low:.6g} to {high:.6g}")
        judge.expect("bound", e["bound"], radius)
        judge.expect("margin", e["margin"], radius - said)
        judge.expect("verdict", e["verdict"], judge.verdict(said <= radius))
        self._worst_goal(judge, nearest, high - low)
        passed = self.passed[due]
        if paths.whole and not np.isnan(passed).any():
            last = e["detail"].get("last_passed_s", np.nan)
            judge.expect_near("last_passed_s", last, float(passed.max()), ROUNDING)
        if paths.whole and np.isnan(passed).any() and "last_passed_s" in e["detail"]:
            judge.wrong.append("last_passed_s is given, and some never passed")
        open_ = (low <= radius) != (high <= radius)
        own = f"{high:.6g}" if paths.whole else f"{low:.6g} to {high:.6g}"
        return judge.done(own, max(high - low, ROUNDING), open_)

    def _worst_goal(self, judge: Judge, nearest: Array, wide: float) -> None:
        e, paths = judge.entry, self.paths
        if len(e["vehicles"]) != 1 or not 1 <= e["vehicles"][0] <= self.s["vehicles"]:
            judge.wrong.append(f"vehicles are {e['vehicles']}")
            return
        v = e["vehicles"][0] - 1
        if nearest[v] < nearest.max() - wide - ROUNDING:
            judge.wrong.append(f"vehicle {v + 1} came within {nearest[v]:.6g} m")
        k = int(np.argmin(np.abs(paths.t - e["t_s"])))
        there = float(np.linalg.norm(self._to_goal[k, v]))
        if abs(paths.t[k] - e["t_s"]) > 1e-6:
            if paths.whole:
                judge.wrong.append(f"nothing was flown at {e['t_s']:g} s")
        elif not abs(there - e["value"]) <= ROUNDING:
            judge.wrong.append(f"vehicle {v + 1} is {there:.6g} m from its goal at {e['t_s']:g} s")

    @cached_property
    def under(self) -> Array:
        """(N,) whether each is under the filter."""
        return fleet.under(self.s)

    @cached_property
    def passed(self) -> Array:
        """(N,) s: when each came within its goal radius first; nan if never."""
        within = np.linalg.norm(self._to_goal, axis=-1) <= self.s["goal_radius_m"]
        return np.where(within.any(axis=0), self.paths.t[np.argmax(within, axis=0)], np.nan)

    def _intervention(self, judge: Judge) -> Finding:
        run, e = self.run, judge.entry
        judge.expect("verdict", e["verdict"], Status.NOT_APPLICABLE)
        for name in ("bound", "margin", "t_s"):
            judge.expect(name, e[name], None)
        low, high = box(self.s)
        wanted = np.clip(run.channels("_nominal"), low, high)
        change = np.where(run.present[..., None], np.abs(run.command - wanted), 0.0)
        share = (change.max(axis=-1) > OVERRIDE).mean(axis=0)
        if not run.complete:
            return judge.done(f"about {share.max():.3g}", None, True)
        judge.expect("value", e["value"], float(share.max()))
        worst = [[v + 1] for v in np.flatnonzero(share >= share.max() - 1e-9)]
        if e["vehicles"] not in worst:
            judge.wrong.append(f"vehicle {int(np.argmax(share)) + 1} is altered most")
        totals = change.sum(axis=(0, 1)) * self.s["rates"]["filter_dt_s"]
        for name, due in zip(("altered_v_m", "altered_omega_rad", "altered_zeta_m"), totals, strict=True):
            judge.expect_near(name, e["detail"].get(name), float(due), 1e-9 * max(1.0, due) + 1e-9)
        if self.paths.whole:
            self._added(judge)
        return judge.done(f"{share.max():.6g}", 1e-9)

    def added(self) -> Finding:
        """Whether path and time added were compared, with the claim that reports them."""
        what = f"{self.s['vehicles']} vehicles"
        if self.paths.whole:
            return Finding("path-and-time", what, "with intervention", True)
        return Finding("path-and-time", what, "unknown", None, None, thin(self.run))

    def _added(self, judge: Judge) -> None:
        """Path and time beyond the straight path at the nominal speed."""
        paths, s = self.paths, self.s
        start = paths.track[0]
        straight = np.linalg.norm(goals(s) - start, axis=-1)
        flown = np.concatenate(
            [
                np.zeros((1, s["vehicles"])),
                np.cumsum(np.linalg.norm(np.diff(paths.track, axis=0), axis=-1), axis=0),
            ]
        )
        passed, detail = np.where(seeking(s), self.passed, np.nan), judge.entry["detail"]
        alone = self._alone(start, straight)
        for name, off in (("path_added_m", ROUNDING), ("time_added_s", ALONE)):
            said = detail.get(name) or []
            if len(said) != s["vehicles"]:
                judge.wrong.append(f"{name} is missing")
                continue
            for v, word in enumerate(said):
                none = np.isnan(passed[v]) or (name == "time_added_s" and np.isnan(alone[v]))
                if none or word is None:
                    judge.expect(f"{name} of vehicle {v + 1}", word, None if none else "a number")
                    continue
                # The filter period in which the vehicle arrives still counts as a whole.
                k = round(float(passed[v] / (paths.t[1] - paths.t[0]))) if len(paths.t) > 1 else 0
                steps = round(s["rates"]["filter_dt_s"] / s["rates"]["fdm_dt_s"])
                k = min(-(-k // steps) * steps, len(flown) - 1)
                path = flown[k, v] - (straight[v] - s["goal_radius_m"])
                due = path if name == "path_added_m" else passed[v] - alone[v]
                judge.expect_near(f"{name} of vehicle {v + 1}", word, float(due), off * max(1.0, abs(due)))

    def _alone(self, start: Array, straight: Array) -> Array:
        """(N,) s: the straight path to the goal radius at the nominal ground speed, inside the limits.

        nan for a vehicle whose guidance flies a path of its own.
        """
        s, laws = self.s, guidance_laws.tables(self.s)
        low, high = box(s)
        left = np.maximum(straight - s["goal_radius_m"], 0.0)
        level = np.linalg.norm((goals(s) - start)[:, :2], axis=-1) / np.where(straight > 0, straight, 1.0)
        share, found = (np.arange(20_000) + 0.5) / 20_000, np.full(len(laws), np.nan)
        low, high = (np.broadcast_to(corner, (len(laws), 3))[:, 0] for corner in (low, high))
        for k, law in enumerate(laws):
            if law["kind"] == "manoeuvre":
                found[k] = left[k] / np.clip(manoeuvre(s)[k, 0], low[k], high[k])
            elif law["kind"] in ("layers", "roundabout"):
                found[k] = left[k] / np.clip(law["speed_mps"], low[k], high[k])
            elif law["kind"] == "near-identity":
                # Gain times the level distance still to go, from all of it down to the goal radius.
                to_go = straight[k] - left[k] * share
                pace = np.clip(law["gain_per_s"] * level[k] * to_go, low[k], high[k])
                found[k] = (left[k] / pace).mean()
        return found
