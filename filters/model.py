"""Defines state, command, limits and view of the vehicles as arrays, and the exact unicycle motion.

Everything is SI and east-north-up: `theta` is the course, counter-clockwise from east, `v` the horizontal
ground speed, `omega` the course rate, `zeta` the climb rate (Squires et al. 2022, eq. (2)).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_FLOAT = np.dtype(np.float64)


def _real(values: ArrayLike) -> Array:
    """`values` as floats. Raises TypeError for complex numbers, text, times and masked entries."""
    found = np.asarray(values)
    if found.dtype.kind not in "fiubO":
        raise TypeError(f"these must be real numbers, not of dtype {found.dtype}")
    if np.ma.is_masked(values):
        raise TypeError("these must be real numbers, and some are masked")
    return np.asarray(found, dtype=float)


class _Arrays:
    """Fields that are float arrays of one common shape, `(N,)` or, in a View, `(observers, N)`."""

    _names: ClassVar[tuple[str, ...]]

    def __init_subclass__(cls) -> None:
        cls._names = tuple(cls.__annotations__)

    def __post_init__(self) -> None:
        values = [self.__dict__[name] for name in self._names]
        shape = getattr(values[0], "shape", None)
        # Nearly always the fields are arrays of one shape already, and this is on every hot path.
        for v in values:
            if type(v) is not np.ndarray or v.dtype is not _FLOAT or v.shape != shape:
                break
        else:
            return self._check()
        arrays = np.broadcast_arrays(*(_real(v) for v in values))
        self.__dict__.update(zip(self._names, arrays, strict=True))
        self._check()

    def _check(self) -> None:
        """Raises ValueError for fields that mean nothing."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape common to all fields: (N,), or (observers, N) in a View."""
        return self.__dict__[self._names[0]].shape  # type: ignore[no-any-return]

    def __len__(self) -> int:
        return self.__dict__[self._names[0]].shape[-1]  # type: ignore[no-any-return]

    def __getitem__(self, index: Any) -> Self:
        """The same fields at `index` of every array: `state[[0, 2]]`, `state[..., i]`."""
        return type(self)(*(getattr(self, name)[index] for name in self._names))

    def array(self) -> Array:
        """The fields stacked along a new last axis, in the order they are declared; a copy."""
        out = np.empty((*self.shape, len(self._names)))
        for k, name in enumerate(self._names):
            out[..., k] = self.__dict__[name]
        return out

    @classmethod
    def of(cls, values: ArrayLike) -> Self:
        """The inverse of `array`: the last axis holds the fields in the order they are declared."""
        if type(values) is not np.ndarray or values.dtype is not _FLOAT:
            values = _real(values)
        made = object.__new__(cls)  # slices of one array need no broadcasting
        for k, name in enumerate(cls._names):
            made.__dict__[name] = values[..., k]
        made._check()
        return made

    def isfinite(self) -> NDArray[np.bool_]:
        """True where every field is finite, of the fields' shape."""
        return np.asarray(np.isfinite(self.array()).all(axis=-1))


@dataclass(frozen=True, eq=False)
class State(_Arrays):
    """Where vehicles are and where they go: x, y [m] east and north, theta [rad] course, z [m] up.

    The order of the fields is that of the paper's x_i, so column k of a gradient is the k-th field.
    """

    x: Array
    y: Array
    theta: Array
    z: Array

    @property
    def position(self) -> Array:
        """(..., 3) m: x, y, z along a new last axis; a copy."""
        return np.stack([self.x, self.y, self.z], axis=-1)


@dataclass(frozen=True, eq=False)
class Command(_Arrays):
    """v [m/s] ground speed, omega [rad/s] course rate, zeta [m/s] climb rate: asked for, or achieved."""

    v: Array
    omega: Array
    zeta: Array


