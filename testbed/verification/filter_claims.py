"""G4, G5, G6: the QPs' rows built again from what the filter saw, and the commands held against them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from testbed.verification.finding import OTHER, PREMISE, Finding, Judge, Values
from testbed.verification.future import BLOCK, Flown, Future, Pose, fly_on, future, manoeuvre
from testbed.verification.pair_claims import H_ALLOWED, SOLVING, Pairs
from testbed.verification.recorded import Array, Recorded
from testbed.verification.scene import Scenario, alpha, box, filters_own, inside, margin, steepness
from testbed.verification.sight import sight

ROW_ALLOWED = 1e-6
# Poses predicted by lags are integrals, the filter's and ours: so far are they apart, with levers.
BLUR_M = 1e-6
FAILED = ("infeasible", "iteration_limit")


@dataclass(frozen=True)
class Rows:
    """What the filter's rows were, where that can be told.

    seen   the poses that it looked at, or why nobody knows
    """

    run: Recorded
    pairs: Pairs | None
    seen: Pose | str

    @classmethod
    def of(cls, run: Recorded, pairs: Pairs | None) -> Rows:
        return cls(run, pairs, sight(run))

    @property
    def s(self) -> Scenario:
        return self.run.scenario

    @cached_property
    def own(self) -> Flown | None:
        """h and L_g h (T, P) of the filter's own barrier at the poses it saw."""
        run, s = self.run, filters_own(self.s)
        if isinstance(self.seen, str) or self.pairs is None:
            return None
        true = s["barrier"] == self.s["barrier"] and s["d_safe_m"] == self.s["d_safe_m"]
        same = true and self.seen.position is run.position
        flown = self.pairs.now if same else fly_on(s, self.seen, run.i, run.j)
        if flown is not None and self.s["remedy"]["predict_lags"]:
            flown = replace(flown, off=flown.off + BLUR_M, lie_off=flown.lie_off + BLUR_M)
        if flown is None or s["barrier"]["gradient"] == "analytic":
            return flown
        return _differenced(s, self.seen, run.i, run.j, flown, run.command)

    @cached_property
    def left(self) -> tuple[Array, Array]:
        """L_g h u + alpha(h) (T, P) of the filter's rows under the commands, and its error."""
        assert self.own is not None
        u = self.run.command
        hdot, off = self.own.hdot(u[:, self.run.i], u[:, self.run.j])
        steep = steepness(self.s, self.own.h) * self.own.off
        room = alpha(self.s, self.own.h)
        return hdot + room, off + steep + 1e-13 * (np.abs(room) + np.abs(hdot))

    @cached_property
    def solved(self) -> Array:
        return np.asarray(self.run.vehicles["qp_status"] == "solved")

    def findings(self) -> Iterator[Finding]:
        for name, look in (
            ("qp-feasibility", self._feasibility),
            ("command-limits", self._limits),
            ("rows-satisfied", self._satisfied),
        ):
            if name in self.run.guarantees:
                yield look(Judge(self.run, self.run.guarantees[name]))
        if self.solves and self.own is not None:
            yield self._solutions()

    @cached_property
    def solves(self) -> bool:
        """Whether QPs stand behind the commands."""
        solving = self.s["filter"]["kind"] in SOLVING
        return solving and bool((self.run.vehicles["qp_status"] != "none").any())

    def _feasibility(self, judge: Judge) -> Finding:
        run, e = self.run, judge.entry
        if not self.solves:
            judge.expect("value", e["value"], None)
            judge.expect("verdict", e["verdict"], OTHER)
            return judge.done("no QP")
        status = run.vehicles["qp_status"]
        failed = np.isin(status, FAILED)
        count = int(failed.sum())
        if not isinstance(e["value"], int) or e["value"] < count or (run.complete and e["value"] != count):
            judge.wrong.append(f"{count} are recorded")
        value = e["value"] if isinstance(e["value"], int) else count
        judge.expect("bound", e["bound"], 0)
        judge.expect("margin", e["margin"], -value)
        judge.expect("verdict", e["verdict"], judge.verdict(value == 0))
        if run.complete:
            due = {name: int((status == name).sum()) for name in FAILED if (status == name).any()}
            judge.expect("detail", {k: n for k, n in e["detail"].items() if k in FAILED}, due)
            fewest, most = (int(failed[safe].sum()) for safe in self._safe())
            if not fewest <= e["detail"].get("in_safe_set", -1) <= most:
                judge.wrong.append(f"in_safe_set is {e['detail'].get('in_safe_set')}, {most} is due")
            if count:
                k, v = (int(a[0]) for a in np.nonzero(failed))
                judge.expect("t_s", e["t_s"], float(run.t[k]))
                judge.expect("vehicles", e["vehicles"], [v + 1])
        return judge.done(f"{count} recorded", open_=not run.complete and count == 0)

    def _safe(self) -> tuple[Array, Array]:
        """Instants (T,) at which every pair is safe beyond round-off, and at which it may be."""
        if self.pairs is None:
            every = np.ones(len(self.run.t), dtype=bool)
            return np.asarray(every & (self.run.i.size == 0)), every
        now = self.pairs.now
        off = now.off + H_ALLOWED
        return np.all(now.h >= off, axis=1), np.all(now.h >= -off, axis=1)

    def _limits(self, judge: Judge) -> Finding:
        run, e = self.run, judge.entry
        share = inside(run.command, *box(self.s))
        who = [[v + 1] for v in range(self.s["vehicles"])]
        seen = Values.of(run.t, share, 1e-12, who, floor=None if run.complete else -np.inf)
        for k, name in enumerate(("v_mps", "omega_radps", "zeta_mps")):
            low, high = float(run.rates[..., k].min()), float(run.rates[..., k].max())
            said = e["detail"].get(f"achieved_{name}", [np.nan, np.nan])
            if not (said[0] <= low and said[1] >= high):
                judge.wrong.append(f"achieved {name} {low:.6g} to {high:.6g} are recorded")
            elif run.complete and not (said[0] == low and said[1] == high):
                judge.wrong.append(f"achieved {name} is only {low:.6g} to {high:.6g}")
        self._stops(judge)
        return judge.least(seen, 0.0, lambda x: x >= 0.0, empty=PREMISE)

    def _stops(self, judge: Judge) -> None:
        """Shares of the recorded instants held back by the autopilot, or with the throttle at a stop."""
        held = judge.entry["detail"].get("share_at_stop", {})
        for name in ("limited_v", "limited_omega", "limited_zeta", "throttle"):
            if name in held and name in self.run.vehicles:
                x = self.run.vehicles[name]
                stopped = (x <= 0.01) | (x >= 0.99) if name == "throttle" else x > 0.5
                judge.expect_near(f"{name} at a stop", held[name], float(stopped.mean(axis=0).max()), 1e-9)

    def _satisfied(self, judge: Judge) -> Finding:
        run, e = self.run, judge.entry
        if not self.solves or not run.i.size:
            judge.expect("value", e["value"], None)
            judge.expect("verdict", e["verdict"], OTHER)
            return judge.done("no rows")
        if self.own is None:
            missing = self.seen if isinstance(self.seen, str) else "a manoeuvre that we do not fly"
            empty = np.zeros((0, run.i.size))
            assert self.pairs is not None or missing
            who = [[int(a) + 1, int(b) + 1] for a, b in zip(run.i, run.j, strict=True)]
            seen = Values.of(np.zeros(0), empty, 0.0, who, floor=-np.inf)
            return judge.least(seen, 0.0, lambda x: x >= -ROW_ALLOWED, empty=PREMISE, missing=missing)
        assert self.pairs is not None
        left, off = self.left
        counts = self.solved[:, run.i] & self.solved[:, run.j]
        floor = None if run.complete else -np.inf
        seen = Values.of(run.t, left, off, self.pairs.who, counts, floor=floor)
        return judge.least(seen, 0.0, lambda x: x >= -ROW_ALLOWED, empty=PREMISE)

    def _solutions(self) -> Finding:
        """Every vehicle said to have a solution satisfies its rows, raised by the remedies' margins.

        Centralised: those of its pairs. Limited: its own half of each, the other one taken to fly gamma.
        """
        run, own, s = self.run, self.own, self.s
        assert own is not None
        left, off = self.left
        sides = [margin(s, own.lie[side]) for side in range(2)]
        at = self.solved
        if s["filter"]["kind"] == "centralised":
            short = np.where(at[:, run.i] & at[:, run.j], sides[0] + sides[1] - left - off, -np.inf)
        else:
            if s["network"]["latency_s"] or s["network"]["loss"]:
                late = "each vehicle saw late poses of the others"
                return Finding("solutions", f"{int(at.sum())} solved", "no rows", None, None, late)
            short = np.maximum(*(self._half(side, sides[side], off) for side in range(2)))
        worst = float(short.max(initial=-np.inf))
        good, tight = worst <= ROW_ALLOWED, float(off.max(initial=0.0))
        note = "" if good else f"a row is short by {worst:.3g} where a solution is claimed"
        return Finding(
            "solutions",
            f"{int(at.sum())} solved",
            f"short by {max(worst, 0.0):.2g} at most",
            good,
            tight,
            note,
        )

    def _half(self, side: int, raised: Array, off: Array) -> Array:
        """By how much one side's limited row is short (T, P) where its vehicle has a solution."""
        run, own = self.run, self.own
        assert own is not None
        mine, other = (run.i, run.j)[:: 1 if side == 0 else -1]
        own_gamma, other_gamma = self._gamma(mine), self._gamma(other)
        u = run.command[:, mine]
        room, rest = 0.5 * alpha(self.s, own.h), 0.0
        for k in range(3):
            a, b = own.lie[side, k], own.lie[1 - side, k]
            rest = rest + a * (u[..., k] - 0.5 * own_gamma[..., k]) + 0.5 * b * other_gamma[..., k]
        return np.where(self.solved[:, mine], raised - room - rest - off, -np.inf)

    def _gamma(self, vehicle: Array) -> Array:
        """gamma (P, 3) of one side of every pair."""
        made = filters_own(self.s)
        if not made["barrier"]["pairs"]:
            return manoeuvre(made)[vehicle]
        return np.array([[p["v_mps"], np.radians(p["omega_degps"]), 0.0] for p in made["barrier"]["pairs"]])


