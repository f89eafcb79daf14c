"""Flies lagging vehicles on under plans: a command for some periods, then gamma.

Channels are stepped as for the flow filter's claims. What they add up to over a period is flown as one arc:
so the filters that plan do, which is right to millimetres, and their decisions hang on less than that.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from testbed.verification.flow_claims import NO_LAG_S, NO_LIMIT, TAIL, Lagging, believed, period
from testbed.verification.future import manoeuvre
from testbed.verification.recorded import Array, Recorded


@dataclass(frozen=True, order=True)
class Plan:
    """The command wanted in step `made`, flown until the step `end`, then gamma; both -1 for gamma alone."""

    made: int
    end: int

    def at(self, step: int) -> Plan:
        """What is left of it in a step."""
        return self if self.end > step else GAMMA


GAMMA = Plan(-1, -1)
# In a step, a vehicle with a plan.
Asked = tuple[int, int, Plan]


@dataclass(frozen=True)
class Way:
    """Where a plan leads: level (M,) complex m and height (M,) m, a period apart; then a circle's ends."""

    level: Array
    height: Array
    centre: complex
    arm: complex


class Plans:
    """The ways of plans from recorded states, flown on when they are asked for.

    longest  how many periods a command is flown at most
    wish     (T, N, 3) what was wanted, inside the limits
    """

    def __init__(self, run: Recorded, lagging: Lagging, longest: int, wish: Array) -> None:
        s = run.scenario
        self._run, self._lagging, self._wish, self._longest = run, lagging, wish, longest
        self._dt, self.gamma = s["rates"]["filter_dt_s"], manoeuvre(s)
        self._depth = int(np.ceil(lagging.delay.max() / self._dt + 1e-9)) + 1
        # Before the start all were told what they flew then.
        self._told = np.concatenate([np.repeat(run.rates[:1], self._depth, axis=0), run.command])
        self._rates = believed(run.rates, self._told, lagging, self._dt, s["filter"].get("trust", 1.0))
        self._periods = longest + self._settled()
        self._ways: dict[Asked, Way] = {}

    def way(self, asked: Asked) -> Way | None:
        """Where a plan leads; None if it has not been flown yet."""
        return self._ways.get(asked)

    def forget(self) -> None:
        """All ways flown so far."""
        self._ways.clear()

    def fly(self, asked: Iterable[Asked]) -> None:
        """Fly plans on, those of different vehicles and the same step together."""
        slots: dict[int, list[list[Plan]]] = {}
        for k, v, plan in sorted(set(asked) - self._ways.keys()):
            slots.setdefault(k, [[] for _ in self.gamma])[v].append(plan)
        rows = [(k, row) for k, each in slots.items() for row in range(max(map(len, each)))]
        if not rows:
            return
        plans = [[each[row] if row < len(each) else GAMMA for each in slots[k]] for k, row in rows]
        ways = self._flown(np.array([k for k, _ in rows]), plans)
        for (k, row), along in zip(rows, ways, strict=True):
            for v, each in enumerate(slots[k]):
                if row < len(each):
                    self._ways[k, v, each[row]] = along[v]

    def certain(self) -> Array:
        """Least distances (T, P) m while all that is heard was told before a step; inf if nothing was."""
        run, periods = self._run, int(np.floor(self._lagging.delay.min() / self._dt + 1e-9))
        steps = np.arange(len(run.t))
        level, height, _ = self._along(steps, self._past(steps), periods)
        i, j = run.i, run.j
        apart = np.abs(level[1:, :, i] - level[1:, :, j]) ** 2 + (height[1:, :, i] - height[1:, :, j]) ** 2
        return np.asarray(np.sqrt(apart.min(axis=0, initial=np.inf)))

    def _settled(self) -> int:
        """Periods after which every vehicle has settled on gamma, whatever of the run it was told."""
        lagging, flown = self._lagging, (self._rates, self._told, self._wish)
        gap = np.max([np.abs(x - self.gamma).max(axis=0, initial=0.0) for x in flown], axis=0)
        slowest = np.minimum(lagging.fall, lagging.rise)
        settled = 2 * lagging.delay + self._dt + 2 * gap / slowest + TAIL * lagging.constant
        return int(np.ceil(settled.max() / self._dt)) + 1

    def _past(self, steps: Array) -> Array:
        """The commands (depth, S, N, 3) told before steps (S,), the last one latest."""
        return np.stack([self._told[steps + m] for m in range(self._depth)])

    def _flown(self, steps: Array, plans: list[list[Plan]]) -> list[list[Way]]:
        """The ways of a plan (S, N) for every vehicle, from the steps (S,)."""
        gamma = self.gamma
        told = np.broadcast_to(gamma, (self._depth + self._longest + 1, len(steps), *gamma.shape)).copy()
        told[: self._depth] = self._past(steps)
        for r, k in enumerate(steps):
            for v, plan in enumerate(plans[r]):
                told[self._depth : self._depth + max(plan.end - k, 0), r, v] = self._wish[plan.made, v]
        place, height, theta = self._along(steps, told, self._periods)
        arm = -1j * gamma[:, 0] / gamma[:, 1] * np.exp(1j * theta)
        centre = place[-1] - arm
        level, height = np.moveaxis(place[1:], 0, -1), np.moveaxis(height[1:], 0, -1)
        return [
            [Way(level[r, v], height[r, v], centre[r, v], arm[r, v]) for v in range(len(gamma))]
            for r in range(len(steps))
        ]

    def _along(self, steps: Array, told: Array, periods: int) -> tuple[Array, Array, Array]:
        """Places and heights (periods + 1, S, N), from the steps (S,) on, and the last courses (S, N).

        told  (D, S, N, 3) the commands, one a period, of which the first `depth` are past
        """
        run, lagging, dt = self._run, self._lagging, self._dt
        level = run.position[steps][..., 0] + 1j * run.position[steps][..., 1]
        height, theta = run.position[steps][..., 2], run.vehicles["theta_rad"][steps]
        y, ahead = self._rates[steps], len(told) - 1 - self._depth
        at_once = (lagging.constant <= NO_LAG_S) & (np.minimum(lagging.fall, lagging.rise) >= NO_LIMIT)
        places, heights = [level], [height]
        for k in range(periods):
            y, values = period(y, told, lagging, dt, k - ahead)
            # Without a lag the whole of a step has its last value.
            mean = [np.where(at_once, b, 0.5 * (a + b)) for a, b in pairwise(values)]
            v, omega, zeta = np.moveaxis(np.mean(mean, axis=0) * dt, -1, 0)
            level = level + v * np.sinc(0.5 * omega / np.pi) * np.exp(1j * (theta + 0.5 * omega))
            theta, height = theta + omega, height + zeta
            places.append(level)
            heights.append(height)
        return np.stack(places), np.stack(heights), theta


def nearest(a: Way, others: list[Way]) -> Array:
    """The least distances (K,) m of a way from others at the same instants, for all time."""
    level, height = (np.stack([getattr(b, name) for b in others]) for name in ("level", "height"))
    centre, arm = (np.array([getattr(b, name) for b in others]) for name in ("centre", "arm"))
    early = np.abs(a.level - level) ** 2 + (a.height - height) ** 2
    turning = np.abs(np.abs(a.centre - centre) - np.abs(a.arm - arm))
    late = turning**2 + (a.height[-1] - height[:, -1]) ** 2
    return np.asarray(np.sqrt(np.minimum(early.min(axis=-1), late)))
