"""Subset simulation: a small probability as a product of larger ones, level by level.

A level is the value below which a tenth of the runs so far are. From those runs Markov chains are grown that
stay below it, whose runs have the distribution of the starts given that; a tenth of them gives the next
level, until the level is 0. A first simulation sets the levels; independent repetitions with the same levels,
whose products of shares are unbiased, give the estimate and its interval.
Source  Au & Beck 2001, Probabilistic Engineering Mechanics 16(4); the moves are those of Papaioannou, Betz,
        Zwirglmaier & Straub 2015, Probabilistic Engineering Mechanics 41 (adaptive conditional sampling).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.model import Array
from testbed.rare_events.estimate import Estimate, LimitState

# The share of runs whose chains go on to the next level.
SHARE = 0.1
# The acceptance that moves are adapted to, and in how many parts of a level's chains they are.
_ACCEPTANCE, _PARTS = 0.44, 10
MOST_LEVELS = 12


@dataclass(frozen=True)
class Level:
    """What one level of one repetition found: runs below `value`, of the runs of the level before."""

    value: float
    share: float
    acceptance: float


@dataclass(frozen=True)
class Repetition:
    """One subset simulation: its probability, 0 if it did not reach the event, and its runs and levels."""

    probability: float
    runs: int
    levels: tuple[Level, ...]
    reached: bool
    below: Array  # (n, d) runs with the event, of the last level

    @property
    def most(self) -> float:
        """The probability, or without the event what may have been missed: below 3 runs of the last level."""
        if self.reached:
            return self.probability
        share = float(np.prod([level.share for level in self.levels if level.share > 0.0]))
        return share * min(1.0, 3.0 * len(self.levels) / max(1, self.runs))


def estimate(
    state: LimitState,
    size: int,
    rng: np.random.Generator,
    runs_per_level: int = 200,
    repetitions: int = 10,
    confidence: float = 0.95,
) -> Estimate:
    """P(state(z) < 0) of `size` standard normal numbers.

    runs_per_level  of each repetition, 20 or more
    repetitions     independent ones, 3 or more
    The interval is that of the mean of a lognormal distribution, from the repetitions (Cox's method with
    Student's t, Olsson 2005), since what they find is a product of shares.
    """
    if runs_per_level < 20 or repetitions < 3:
        raise ValueError(f"{runs_per_level} runs a level, {repetitions} repetitions: give 20 and 3, or more")
    first, *rngs = rng.spawn(repetitions + 1)
    (pilot,) = repeated(state, size, [first], runs_per_level)
    found = repeated(state, size, rngs, runs_per_level, [level.value for level in pilot.levels])
    return joined(pilot, found, runs_per_level, confidence)


def joined(
    pilot: Repetition, found: list[Repetition], runs_per_level: int, confidence: float = 0.95
) -> Estimate:
    """The estimate that independent repetitions give together."""
    from scipy.stats import t as student

    each = np.array([r.probability for r in found])
    count, runs = len(each), pilot.runs + sum(r.runs for r in found)
    doubts = []
    method = (
        f"subset simulation, {count} repetitions of {runs_per_level} runs a level, after one that sets the"
        " levels; interval of the mean of a lognormal distribution (Cox, Student's t)"
    )
    probability = float(each.mean())
    missed = sum(not r.reached for r in found)
    if missed:
        doubts.append(
            f"{missed} of {count} repetitions did not reach the event: the probability may be 0, and the"
            " upper end is of what they may have missed"
        )
    stuck = min((level.acceptance for r in found for level in r.levels), default=1.0)
    if stuck < 0.05:
        doubts.append(
            f"chains accepted {100 * stuck:.1f} % of their moves on some level: they may not have"
            " left their first runs; give more runs a level"
        )
    logs = np.log([r.most for r in found])
    variance = float(logs.var(ddof=1))
    centre = float(logs.mean()) + 0.5 * variance
    error = np.sqrt(variance / count + 0.5 * variance**2 / (count + 1))
    wide = float(student.isf(0.5 * (1.0 - confidence), count - 1)) * error
    low, high = float(np.exp(centre - wide)), float(min(1.0, np.exp(centre + wide)))
    relative = float(each.std(ddof=1) / np.sqrt(count) / probability) if probability else np.nan
    detail = {
        "repetitions": each.tolist(),
        "levels": [level.value for level in pilot.levels],
        "acceptance": stuck,
    }
    return Estimate(
        probability, 0.0 if missed else low, high, runs, relative, confidence, method, tuple(doubts), detail
    )


def repeated(
    state: LimitState,
    size: int,
    rngs: list[np.random.Generator],
    runs_per_level: int,
    bounds_known: list[float] | None = None,
) -> list[Repetition]:
    """Independent subset simulations, one for each generator; all ask for their runs at the same time.

    bounds_known  the levels; None: each sets its own
    """
    count = len(rngs)
    z = np.stack([rng.standard_normal((runs_per_level, size)) for rng in rngs])
    values = _values(state, z)
    probability, runs = np.ones(count), np.full(count, runs_per_level)
    levels: list[list[Level]] = [[] for _ in rngs]
    acceptance, spread = np.ones(count), np.full(count, 0.6)
    going = np.ones(count, dtype=bool)
    reached = np.zeros(count, dtype=bool)
    events = [np.zeros((0, size)) for _ in rngs]
    for number in range(MOST_LEVELS):
        seeds = max(1, round(SHARE * runs_per_level))
        chosen: list[int] = []
        starts: list[tuple[Array, Array]] = []
        bounds: list[float] = []
        for r in np.flatnonzero(going).tolist():
            bound = _bound(values[r], seeds) if bounds_known is None else bounds_known[number]
            last = bound == 0.0
            below = values[r] < bound
            levels[r].append(Level(float(bound), float(below.mean()), float(acceptance[r])))
            probability[r] *= below.mean()
            if last or not below.any():
                going[r], reached[r] = False, last and bool(below.any())
                events[r] = z[r, below] if last else events[r]
                continue
            chosen.append(r)
            starts.append((z[r, below], values[r, below]))
            bounds.append(bound)
        if not chosen or (bounds_known is not None and number + 1 == len(bounds_known)):
            break
        grown = _grow(state, starts, bounds, [rngs[r] for r in chosen], spread[chosen], runs_per_level)
        for k, r in enumerate(chosen):
            z[r], values[r], acceptance[r], spread[r], new = grown[k]
            runs[r] += new
    probability[going] = 0.0
    return [
        Repetition(float(probability[r]), int(runs[r]), tuple(levels[r]), bool(reached[r]), events[r])
        for r in range(count)
    ]


def _bound(values: Array, seeds: int) -> float:
    """The next level: midway between the values that `seeds` runs are below and are not; 0 at the event."""
    low, high = np.partition(values, [seeds - 1, seeds])[[seeds - 1, seeds]]
    # Too few runs may have a value at all.
    return max(0.0, float(0.5 * (low + high) if np.isfinite(high) else low))


def _grow(
    state: LimitState,
    starts: list[tuple[Array, Array]],
    bounds: list[float],
    rngs: list[np.random.Generator],
    spreads: NDArray[np.float64],
    runs: int,
) -> list[tuple[Array, Array, float, float, int]]:
    """Per repetition: `runs` runs below its bound and their values, acceptance, spread of moves, new runs.

    The chains of all repetitions take their steps together; a step's moves are evaluated at once.
    """
    chains = []
    for start, rng, spread in zip(starts, rngs, spreads, strict=True):
        n = len(start[0])
        lengths = np.full(n, runs // n)
        lengths[rng.permutation(n)[: runs - lengths.sum()]] += 1
        chains.append(_Chains(start, lengths, rng, float(spread)))
    longest = max(int(c.lengths.max()) for c in chains)
    for step in range(longest):
        moves = [c.propose(step) for c in chains]
        values = _one(state, np.concatenate(moves))
        at = 0
        for c, m, bound in zip(chains, moves, bounds, strict=True):
            c.take(step, m, values[at : at + len(m)], bound)
            at += len(m)
    return [c.result() for c in chains]


class _Chains:
    """Markov chains of one repetition on one level."""

    def __init__(
        self, start: tuple[Array, Array], lengths: NDArray[np.int_], rng: np.random.Generator, spread: float
    ) -> None:
        self.now, self.value = start[0].copy(), start[1].copy()
        self.lengths, self.rng, self.spread = lengths, rng, spread
        self.z: list[Array] = []
        self.values: list[Array] = []
        self.new = self.accepted = 0
        self._since, self._asked = 0, 0

    def propose(self, step: int) -> Array:
        """Moves of the chains that are still to grow."""
        self.active = np.flatnonzero(self.lengths > step)
        here = self.now[self.active]
        keep = np.sqrt(1.0 - self.spread**2)
        return np.asarray(keep * here + self.spread * self.rng.standard_normal(here.shape))

    def take(self, step: int, moves: Array, values: Array, bound: float) -> None:
        """Accept the moves whose values are below the bound; the others stay where they are."""
        good = values < bound
        chosen = self.active[good]
        self.now[chosen], self.value[chosen] = moves[good], values[good]
        self.z.append(self.now[self.active].copy())
        self.values.append(self.value[self.active].copy())
        self.new += len(moves)
        self.accepted += int(good.sum())
        self._asked, self._since = self._asked + len(moves), self._since + int(good.sum())
        if self._asked >= max(1, self.lengths.sum() // _PARTS):
            part = step + 1
            scale = np.log(self.spread) + (self._since / self._asked - _ACCEPTANCE) / np.sqrt(part)
            self.spread = float(np.clip(np.exp(scale), 0.05, 1.0))
            self._asked = self._since = 0

    def result(self) -> tuple[Array, Array, float, float, int]:
        z, values = np.concatenate(self.z), np.concatenate(self.values)
        return z, values, self.accepted / max(1, self.new), self.spread, self.new


def _values(state: LimitState, z: Array) -> Array:
    """(R, n) of z (R, n, d)."""
    return _one(state, z.reshape(-1, z.shape[-1])).reshape(z.shape[:2])


def _one(state: LimitState, z: Array) -> Array:
    values = np.asarray(state(z), dtype=float)
    return np.where(np.isnan(values), np.inf, values)