def _differenced(s: Scenario, pose: Pose, i: Array, j: Array, flown: Flown, u: Array) -> Flown:
    """L_g h by forward differences of h over x, y, course and height, as the published figures were made.

    Only of rows that could be the tightest, were L_g h twice as large: no other is near to being the least.
    """
    made, step, low_high = future(s, i, j), s["barrier"]["gradient_step"], box(s)
    assert made is not None
    hdot, _ = flown.hdot(u[:, i], u[:, j])
    corner = np.maximum(*map(np.abs, low_high))
    room = alpha(s, flown.h)
    worst = room - 2.0 * np.einsum("sktp,k->tp", np.abs(flown.lie), corner)
    k, p = np.nonzero(worst <= float((room + hdot).min(initial=np.inf)) + 1.0)
    lie = flown.lie.copy()
    for first in range(0, k.size, BLOCK):
        some = k[first : first + BLOCK], p[first : first + BLOCK]
        lie[:, :, *some] = _slopes(made.of(some[1]), pose, some[0], i[some[1]], j[some[1]], step)
    share = float(np.finfo(np.longdouble).eps / np.finfo(float).eps)
    off = flown.lie_off.copy()
    off[:, :, k, p] = off[:, :, k, p] * share + 2.0 * flown.off[k, p] * share / step + 1e-9
    return replace(flown, lie=lie, lie_off=off)


def _slopes(made: Future, pose: Pose, k: Array, i: Array, j: Array, step: float) -> Array:
    """L_g h (2, 3, M) of pairs (i, j) at instants k (M,), in numbers long enough for differences."""
    a, b = (
        Pose(pose.position[k, v].astype(np.longdouble), pose.theta[k, v].astype(np.longdouble))
        for v in (i, j)
    )
    start, lie = made.h(a, b), np.empty((2, 3, k.size))
    for side, here in enumerate((a, b)):
        slopes = []
        for moved in step * np.eye(4):  # x, y, z, course
            there = Pose(here.position + moved[:3], here.theta + moved[3])
            h = made.h(there, b) if side == 0 else made.h(a, there)
            slopes.append((h - start) / step)
        lie[side, 0] = slopes[0] * np.cos(here.theta) + slopes[1] * np.sin(here.theta)
        lie[side, 1], lie[side, 2] = slopes[3], slopes[2]
    return lie
