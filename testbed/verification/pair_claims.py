"""Checks G2, G3, G4a, P5 and P6 from h and L_g h of every pair at the true poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from testbed.claims import registry
from testbed.claims.registry import Claim
from testbed.records.verdict import Status
from testbed.verification import fleet
from testbed.verification.departed import FAR, told
from testbed.verification.finding import Finding, Judge, Values
from testbed.verification.future import Flown, Pose, fly_on, manoeuvre
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import Scenario, alpha, arc, box, inside, steepness

# As the verdicts allow: round-off of h, and curvature within a filter period [m/s].
H_ALLOWED, RATE_ALLOWED = 1e-9, 1e-3
# |h| below which a pair is at the boundary, and the least |L_g h| there that is not zero.
EDGE, LEAST_GRADIENT = 0.05, 1e-9
SOLVING = ("centralised", "limited")
OF_PAIRS = (
    registry.GRADIENT,
    registry.OFF_THE_KINK,
    registry.SAFE_SET,
    registry.BARRIER_CONDITION,
    registry.ZCBF_CONDITION,
)


@dataclass(frozen=True)
class Pairs:
    """h and L_g h of every pair at every recorded instant, flown on from the true poses.

    now  (T, P)
    """

    run: Recorded
    now: Flown

    @property
    def who(self) -> list[list[int]]:
        """Vehicles of each pair, from 1."""
        return [[int(a) + 1, int(b) + 1] for a, b in zip(self.run.i, self.run.j, strict=True)]

    @property
    def s(self) -> Scenario:
        return self.run.scenario

    @cached_property
    def alpha(self) -> Array:
        """alpha(h) (T, P)."""
        return alpha(self.s, self.now.h)

    @cached_property
    def alpha_off(self) -> Array:
        return steepness(self.s, self.now.h) * self.now.off + 1e-14 * np.abs(self.alpha)

    @cached_property
    def reach(self) -> tuple[Array, Array, Array]:
        """Least and most (T, P) that L_g h u can be within the limits, and their error."""
        low, high = box(self.s)
        least, most, off = np.zeros((3, *self.now.h.shape))
        for side in range(2):
            for k in range(3):
                bottom, top = (corner[(self.run.i, self.run.j)[side], k] for corner in (low, high))
                a, b = self.now.lie[side, k] * bottom, self.now.lie[side, k] * top
                least, most = least + np.minimum(a, b), most + np.maximum(a, b)
                off = off + self.now.lie_off[side, k] * np.maximum(np.abs(bottom), np.abs(top))
        return least, most, off

    @cached_property
    def after(self) -> tuple[Flown | None, slice, bool]:
        """h one filter period after instants, which instants, and whether that is exact.

        Recorded if every step is; else flown from there as commanded, exactly on a unicycle.
        """
        run = self.run
        if run.complete:
            n = self.now
            late = Flown(n.h[1:], n.lie[:, :, 1:], n.off[1:], n.lie_off[:, :, 1:], None)
            return late, slice(0, len(run.t) - 1), True
        # Nothing was flown after the last instant of a run.
        some = slice(0, len(run.t) - 1)
        if not unicycle(run):
            return None, some, False
        here = Pose(run.position[some], run.vehicles["theta_rad"][some])
        there = arc(here, run.command[some], self.s["rates"]["filter_dt_s"])
        return fly_on(self.s, there, run.i, run.j), some, True

    def among(self, kind: str) -> Pairs:
        """Of a kind of pairs alone, see `fleet.which`; all where there are no intruders."""
        if not fleet.strangers(self.s):
            return self
        some = fleet.which(self.run, kind)
        return Pairs(fleet.among(self.run, some), self.now.among(some))

    def findings(self) -> Iterator[Finding]:
        """Pairs beside intruders count where a claim is about what happens, not about the theorems."""
        if fleet.strangers(self.s):
            yield from self.among("ours").looked_at((registry.GRADIENT, registry.OFF_THE_KINK))
            yield from self.among("judged").looked_at((registry.SAFE_SET, registry.BARRIER_CONDITION))
            yield from self.among("ours").looked_at((registry.ZCBF_CONDITION,))
        else:
            yield from self.looked_at(OF_PAIRS)

    def looked_at(self, claims: Sequence[Claim]) -> Iterator[Finding]:
        """What we find of some of the claims `OF_PAIRS`."""
        for claim, look in (
            (registry.GRADIENT, self._gradient),
            (registry.OFF_THE_KINK, self._kink),
            (registry.SAFE_SET, self._invariance),
            (registry.BARRIER_CONDITION, self._condition),
            (registry.ZCBF_CONDITION, self._admissible),
        ):
            if claim in claims and claim.id in self.run.guarantees:
                yield (look if self.run.i.size else _none)(Judge(self.run, self.run.guarantees[claim.id]))

    def _unseen(self, floor: float) -> float | None:
        """The floor of what was not recorded; None if all was."""
        return None if self.run.complete else floor

    def _invariance(self, judge: Judge) -> Finding:
        unsafe = bool(self.now.h[0].min() < -H_ALLOWED)
        off, floor = self.now.off + H_ALLOWED, self._unseen(self.lowest)
        seen = Values.of(self.run.t, self.now.h, off, self.who, floor=floor)
        return judge.least(seen, -H_ALLOWED, lambda h: h >= -H_ALLOWED, void=unsafe)

    @cached_property
    def pace(self) -> Array:
        """(T, P): the most that h changes in a second at the rates seen or allowed."""
        low, high = box(self.s)
        rates = self.run.rates.reshape(-1, 3)
        allowed = np.maximum(np.abs(low), np.abs(high)).max(axis=0)
        most = np.maximum(allowed, np.abs(rates).max(axis=0))
        lie = np.abs(self.now.lie)
        return np.asarray(np.einsum("sktp,k->tp", lie, most))

    @cached_property
    def lowest(self) -> float:
        """What h may come down to between recorded instants, at the pace of either."""
        h, period = self.now.h, self.s["rates"]["record_dt_s"]
        pace = np.maximum(self.pace[1:], self.pace[:-1])
        between = 0.5 * (h[1:] + h[:-1] - pace * period)
        tail = h[-1] - self.pace[-1] * period
        return float(min(between.min(initial=np.inf), tail.min()))

    def _condition(self, judge: Judge) -> Finding:
        then, some, _ = self.after
        dt = self.s["rates"]["filter_dt_s"]
        lowest = self.lowest
        floor = float((-1.2 * self.pace + alpha(self.s, np.minimum(self.now.h, lowest))).min())
        if then is None:
            # What the table says of it, whose h is ours.
            value = self.run.pairs["hdot_realised_mps"][some] + self.alpha[some]
            if self.run.near is not None:
                value = np.where(self.run.near[some], value, FAR)
            off = self.alpha_off[some] + 1e-6
        else:
            value = (then.h - self.now.h[some]) / dt + self.alpha[some]
            off = (then.off + self.now.off[some] + H_ALLOWED) / dt + self.alpha_off[some]
        value = told(self.run, value, np.full(value.shape, FAR), ahead=True)
        seen = Values.of(self.run.t[some], value, off, self.who, floor=self._unseen(floor))
        return judge.least(seen, -RATE_ALLOWED, lambda x: x >= -RATE_ALLOWED, empty=Status.PREMISE_NOT_MET)

    def _admissible(self, judge: Judge) -> Finding:
        _, most, off = self.reach
        # Theorem 2: gamma is an input that lets h not fall, where the limits allow it.
        b = self.s["barrier"]
        theorem = not b.get("pairs") and b["kind"] in ("turn", "straight")
        theorem = theorem and inside(manoeuvre(self.s), *box(self.s)).min() >= 0.0
        seen = Values.of(
            self.run.t,
            self.alpha + most,
            self.alpha_off + off + H_ALLOWED,
            self.who,
            self.now.h >= 0.0,
            np.abs(self.now.h) <= self.now.off + H_ALLOWED,
            self._unseen(-H_ALLOWED if theorem else -np.inf),
        )
        return judge.least(seen, -H_ALLOWED, lambda x: x >= -H_ALLOWED, empty=Status.PREMISE_NOT_MET)

    def _gradient(self, judge: Judge) -> Finding:
        lie = self.now.lie
        size = np.sqrt((lie**2).sum(axis=(0, 1)))
        off = np.sqrt((self.now.lie_off**2).sum(axis=(0, 1)))
        h, h_off = np.abs(self.now.h), self.now.off + H_ALLOWED
        # Where no pair can have come to the boundary in between, nothing is missing.
        unseen = None if self.run.complete or self.lowest > EDGE else 0.0
        near, doubt = h <= EDGE, np.abs(h - EDGE) <= h_off
        seen = Values.of(self.run.t, size, off, self.who, near, doubt, unseen)
        return judge.least(seen, LEAST_GRADIENT, lambda x: x > LEAST_GRADIENT, fails=Status.PREMISE_NOT_MET)

    def _kink(self, judge: Judge) -> Finding:
        s, z, b = self.s, self.now.harmonic, self.s["barrier"]
        if b["kind"] != "turn" or b.get("pairs") or s["filter"]["kind"] not in SOLVING:
            return judge.nothing("no kink, or nothing binds")
        if b["smoothing_m2"] > 0:
            return judge.nothing("smoothed", judge.verdict(True))
        assert z is not None
        before = self._before(z)
        if before is None:
            missing = np.full((0, len(self.who)), np.inf)
            seen = Values.of(np.zeros(0), missing, 0.0, self.who, floor=0.0)
            return judge.least(seen, 1.0, lambda x: x >= 1.0, fails=Status.PREMISE_NOT_MET)
        moved = np.maximum(np.abs(z[1:] - before), 1e-12)
        steps = np.abs(z[1:]) / moved
        # A harmonic is as wrong as the squares it comes of, which h was corrected by.
        wrong = self._square_off()[1:]
        off = steps * wrong * (2.0 / moved + 1.0 / np.maximum(np.abs(z[1:]), wrong))
        least, _, least_off = self.reach
        binds = self.alpha[1:] + least[1:]
        doubt = np.abs(binds) <= self.alpha_off[1:] + least_off[1:]
        seen = Values.of(self.run.t[1:], steps, off, self.who, binds < 0.0, doubt, self._unseen(0.0))
        return judge.least(seen, 1.0, lambda x: x >= 1.0, fails=Status.PREMISE_NOT_MET)

    def _square_off(self) -> Array:
        """Round-off of squared ranges (T, P) [m^2]."""
        if self.s["barrier"]["form"] == "squared":
            return self.now.off
        return self.now.off * 2.0 * np.maximum(self.now.h + self.s["d_safe_m"], 0.1 * self.s["d_safe_m"])

    def _before(self, z: Array) -> Array | None:
        """The harmonic one filter period before all instants but the first (T - 1, P)."""
        run = self.run
        if run.complete:
            return z[:-1]
        if not unicycle(run):
            return None
        here = Pose(run.position[1:], run.vehicles["theta_rad"][1:])
        flown = fly_on(self.s, arc(here, run.rates[1:], -self.s["rates"]["filter_dt_s"]), run.i, run.j)
        return None if flown is None else flown.harmonic


def _none(judge: Judge) -> Finding:
    """Of no pair under the filter nothing is said, but that a smoothed barrier has no kink."""
    s, b = judge.run.scenario, judge.run.scenario["barrier"]
    turns = b["kind"] == "turn" and b["smoothing_m2"] > 0 and s["filter"]["kind"] in SOLVING
    if turns and judge.entry["id"] == registry.OFF_THE_KINK.id:
        return judge.nothing("smoothed", judge.verdict(True))
    return judge.nothing("nobody else")


def unicycle(run: Recorded) -> bool:
    """Whether vehicles flew exactly what they were told."""
    return bool(run.scenario["plant"] == "unicycle" and "plant" not in run.parts)
