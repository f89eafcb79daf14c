"""Builds the rows of the filter's QPs again from the poses that the filter saw."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from testbed.verification import fleet
from testbed.verification.departed import without
from testbed.verification.fences import FenceRows, fence_rows
from testbed.verification.filter_view import filter_view
from testbed.verification.future import BLOCK, Flown, Future, Pose, fly_on, future, manoeuvre
from testbed.verification.pair_claims import SOLVING, Pairs
from testbed.verification.range_claim import apart
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import Scenario, alpha, box, filters_own, margin, steepness

# Largest difference of predicted poses, integrals computed differently here and by the filter, with levers.
BLUR_M = 1e-6
# h of a pair without a row: it asks for nothing.
FAR_M = 1e3


@dataclass(frozen=True)
class Rows:
    """What the filter's rows were, where that can be told.

    seen   the poses that it used, or why they are unknown
    """

    run: Recorded
    pairs: Pairs | None
    seen: Pose | str

    @classmethod
    def of(cls, run: Recorded, pairs: Pairs | None) -> Rows:
        who = apart(run)
        return cls(run, pairs, who if isinstance(who, str) else filter_view(run))

    @property
    def s(self) -> Scenario:
        return self.run.scenario

    @property
    def untold(self) -> str:
        """Why what the filter computed of all pairs cannot be told from the record; empty if it can."""
        run = self.run
        if run.ended:
            return "the run ended early"
        if not run.complete:
            return "not every step of the filter is recorded"
        if isinstance(self.seen, str):
            return self.seen
        if self.seen.position is not run.position:
            return "the filter saw other poses than those recorded"
        if run.left_s is not None or self.s["sensing"].get("range_m") is not None:
            return "not every pair was looked at in every step"
        return ""

    @cached_property
    def apart(self) -> Array | None:
        """Pairs (T, P) that had no row, for neither knew of the other; None where all knew all."""
        found = apart(self.run)
        return None if isinstance(found, str) else found

    @cached_property
    def own(self) -> Flown | None:
        """h and L_g h (T, P) of the filter's rows at the poses it saw; rows of pairs apart ask nothing."""
        flown = self._everybody
        if flown is None or self.apart is None:
            return flown
        lie, lie_off = (np.where(self.apart, 0.0, a) for a in (flown.lie, flown.lie_off))
        return replace(flown, h=np.where(self.apart, FAR_M, flown.h), lie=lie, lie_off=lie_off)

    @cached_property
    def _everybody(self) -> Flown | None:
        """h and L_g h (T, P) of the filter's own barrier at the poses it saw, of all pairs."""
        run, s = self.run, filters_own(self.s)
        if not run.i.size and run.fences and not isinstance(self.seen, str):  # alone: no pair has a row
            none, no_lie = np.zeros((len(run.t), 0)), np.zeros((2, 3, len(run.t), 0))
            return Flown(none, no_lie, none, no_lie, None)
        if isinstance(self.seen, str) or self.pairs is None:
            return None
        true = s["barrier"] == self.s["barrier"] and s["d_safe_m"] == self.s["d_safe_m"]
        same = true and self.seen.position is run.position
        flown = self.pairs.now if same else without(run, fly_on(s, self.seen, run.i, run.j))
        if flown is not None and self.s["remedy"]["predict_lags"]:
            flown = replace(flown, off=flown.off + BLUR_M, lie_off=flown.lie_off + BLUR_M)
        if flown is None or s["barrier"]["gradient"] == "analytic":
            return flown
        return without(run, _differenced(s, self.seen, run.i, run.j, flown, run.command))

    @cached_property
    def fenced(self) -> FenceRows | None:
        """The filter's rows of fences at the poses it saw; None without fences or where it is unknown."""
        if not self.run.fences or isinstance(self.seen, str):
            return None
        s = filters_own(self.s)
        made = fence_rows(s, self.seen, manoeuvre(s), s["d_safe_m"] - self.s["d_safe_m"])
        made = made.without(self.run.gone(self.run.t))
        if not self.s["remedy"]["predict_lags"]:
            return made
        return replace(made, off=made.off + BLUR_M, lie_off=made.lie_off + BLUR_M)

    @cached_property
    def fences_asked(self) -> tuple[Array, Array]:
        """The right-hand sides (T, R) of the rows of fences, margins included, and their errors."""
        made = self.fenced
        assert made is not None
        most = np.maximum(*map(np.abs, box(self.s))).sum()
        off = (
            steepness(self.s, made.h) * made.off + made.lie_off * most + 1e-13 * np.abs(alpha(self.s, made.h))
        )
        return margin(self.s, made.lie) - alpha(self.s, made.h), off

    @cached_property
    def left(self) -> tuple[Array, Array]:
        """L_g h u + alpha(h) (T, P) of the filter's rows under the commands, and its error."""
        assert self.own is not None
        u = self.run.command
        hdot, off = self.own.hdot(u[:, self.run.i], u[:, self.run.j])
        if fleet.strangers(self.s):
            hdot = self.part(0) + self.part(1)
            off = off + np.abs(self.own.lie_off).sum(axis=(0, 1)) * np.abs(np.stack(box(self.s))).max()
        steep = steepness(self.s, self.own.h) * self.own.off
        room = alpha(self.s, self.own.h)
        return hdot + room, off + steep + 1e-13 * (np.abs(room) + np.abs(hdot))

    def part(self, side: int) -> Array:
        """L_g h u (T, P) of one side's vehicle: commanded, or what the filter assumes of an intruder."""
        assert self.own is not None
        run, vehicle = self.run, (self.run.i, self.run.j)[side]
        lie = self.own.lie[side]
        told = np.einsum("ktp,tpk->tp", lie, run.command[:, vehicle])
        return np.where(fleet.under(self.s)[vehicle], told, self.assumed(side))

    def assumed(self, side: int) -> Array:
        """L_g h w (T, P) of one side's vehicle, w being what the filter assumes of intruders."""
        assert self.own is not None
        vehicle, lie = (self.run.i, self.run.j)[side], self.own.lie[side]
        if self.s.get("intruders", {}).get("assume", "keep-course") == "keep-course":
            kept = self.run.rates[:, vehicle]
            return np.asarray(lie[0] * kept[..., 0] + lie[2] * kept[..., 2])
        low, high = (corner[vehicle].T[:, None] for corner in box(self.s))
        return np.asarray(np.minimum(lie * low, lie * high).sum(axis=0))

    @cached_property
    def answered(self) -> Array:
        """(T, N) whether a vehicle's QP was solved, or it is an intruder without one."""
        return self.solved | ~fleet.under(self.s) | ~self.run.present

    @cached_property
    def solved(self) -> Array:
        return np.asarray(self.run.vehicles["qp_status"] == "solved")

    @cached_property
    def solves(self) -> bool:
        """Whether QPs stand behind the commands."""
        if "filter" in self.run.parts:
            return bool((self.run.vehicles["qp_status"] != "none").any())
        return self.s["filter"]["kind"] in SOLVING


def _differenced(s: Scenario, pose: Pose, i: Array, j: Array, flown: Flown, u: Array) -> Flown:
    """L_g h by forward differences of h over x, y, course and height, as the published figures were made.

    Only of rows that could be the tightest, were L_g h twice as large: no other is near to being the least.
    """
    made, step, low_high = future(s, i, j), s["barrier"]["gradient_step"], box(s)
    assert made is not None
    hdot, _ = flown.hdot(u[:, i], u[:, j])
    corner = np.maximum(*map(np.abs, low_high)).max(axis=0)
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