@dataclass(frozen=True, eq=False)
class Limits(_Arrays):
    """The input set U: v in [v_min, v_max] m/s, |omega| <= omega_max rad/s, |zeta| <= zeta_max m/s."""

    v_min: Array
    v_max: Array
    omega_max: Array
    zeta_max: Array

    def _check(self) -> None:
        if not np.all(self.isfinite()):
            raise ValueError(f"limits must be finite, got {self}")
        if not np.all((self.v_min > 0) & (self.v_min <= self.v_max)):
            raise ValueError(f"limits need 0 < v_min <= v_max, got v_min {self.v_min}, v_max {self.v_max}")
        if not np.all((self.omega_max >= 0) & (self.zeta_max >= 0)):
            raise ValueError("limits need omega_max >= 0 and zeta_max >= 0")

    @property
    def lower(self) -> Command:
        return Command(self.v_min, -self.omega_max, -self.zeta_max)

    @property
    def upper(self) -> Command:
        return Command(self.v_max, self.omega_max, self.zeta_max)

    @cached_property
    def corners(self) -> tuple[Array, Array]:
        """`lower` and `upper` as arrays (..., 3); read-only."""
        low, high = self.lower.array(), self.upper.array()
        low.flags.writeable = high.flags.writeable = False
        return low, high

    def clip(self, command: Command) -> Command:
        """The point of U nearest to `command` (the box projection)."""
        return Command(
            np.clip(command.v, self.v_min, self.v_max),
            np.clip(command.omega, -self.omega_max, self.omega_max),
            np.clip(command.zeta, -self.zeta_max, self.zeta_max),
        )

    def contains(self, command: Command, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """True where `command` lies in U, within `tolerance` in each field's own unit; NaN is outside."""
        c = command.array()
        inside = (c >= self.lower.array() - tolerance) & (c <= self.upper.array() + tolerance)
        return np.asarray(np.all(inside, axis=-1))


def step(state: State, command: Command, dt: float | Array) -> State:
    """Fly `command` for `dt` seconds: the exact arc of eq. (2), smooth through omega = 0.

    state    (N,) or (observers, N)  m, rad
    command  the same shape
    Returns the state after dt; theta is not wrapped, so it counts turns.
    """
    half = 0.5 * command.omega * dt
    chord = command.v * dt * np.sinc(half / np.pi)
    return State(
        state.x + chord * np.cos(state.theta + half),
        state.y + chord * np.sin(state.theta + half),
        state.theta + command.omega * dt,
        state.z + command.zeta * dt,
    )


@dataclass(frozen=True, eq=False)
class View:
    """What the vehicles know of each other: poses, the rates achieved lately, and of whom they know.

    Arrays are `[vehicle]` when all observers see the same (the truth, without disturbances), and
    `[observer, vehicle]` when latency, loss or noise give every vehicle its own version of the world.
    known  bool, (N,): who is known to the others, and knows of them; or (N, N): whom each observer knows,
           itself included. None: everybody is known. The pose of one who is not known is a finite number
           without meaning, which a filter must not use
    age    (N, N) s: how long ago each vehicle sent what an observer has of it; None: nothing is late
    """

    state: State
    rates: Command
    known: NDArray[np.bool_] | None = None
    age: Array | None = None

    @property
    def shared(self) -> bool:
        """True when every observer sees the same poses."""
        return len(self.state.shape) == 1

    def of(self, observer: int) -> View:
        """What one vehicle sees, arrays `[vehicle]`."""
        known = self.known if self.known is None or self.known.ndim == 1 else self.known[observer]
        if self.shared:
            return self if known is self.known else View(self.state, self.rates, known)
        return View(self.state[observer], self.rates[observer], known)

    def own(self) -> View:
        """What every vehicle knows of itself, poses and rates `[vehicle]`: the diagonal."""
        if self.shared:
            return self
        n = np.arange(len(self.state))
        return View(self.state[n, n], self.rates[n, n], self.known)

    def altered(self, state: State, rates: Command) -> View:
        """The same vehicles known, with other poses and rates."""
        return View(state, rates, self.known, self.age)

    def knows(self, observer: NDArray[np.intp], vehicle: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether each observer knows of each vehicle, both from 0 and of one shape."""
        if self.known is None:
            return np.ones(np.broadcast_shapes(np.shape(observer), np.shape(vehicle)), dtype=bool)
        if self.known.ndim == 1:
            return self.known[observer] & self.known[vehicle]
        return np.asarray(self.known[observer, vehicle])

    def joined(self, i: NDArray[np.intp], j: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether at least one of the vehicles i and j knows of the other."""
        return self.knows(i, j) | self.knows(j, i)
