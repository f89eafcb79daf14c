"""Computes how robustly signals meet a formula of signal temporal logic, exactly for signals in steps.

A signal keeps the value of a sample until the next one. Robustness is that of Donze and Maler (2010): the
distance of a comparison's sides, the least of `and`, the largest of `or`, the least or largest over the
times of a temporal operator, whose intervals are closed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from filters.model import Array
from testbed.requirements.formula import (
    Always,
    And,
    Arithmetic,
    ColumnName,
    Comparison,
    Eventually,
    Expression,
    Formula,
    Interval,
    Not,
    Number,
    Or,
    Until,
    horizon,
)

# Two instants are one within this [s]: sums of times are exact to less.
TIME_S = 1e-9


@dataclass(frozen=True, eq=False)
class Steps:
    """Signals in steps: t (K,) increasing from 0, and values (K, E) from then on."""

    t: Array
    values: Array

    def places(self, t: Array) -> np.ndarray:
        """Which step holds at times t."""
        return np.maximum(np.searchsorted(self.t, t + TIME_S, side="right") - 1, 0)

    def at(self, t: Array) -> Array:
        return np.asarray(self.values[self.places(t)])


@dataclass(frozen=True, eq=False)
class Signals:
    """What a formula is evaluated on.

    t       (T,) s, sample times from 0
    values  column -> (T, E), one signal for each of E vehicles or pairs
    end     s, how long the run is planned to be
    beyond  robustness of a comparison after the last sample, where the run ended before `end`: +inf and -inf
            bound what would have been
    """

    t: Array
    values: Mapping[str, Array]
    end: float
    beyond: float = np.inf

    @property
    def last(self) -> float:
        return float(self.t[-1])


def robustness(of: Formula, signals: Signals) -> Array:
    """(E,) at the begin. Raises ValueError if the run is planned shorter than the formula looks."""
    if horizon(of) > signals.end + TIME_S:
        raise ValueError(f"looks {horizon(of):g} s ahead, and the run is {signals.end:g} s long")
    return np.asarray(_steps(of, signals, 0.0, signals.beyond).values[0])


def _steps(of: Formula, s: Signals, need: float, beyond: float) -> Steps:
    """The robustness from 0 to `need` s."""
    match of:
        case Comparison(left, right):
            return _compared(_number(left, s) - _number(right, s), s, need, beyond)
        case Not(inner):
            made = _steps(inner, s, need, -beyond)
            return Steps(made.t, -made.values)
        case And(parts):
            return _together([_steps(part, s, need, beyond) for part in parts], np.minimum)
        case Or(parts):
            return _together([_steps(part, s, need, beyond) for part in parts], np.maximum)
        case Always(inner, during):
            made, span = _steps(inner, s, *_ahead(during, s, need, beyond, inner)), _Span.of(during, s, inner)
            return _window(made, span, need, np.minimum)
        case Eventually(inner, during):
            made, span = _steps(inner, s, *_ahead(during, s, need, beyond, inner)), _Span.of(during, s, inner)
            return _window(made, span, need, np.maximum)
        case Until(left, right, during):
            ahead = _ahead(during, s, need, beyond, left, right)
            one, other = _shared([_steps(left, s, *ahead), _steps(right, s, *ahead)])
            return _kept_until(one, other, _Span.of(during, s, left, right), need)


@dataclass(frozen=True)
class _Span:
    """An interval's times at an instant t: from t + first to t + last, or to `end` where last is None."""

    first: float
    last: float | None
    end: float

    @classmethod
    def of(cls, during: Interval, s: Signals, *inner: Formula) -> _Span:
        """An interval without a last time goes as far as its formulas can be told in the run."""
        return cls(during.first, during.last, s.end - max(map(horizon, inner)))

    def places(self, steps: Steps, t: Array) -> tuple[np.ndarray, np.ndarray]:
        """First and last of the steps that hold within the interval at instants t."""
        last = np.full_like(t, self.end) if self.last is None else t + self.last
        return steps.places(t + self.first), steps.places(last)

    def changes(self, steps: Steps, need: float) -> Array:
        """The instants from 0 to `need` at which what the interval holds changes."""
        found = [np.zeros(1), steps.t - self.first]
        if self.last is not None:
            found.append(steps.t - self.last)
        t = np.unique(np.concatenate(found))
        t = t[(t >= 0.0) & (t <= need + TIME_S)]
        return np.asarray(t[np.concatenate([[True], np.diff(t) > TIME_S])])


