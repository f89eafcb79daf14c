"""Defines formulas of signal temporal logic over columns of numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Number:
    value: float


@dataclass(frozen=True)
class ColumnName:
    """A column of a run; `at` is its place in the text, from 1."""

    name: str
    at: int


@dataclass(frozen=True)
class Arithmetic:
    """op is "+", "-", "*", "/" of two, or "abs" and "neg" of one."""

    op: str
    of: tuple[Expression, ...]
    at: int


Expression = Number | ColumnName | Arithmetic


@dataclass(frozen=True)
class Comparison:
    """left > right; what is written with < is turned round."""

    left: Expression
    right: Expression
    at: int


@dataclass(frozen=True)
class Not:
    of: Formula


@dataclass(frozen=True)
class And:
    of: tuple[Formula, ...]


@dataclass(frozen=True)
class Or:
    of: tuple[Formula, ...]


@dataclass(frozen=True)
class Interval:
    """From `first` to `last` s after the instant; `last` None is as far as the run can tell."""

    first: float = 0.0
    last: float | None = None


@dataclass(frozen=True)
class Always:
    of: Formula
    during: Interval


@dataclass(frozen=True)
class Eventually:
    of: Formula
    during: Interval


@dataclass(frozen=True)
class Until:
    """`right` comes to hold within the interval, and `left` holds until and when it does."""

    left: Formula
    right: Formula
    during: Interval


Formula = Comparison | Not | And | Or | Always | Eventually | Until


def columns(of: Formula | Expression) -> Iterator[ColumnName]:
    """The columns that a formula names, in order."""
    match of:
        case ColumnName():
            yield of
        case Arithmetic(of=parts) | And(of=parts) | Or(of=parts):
            for part in parts:
                yield from columns(part)
        case Comparison(left, right) | Until(left, right):
            yield from columns(left)
            yield from columns(right)
        case Not(inner) | Always(inner) | Eventually(inner):
            yield from columns(inner)


def horizon(of: Formula) -> float:
    """s, how long after an instant is looked at to decide a formula there."""
    match of:
        case Comparison():
            return 0.0
        case Not(inner):
            return horizon(inner)
        case And(parts) | Or(parts):
            return max(map(horizon, parts))
        case Always(inner, during) | Eventually(inner, during):
            return horizon(inner) + (during.first if during.last is None else during.last)
        case Until(left, right, during):
            last = during.first if during.last is None else during.last
            return last + max(horizon(left), horizon(right))


def conjuncts(of: Formula) -> tuple[Formula, ...]:
    """The parts that all have to hold, each by itself."""
    if isinstance(of, And):
        return tuple(c for part in of.of for c in conjuncts(part))
    return (of,)
