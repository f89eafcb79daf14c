"""Checks the columns and units of a formula: known names, like compared with like."""

from __future__ import annotations

from testbed.errors import UserError, nearest, short
from testbed.requirements.formula import (
    Always,
    And,
    Arithmetic,
    ColumnName,
    Comparison,
    Eventually,
    Expression,
    Formula,
    Not,
    Number,
    Or,
    Until,
    columns,
)
from testbed.requirements.quantities import FENCE, PAIR, QUANTITIES


def check(of: Formula, text: str) -> str:
    """The unit of the formula's robustness, "" where its comparisons have several.

    Raises  UserError naming the column with its unit, and the nearest columns
    """
    where = f"requirement {short(text)!r}"
    for column in columns(of):
        _check_known(column, where)
    kinds = {QUANTITIES[c.name].of for c in columns(of)}
    if kinds >= {FENCE, PAIR}:
        raise UserError(
            f"{where}: columns of pairs and of fences in one formula; join separate formulas by and"
        )
    if not kinds:
        raise UserError(f"{where} names no column; {_nearest('')}")
    units = _units(of, where)
    return units.pop() if len(units) == 1 else ""


def _check_known(column: ColumnName, where: str) -> None:
    if column.name not in QUANTITIES:
        said = f"no column {short(column.name)!r} at letter {column.at}"
        raise UserError(f"{where}: {said}; {_nearest(column.name)}")


def _nearest(name: str) -> str:
    """The nearest columns, with their units."""
    said = nearest(name, QUANTITIES)
    if said.startswith("did you mean"):
        for close in sorted(QUANTITIES, key=len, reverse=True):
            if f" {close} " in said.replace("?", " ?") and (unit := QUANTITIES[close].unit):
                said = said.replace("?", " ?").replace(f" {close} ", f" {close} [{unit}] ").replace(" ?", "?")
        return said
    return said


def _units(of: Formula, where: str) -> set[str]:
    """The units of a formula's comparisons."""
    match of:
        case Comparison(left, right, at):
            one, other = _unit(left, where), _unit(right, where)
            _alike(one, other, left, right, at, "compared with", where)
            return {one if one is not None else other or ""}
        case Not(inner):
            return _units(inner, where)
        case Until(left, right):
            return _units(left, where) | _units(right, where)
        case And(parts) | Or(parts):
            return {unit for part in parts for unit in _units(part, where)}
        case Always(inner) | Eventually(inner):
            return _units(inner, where)


def _unit(of: Expression, where: str) -> str | None:
    """The unit of an expression; None for a plain number, and for products, whose unit has no name here."""
    match of:
        case Number():
            return None
        case ColumnName(name):
            return QUANTITIES[name].unit
        case Arithmetic(op, parts, at):
            units = [_unit(part, where) for part in parts]
            if op in ("neg", "abs"):
                return units[0]
            if op in ("+", "-"):
                _alike(
                    units[0],
                    units[1],
                    parts[0],
                    parts[1],
                    at,
                    "added to" if op == "+" else "subtracted with",
                    where,
                )
                return units[0] if units[0] is not None else units[1]
            left, right = parts
            if op == "*" and isinstance(left, Number):
                return units[1]
            return units[0] if isinstance(right, Number) else None


def _alike(
    one: str | None, other: str | None, left: Expression, right: Expression, at: int, done: str, where: str
) -> None:
    if one is None or other is None or one == other:
        return
    raise UserError(
        f"{where}: {_said(left, one)} is {done} {_said(right, other)} at letter {at}; both need one unit"
    )


def _said(of: Expression, unit: str) -> str:
    name = next((c.name for c in columns(of)), "a number")
    return f"{name} [{unit}]" if unit else f"{name} without a unit"
