"""Contract: checks what one part returns and says which clause it broke."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy import ndarray, vdot
from numpy.typing import NDArray

from filters.model import Array, Command, Limits, State, View
from testbed.errors import StoppedError

# Numbers of a part beyond this mean nothing in SI units, and their squares and cubes soon overflow.
LARGEST = 1e9
FIELDS: dict[type, tuple[str, ...]] = {State: ("x", "y", "theta", "z"), Command: ("v", "omega", "zeta")}
FLOAT, WHOLE, TRUTH = np.dtype(float), np.dtype(int), np.dtype(bool)
# Up to so many numbers Python checks one by one quicker than numpy all at once.
FEW = 16
# Of an exception's own words, so many letters are quoted.
QUOTED = 300

T = TypeVar("T", State, Command)
A = TypeVar("A", bound=NDArray[Any])


class Breach(Exception):  # noqa: N818
    """A part broke its contract.

    part    plant, filter, guidance or environment
    whose   the Python name of its maker
    clause  what was broken, in words
    """

    def __init__(self, part: str, whose: str, clause: str) -> None:
        super().__init__(f"{part} {whose}: {clause}")
        self.part, self.whose, self.clause = part, whose, clause


def describe(error: BaseException) -> str:
    """The type of an exception, what it says, and the file and line that raised it, in one line."""
    try:
        said = " ".join(str(error).split())[:QUOTED]
    except Exception:  # its own __str__ fails
        said = ""
    said = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in said) or "no message"
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {said}{where}"


def locked(values: A) -> A:
    """`values`, made read-only."""
    values.setflags(False)  # type: ignore[call-arg] # by its name the argument costs as much as the flag
    return values


def copy_of(value: T) -> T:
    """A read-only copy of a state or command."""
    # Field by field: a copy and its flag cost 0.15 us, a column of a common array twice that.
    made: T = object.__new__(type(value))
    own = made.__dict__
    for name, values in value.__dict__.items():
        own[name] = copied = values.copy()
        copied.setflags(False)
    return made


def copy_of_view(view: View) -> View:
    """A read-only copy of a view."""
    made = object.__new__(View)  # a frozen type's own way costs as much as the copies
    own = made.__dict__
    own["state"], own["rates"] = copy_of(view.state), copy_of(view.rates)
    own["known"] = None if view.known is None else locked(view.known.copy())
    return made


def copy_of_limits(limits: Limits) -> Limits:
    """A read-only copy of the limits."""
    return Limits.of(locked(limits.array()))


class Contract:
    """The requirements on one part; every breach names the part."""

    def __init__(self, part: str, whose: str, vehicles: int) -> None:
        self.part, self.whose, self.vehicles = part, whose, vehicles

    def breach(self, clause: str) -> Breach:
        """The exception to raise for this clause."""
        return Breach(self.part, self.whose, clause)

    def call(self, what: str, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """Call the part. Raises Breach for whatever it raises, but an interrupt."""
        try:
            return function(*arguments, **named)
        except (
            KeyboardInterrupt,
            StoppedError,
        ):  # from the keyboard, or a signal that asks the program to end
            raise
        except BaseException as error:
            raise self.breach(f"{what} raised {describe(error)}") from error

    def method(self, thing: Any, name: str, what: str = "it") -> Callable[..., Any]:
        """The method of that name, of the part or of what it has. Raises Breach if there is none."""
        whose = "its" if what == "it" else f"{what}'s"
        found: Any = self.call(f"{whose} attribute {name}", getattr, thing, name, None)
        if not callable(found):
            raise self.breach(f"{what} has no method {name}()")
        return found  # type: ignore[no-any-return]

    def array(self, what: str, value: Any, shape: tuple[int, ...]) -> Array:
        """A read-only copy of numbers; Breach unless of that shape, real, finite and below LARGEST."""
        if type(value) is ndarray and value.dtype is FLOAT and value.shape == shape:  # as always
            out: Array = value.copy()
        else:
            out = self._floats(what, value, shape)
        if out.size > FEW:
            # A sum of squares shows at once that all are finite and small; vdot does not warn of overflow.
            if not vdot(out, out) <= LARGEST:
                self._check_each(what, out)
        else:
            for number in out.ravel().tolist():
                if not -LARGEST <= number <= LARGEST:
                    self._check_each(what, out)
        out.setflags(False)  # type: ignore[call-arg]
        return out

    def channel(self, what: str, value: Any) -> Array:
        """A copy of one number per vehicle (N,); NaN is allowed, for a vehicle without the channel."""
        out = self._floats(what, value, (self.vehicles,))
        self._check_each(what, np.where(np.isnan(out), 0.0, out))
        return out

    def integers(self, what: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.int_]:
        """A copy of whole numbers of that shape."""
        if type(value) is ndarray and value.dtype is WHOLE and value.shape == shape:
            return value.copy()
        return self._numbers(what, value, shape, "iu").astype(int)

    def booleans(self, what: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """A copy of truth values of that shape."""
        if type(value) is ndarray and value.dtype is TRUTH and value.shape == shape:
            return value.copy()
        return self._numbers(what, value, shape, "b").astype(bool)

    def _floats(self, what: str, value: Any, shape: tuple[int, ...]) -> Array:
        return self._numbers(what, value, shape, "fiu").astype(float)

    def _numbers(self, what: str, value: Any, shape: tuple[int, ...], kinds: str) -> NDArray[Any]:
        found = value
        if type(found) is not np.ndarray:
            try:
                found = np.array(value)
            except (Exception, SystemExit):
                raise self.breach(f"{what} is {_a(value)}, not an array of shape {shape}") from None
        if found.dtype.kind not in kinds:
            kind = {"b": "truth values", "iu": "whole numbers"}.get(kinds, "real numbers")
            dtype = f" of dtype {found.dtype}" if found is value else ""
            raise self.breach(f"{what} is {_a(value)}{dtype}, not an array of {kind}")
        if found.shape != shape:
            raise self.breach(f"{what} has shape {found.shape}, not {shape}")
        return found  # type: ignore[no-any-return]

    def fields(self, what: str, value: Any, kind: type[T], shape: tuple[int, ...]) -> tuple[T, bool]:
        """A read-only copy of a State or Command, and whether all is finite and at most LARGEST.

        False may also mean that very many numbers are large: `check_finite` finds out.
        """
        if not isinstance(value, kind):
            raise self.breach(f"{what} is {_a(value)}, not a {kind.__name__}")
        plain = type(value) is kind  # then its attributes are just that, and are taken quickly
        said, fine = value.__dict__, True
        made = object.__new__(kind)
        own = made.__dict__
        for name in FIELDS[kind]:
            column = said.get(name) if plain else self.call(what, getattr, value, name, None)
            if type(column) is ndarray and column.dtype is FLOAT and column.shape == shape:
                column = column.copy()
            else:
                column = self._floats(f"{what}.{name}", column, shape)
            column.setflags(False)  # type: ignore[call-arg]
            own[name] = column
            if column.size > FEW:  # as in `array`
                fine = fine and bool(vdot(column, column) <= LARGEST)
            else:
                for number in column.ravel().tolist():
                    if not -LARGEST <= number <= LARGEST:
                        fine = False
        return made, fine

    def state(self, what: str, value: Any, shape: tuple[int, ...] | None = None) -> State:
        """A read-only copy of a State (N,), or of another shape; Breach unless it is one and finite."""
        out, fine = self.fields(what, value, State, shape or (self.vehicles,))
        if not fine:
            self.check_finite(what, out)
        return out

    def command(self, what: str, value: Any, shape: tuple[int, ...] | None = None) -> Command:
        """A read-only copy of a Command (N,), or of another shape; Breach unless it is one and finite."""
        out, fine = self.fields(what, value, Command, shape or (self.vehicles,))
        if not fine:
            self.check_finite(what, out)
        return out

    def check_finite(self, what: str, value: State | Command) -> None:
        """Breach naming the first number of a state or command that is not finite, or beyond LARGEST."""
        self._check_each(what, value.array(), FIELDS[type(value)])

    def _check_each(self, what: str, values: Array, names: tuple[str, ...] = ()) -> None:
        """Breach naming the first number that is not finite, or beyond LARGEST; `names` of the last axis."""
        with np.errstate(invalid="ignore"):
            bad = ~(np.abs(values) <= LARGEST)
        if not bad.any():
            return
        at = np.argwhere(bad)[0]
        number = values[tuple(at)]
        why = f"is {number:g}, beyond {LARGEST:g}" if np.isfinite(number) else f"is not finite: {number:g}"
        name = f"{what}.{names[at[-1]]}" if names else what
        vehicle = at[max(len(at) - 2, 0)] + 1
        raise self.breach(f"{name} {why}, vehicle {vehicle}")


def _a(value: Any) -> str:
    """What a value is, in words."""
    if value is None:
        return "None"
    name = type(value).__name__
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"
