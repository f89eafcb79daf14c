"""Works out from a gatekeeper's record what each vehicle was committed to in every step.

Switching times are few: whoever flies what it wants has taken the longest with which its plan is clear of
those of all others, and the commands tell who had none. Where the numbers here are too near to decide, all
that may have been taken is carried on, and clearances lie in a range.
"""

from __future__ import annotations

import numpy as np

from testbed.verification.flow_claims import Lagging, margin
from testbed.verification.plans_flown import GAMMA, Asked, Plan, Plans, Way, nearest
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import box

# What steps of 5 ms may do to a decision [m]: 2e-4 has been seen.
NEAR_M = 1e-3
# Largest difference of equal commands.
SAME = 1e-9
# Plans of so many vehicles and steps are looked at together.
TOGETHER = 1200


class ContradictionError(Exception):
    """What is recorded is nothing that the filter can have done."""


def level(run: Recorded) -> float:
    """Ds + m [m]."""
    return float(run.scenario["d_safe_m"]) + margin(run)


class Decisions:
    """What each vehicle may have committed to in every step."""

    def __init__(self, run: Recorded, lagging: Lagging, switching: list[int]) -> None:
        self._run, self._switching, self._level = run, switching, level(run)
        self._n = run.scenario["vehicles"]
        low, high = box(run.scenario)
        self._wish = np.clip(run.channels("_nominal"), low, high)
        self._plans = Plans(run, lagging, switching[0], self._wish)
        self._gamma = np.clip(self._plans.gamma, low, high)
        # Who flies what it wants; who does not has committed to nothing new.
        self._took = np.abs(self._wish - run.command).max(axis=-1) <= SAME
        self._missing: set[Asked] = set()
        # Whose plans were prepared, and plans that two vehicles cannot have at the same time.
        self._ahead: set[tuple[int, int]] = set()
        self._barred: set[tuple[int, Plan, int, Plan]] = set()

    def clearances(self) -> tuple[Array, Array]:
        """(T, P) m, between what the clearance lies of what pairs were committed to before each step."""
        size = (len(self._run.t), self._run.i.size)
        low, high = np.full(size, np.inf), np.full(size, np.inf)
        held = [{GAMMA} for _ in range(self._n)]
        together = max(10, TOGETHER // self._n)
        for first in range(0, len(self._run.t), together):
            steps = range(first, min(first + together, len(self._run.t)))
            self._plans.forget()
            self._ahead.clear()
            longest = self._switching[0]
            self._missing = {(k, v, Plan(k, k + longest)) for k in steps for v in range(self._n)}
            self._missing |= {
                (k, v, Plan(k - 1, k - 1 + longest).at(k)) for k in steps[1:] for v in range(self._n)
            }
            barred = self._barred
            while self._missing:
                self._plans.fly(self._missing)
                self._missing, now, self._barred = set(), [set(plans) for plans in held], set(barred)
                for k in steps:
                    self._step(k, steps[-1], now, low[k], high[k])
            held = now
        return low, high

    def _step(self, k: int, last: int, held: list[set[Plan]], low: Array, high: Array) -> None:
        """Clearances of what is held before a step, and what is held after it."""
        n, run = self._n, self._run
        for v in range(n):
            if any(plan.end == k for plan in held[v]):
                # Now it may fly gamma for another reason than before.
                self._barred -= {bar for bar in self._barred if (v, GAMMA) in (bar[:2], bar[2:])}
            held[v] = {plan.at(k) for plan in held[v]}
        least, most = np.full((n, n), np.inf), np.full((n, n), np.inf)
        for v in range(1, n):
            least[v, :v], most[v, :v] = self._between(k, last, v, held[v], list(range(v)), held)
            least[:v, v], most[:v, v] = least[v, :v], most[v, :v]
        low[:], high[:] = least[run.i, run.j], most[run.i, run.j]
        for v in range(n):
            others = [w for w in range(n) if w != v]
            if self._took[k, v]:
                held[v] = self._taken(k, last, v, others, least[v], most[v], held)
            held[v] = {plan for plan in held[v] if self._flies(plan, k, v)}
            if not held[v]:
                raise ContradictionError(
                    f"vehicle {v + 1} flies no plan that it can have had at {run.t[k]:g} s"
                )
            least[v, others], most[v, others] = self._between(k, last, v, held[v], others, held)
            least[others, v], most[others, v] = least[v, others], most[v, others]

    def _taken(
        self, k: int, last: int, v: int, others: list[int], least: Array, most: Array, held: list[set[Plan]]
    ) -> set[Plan]:
        """What a vehicle that flies what it wants may have committed to; least and most (N,) m before."""
        found: set[Plan] = set()
        for switch in self._switching:
            tried = Plan(k, k + switch)
            low, high = self._between(k, last, v, {tried}, others, held)
            if (high + NEAR_M < np.minimum(least[others], 0.0)).any():
                continue
            found.add(tried)
            if (low - NEAR_M >= np.minimum(most[others], 0.0)).all():
                return found
            self._bar(k, v, tried, least, held)
        return found | held[v]

    def _bar(self, k: int, v: int, tried: Plan, least: Array, held: list[set[Plan]]) -> None:
        """Note which plans of others a vehicle cannot have tried this one beside."""
        for w in range(self._n):
            ways = {plan: self._plans.way((k, w, plan)) for plan in held[w]} if w != v else {}
            mine = self._plans.way((k, v, tried))
            for plan, way in ways.items():
                if mine is None or way is None:
                    continue
                off = float(nearest(mine, [way])[0]) - self._level
                if off + NEAR_M < min(least[w], 0.0):
                    self._barred |= {(v, tried, w, plan), (w, plan, v, tried)}

    def _flies(self, plan: Plan, k: int, v: int) -> bool:
        due = self._gamma[v] if plan == GAMMA else self._wish[plan.made, v]
        return bool(np.abs(due - self._run.command[k, v]).max() <= SAME)

    def _between(
        self, k: int, last: int, v: int, plans: set[Plan], others: list[int], held: list[set[Plan]]
    ) -> tuple[Array, Array]:
        """Between what clearances (K,) m lie of a vehicle with one of `plans` from others (K,) with theirs.

        They have no bounds where a way is still to be flown.
        """
        own = sorted(plans)
        mine = self._ways(k, last, v, own)
        low, high = np.full(len(others), -np.inf), np.full(len(others), np.inf)
        if mine is None:
            return low, high
        for m, w in enumerate(others):
            theirs = sorted(held[w])
            ways = self._ways(k, last, w, theirs)
            if ways is not None:
                found = np.stack([nearest(way, ways) for way in mine]) - self._level
                barred = [[(v, p, w, q) in self._barred for q in theirs] for p in own]
                if np.all(barred):
                    raise ContradictionError(
                        f"vehicles {v + 1} and {w + 1} have no plans at {self._run.t[k]:g} s"
                    )
                low[m] = np.where(barred, np.inf, found).min()
                high[m] = np.where(barred, -np.inf, found).max()
        return low, high

    def _ways(self, k: int, last: int, v: int, plans: list[Plan]) -> list[Way] | None:
        """Where plans of a vehicle lead from a step on; None, and noted, if that is to be flown yet."""
        found = [self._plans.way((k, v, plan)) for plan in plans]
        for plan in [plan for plan, way in zip(plans, found, strict=True) if way is None]:
            for later in range(k, min(last, max(k, plan.end)) + 1):
                self._missing.add((later, v, plan.at(later)))
            for later in range(k, min(last, k + self._switching[0]) + 1):
                if self._took[later, v] and (later, v) not in self._ahead:
                    self._ahead.add((later, v))
                    self._missing |= {(later, v, Plan(later, later + s)) for s in self._switching}
                    self._missing |= {
                        (later + 1, v, Plan(later, later + s).at(later + 1))
                        for s in self._switching
                        if later < last
                    }
        ways = [way for way in found if way is not None]
        return ways if len(ways) == len(found) else None