def _ahead(during: Interval, s: Signals, need: float, beyond: float, *inner: Formula) -> tuple[float, float]:
    """How far the formulas within an interval are needed [s], and `beyond`."""
    if during.last is None:
        return s.end - max(map(horizon, inner)), beyond
    return need + during.last, beyond


def _compared(difference: Array, s: Signals, need: float, beyond: float) -> Steps:
    # A comparison of two numbers is one signal that stays.
    values = difference if difference.ndim else np.full((len(s.t), 1), difference)
    known = s.t <= need + TIME_S
    t, values = s.t[known], values[known]
    if need > s.last + TIME_S:
        t = np.append(t, s.last + 4 * TIME_S)
        values = np.vstack([values, np.full((1, values.shape[1]), beyond)])
    return Steps(t, values)


def _shared(made: Sequence[Steps]) -> list[Steps]:
    """The same signals with the steps of all."""
    t = np.unique(np.concatenate([m.t for m in made]))
    t = t[np.concatenate([[True], np.diff(t) > TIME_S])]
    return [Steps(t, m.at(t)) for m in made]


def _together(made: Sequence[Steps], pick: np.ufunc) -> Steps:
    shared = _shared(made)
    values = shared[0].values
    for other in shared[1:]:
        values = pick(values, other.values)
    return Steps(shared[0].t, values)


def _window(steps: Steps, span: _Span, need: float, pick: np.ufunc) -> Steps:
    """The least or largest over the interval at every instant."""
    t = span.changes(steps, need)
    first, last = span.places(steps, t)
    empty = last < first
    values = _over(steps.values, first, np.maximum(first, last), pick)
    values[empty] = np.inf if pick is np.minimum else -np.inf
    return Steps(t, values)


def _over(values: Array, first: np.ndarray, last: np.ndarray, pick: np.ufunc) -> Array:
    """Of values (K, E): the least or largest of those from first to last (M,), (M, E)."""
    if len(first) <= 4:
        return np.stack([pick.reduce(values[a : b + 1]) for a, b in zip(first, last, strict=True)])
    # Runs of 1, 2, 4, ... values; two of them cover any run.
    power = np.floor(np.log2(last - first + 1)).astype(int)
    found = np.empty((len(first), values.shape[1]))
    run = values
    for k in range(int(power.max()) + 1):
        here = power == k
        found[here] = pick(run[first[here]], run[last[here] - 2**k + 1])
        run = pick(run[: -(2**k)], run[2**k :]) if len(run) > 2**k else run
    return found


def _kept_until(left: Steps, right: Steps, span: _Span, need: float) -> Steps:
    t = span.changes(left, need)
    # What `left` has held since t changes where a step begins.
    t = np.unique(np.concatenate([t, left.t[left.t <= need + TIME_S]]))
    now, (first, last) = left.places(t), span.places(left, t)
    rows = []
    for k, a, b in zip(now, first, last, strict=True):
        kept = np.minimum.accumulate(left.values[k : b + 1], axis=0)
        both = np.minimum(right.values[a : b + 1], kept[a - k :])
        rows.append(both.max(axis=0) if len(both) else np.full(left.values.shape[1], -np.inf))
    return Steps(t, np.stack(rows))


def _number(of: Expression, s: Signals) -> Array:
    match of:
        case Number(value):
            return np.array(value)
        case ColumnName(name):
            return np.asarray(s.values[name], dtype=float)
        case Arithmetic(op, parts):
            numbers = [_number(part, s) for part in parts]
            with np.errstate(divide="ignore", invalid="ignore"):
                match op:
                    case "neg":
                        return -numbers[0]
                    case "abs":
                        return np.abs(numbers[0])
                    case "+":
                        return numbers[0] + numbers[1]
                    case "-":
                        return numbers[0] - numbers[1]
                    case "*":
                        return numbers[0] * numbers[1]
                    case _:
                        return np.asarray(numbers[0] / numbers[1])
