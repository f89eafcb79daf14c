"""Contract: checks what one part returns and says which clause it broke."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from filters.model import Array, Command, Limits, State, View
from testbed.errors import StoppedError

# Numbers of a part beyond this mean nothing in SI units, and their squares and cubes soon overflow.
LARGEST = 1e9
STATE = ("x", "y", "theta", "z")
RATES = ("v", "omega", "zeta")
# Of an exception's own words, so many letters are quoted.
QUOTED = 300

T = TypeVar("T", State, Command)


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


def locked(values: Array) -> Array:
    """`values`, made read-only."""
    values.flags.writeable = False
    return values


def copy_of(value: T) -> T:
    """A read-only copy of a state or command."""
    return type(value).of(locked(value.array()))


def copy_of_view(view: View) -> View:
    """A read-only copy of a view."""
    known = None if view.known is None else view.known.copy()
    if known is not None:
        known.flags.writeable = False
    return View(copy_of(view.state), copy_of(view.rates), known)


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
        out = self._numbers(what, value, shape, "fiu").astype(float)
        self.check_finite(what, out)
        return locked(out)

    def channel(self, what: str, value: Any) -> Array:
        """A copy of one number per vehicle (N,); NaN is allowed, for a vehicle without the channel."""
        out = self._numbers(what, value, (self.vehicles,), "fiu").astype(float)
        self.check_finite(what, np.where(np.isnan(out), 0.0, out))
        return out

    def integers(self, what: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.int_]:
        """A copy of whole numbers of that shape."""
        return self._numbers(what, value, shape, "iu").astype(int)

    def booleans(self, what: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """A copy of truth values of that shape."""
        return self._numbers(what, value, shape, "b").astype(bool)

    def _numbers(self, what: str, value: Any, shape: tuple[int, ...], kinds: str) -> NDArray[Any]:
        found = value
        if type(found) is not np.ndarray:
            try:
                found = np.array(value, subok=False)
            except (Exception, SystemExit):
                raise self.breach(f"{what} is {_a(value)}, not an array of shape {shape}") from None
        if found.dtype.kind not in kinds:
            kind = {"b": "truth values", "iu": "whole numbers"}.get(kinds, "real numbers")
            dtype = f" of dtype {found.dtype}" if found is value else ""
            raise self.breach(f"{what} is {_a(value)}{dtype}, not an array of {kind}")
        if found.shape != shape:
            raise self.breach(f"{what} has shape {found.shape}, not {shape}")
        return found  # type: ignore[no-any-return]

    def fields(
        self, what: str, value: Any, kind: type[Any], names: tuple[str, ...], shape: tuple[int, ...]
    ) -> Array:
        """A read-only copy (*shape, fields) of a State or Command, finite or not; else as `array`."""
        if not isinstance(value, kind):
            raise self.breach(f"{what} is {_a(value)}, not a {kind.__name__}")
        out = np.empty((*shape, len(names)))
        plain = type(value) is kind  # then its attributes are just that, and are taken quickly
        for k, name in enumerate(names):
            column = value.__dict__.get(name) if plain else self.call(what, getattr, value, name, None)
            if type(column) is not np.ndarray or column.shape != shape or column.dtype.kind != "f":
                column = self._numbers(f"{what}.{name}", column, shape, "fiu")
            out[..., k] = column
        return locked(out)

    def state(self, what: str, value: Any, shape: tuple[int, ...] | None = None) -> State:
        """A read-only copy of a State (N,), or of another shape; Breach unless it is one and finite."""
        return State.of(self._finite(what, value, State, STATE, shape))

    def poses(self, what: str, value: Any) -> Array:
        """The fields of `state` (N,), as one array (N, 4)."""
        return self._finite(what, value, State, STATE, None)

    def command(self, what: str, value: Any, shape: tuple[int, ...] | None = None) -> Command:
        """A read-only copy of a Command (N,), or of another shape; Breach unless it is one and finite."""
        return Command.of(self._finite(what, value, Command, RATES, shape))

    def _finite(
        self, what: str, value: Any, kind: type[Any], names: tuple[str, ...], shape: tuple[int, ...] | None
    ) -> Array:
        out = self.fields(what, value, kind, names, shape or (self.vehicles,))
        self.check_finite(what, out, names)
        return out

    def check_finite(self, what: str, values: Array, names: tuple[str, ...] = ()) -> None:
        """Breach naming the first number that is not finite, or beyond LARGEST; `names` of the last axis."""
        if np.vdot(values, values) <= LARGEST:  # as always: a sum of squares shows all of them
            return
        with np.errstate(invalid="ignore"):
            bad = ~(np.abs(values) <= LARGEST)
        if not bad.any():
            return
        at = np.argwhere(bad)[0]
        number = values[tuple(at)]
        why = f"is {number:g}, beyond {LARGEST:g}" if np.isfinite(number) else f"is not finite: {number:g}"
        name = f"{what}.{names[at[-1]]}" if names else what
        axis = len(at) - 2 if names or len(at) > 1 else 0
        raise self.breach(f"{name} {why}, vehicle {at[axis] + 1}")


def _a(value: Any) -> str:
    """What a value is, in words."""
    if value is None:
        return "None"
    name = type(value).__name__
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"
