"""The aircraft and its autopilot as one linear discrete-time system around level flight.

It is built from parts, not identified from a flight: JSBSim's accelerations differentiated at rest, its
integration scheme and order of evaluation, actuators from a step, and the autopilot's equations
differentiated as text. `margins` measures the same loops in flight; a test compares the two.

Forces due to the angle of attack's rate, which JSBSim feeds back a period late, act at once, far above the
crossovers. Channels at 10 Hz, as ArduPlane has them, make the loops periodic in time: `Model.frames` has each
period of their common cycle, in which a channel runs or holds. The matrices a, b, c count such channels as
running in each period; they are for what can take nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.autopilots.linear_airframe import (
    STATES,
    NotFirstOrderError,
    Point,
    actuator,
    differentiate,
)
from aircraft.autopilots.linear_autopilot import COMMANDS, LinearAutopilot, linearise, loops
from aircraft.equations.catalogue import of_airframe
from aircraft.jsbsim.geodesy import M_PER_FT

Array = NDArray[np.float64]

# Age [frames] of a property when the autopilot, which runs right after the propagation, reads it.
_FRESH = ("velocities/v-", "velocities/h-dot", "velocities/p-", "velocities/q-", "velocities/r-", "attitude/")
_FRESH_BUT_NOT = ("velocities/vt", "velocities/vg", "velocities/p-aero", "velocities/q-aero")
_TWICE_OLD = ("accelerations/N",)
# Cycles of channels up to here change a loop by less than 0.1 dB and 0.1 deg below 60 rad/s.
_SLOW_S = 0.05
_HEIGHTS_M = {"position/h-sl-ft": M_PER_FT, "position/h-sl-meters": 1.0}  # and the unit of each [m]


@dataclass(frozen=True)
class Model:
    """x[k+1] = a x[k] + b probe[k] + e asked[k], total[k] = c x[k] + f asked[k] + probe[k], every dt seconds.

    All loops are closed. `total` is what the autopilot sends to the plant inputs `loops`, the probe
    included; `asked` is the commands (v, omega, zeta). `point` is the airframe alone, in continuous time;
    `states` names what x consists of.

    frames  where channels are slow: the matrices (K, n, n), (K, n, m), (K, m, n) of each period of their
            cycle; None where they are quick enough to count as running in each
    """

    a: Array
    b: Array
    c: Array
    dt: float
    loops: tuple[str, ...]
    point: Point
    e: Array
    f: Array
    states: tuple[str, ...]
    frames: tuple[Array, Array, Array] | None = None

    def cycle(self) -> tuple[Array, Array, float]:
        """(a, c) from one beginning of the channels' cycle to the next, and how long it lasts [s]."""
        if self.frames is None:
            return self.a, self.c, self.dt
        a, _, c = self.frames
        whole = np.eye(a.shape[1])
        for one in a:
            whole = one @ whole
        return whole, c[0], len(a) * self.dt

    def sensitivity(self, name: str, frequency: NDArray[np.floating[Any]]) -> NDArray[np.complex128]:
        """S of the loop at plant input `name` at frequencies (F,) [rad/s]: what a sine added there becomes.

        Of a periodic loop it is the part of the answer that has the sine's own frequency.
        """
        from scipy.linalg import schur

        k = self.loops.index(name)
        a, b, c = (self.a[None], self.b[None], self.c[None]) if self.frames is None else self.frames
        z: NDArray[Any] = np.exp(1j * frequency * self.dt)[:, None]
        # The state is x[k] = xi[k] z^k with xi periodic; xi[0] closes the cycle.
        n, size = len(a), a.shape[1]
        whole: NDArray[Any] = self.cycle()[0]
        driven: NDArray[Any] = np.zeros((len(frequency), size), dtype=complex)
        for of_a, of_b in zip(a, b, strict=True):
            driven = (driven @ of_a.T + of_b[:, k]) / z
        # (z^n - whole) xi = z^n driven, for all frequencies at once: whole is made triangular.
        upper, turn = schur(whole, output="complex")
        wanted, solved = (z**n * driven) @ turn.conj(), np.zeros_like(driven)
        for i in range(size)[::-1]:
            rest = solved[:, i + 1 :] @ upper[i, i + 1 :]
            solved[:, i] = (wanted[:, i] + rest) / (z[:, 0] ** n - upper[i, i])
        xi: Any = solved @ turn.T
        found = np.ones(len(frequency), dtype=np.complex128)
        for of_a, of_b, of_c in zip(a, b, c, strict=True):
            found += xi @ of_c[k] / n
            xi = (xi @ of_a.T + of_b[:, k]) / z
        return found

    def loop(self, name: str) -> tuple[Array, Array, Array]:
        """(a, b, c) of the loop broken at plant input `name`, negative feedback, the others closed.

        The closed loop is S = 1 / (1 + L) from probe to total, so L = 1 / S - 1.
        """
        k = self.loops.index(name)
        b, c = self.b[:, k : k + 1], self.c[k : k + 1]
        return self.a - b @ c, b, -c


def linear_model(airframe: Airframe, v: float, dt: float = 0.005) -> Model:
    """The aircraft in level flight at ground speed v [m/s] in still air.

    Raises  FdmError where it cannot fly level, or where an actuator is no first-order lag.
    """
    names = loops(airframe)
    point = differentiate(airframe, v, dt, names)
    poles, direct = np.array([actuator(airframe, v, dt, path) for path in names.values()]).T
    uses, sent = list(of_airframe(airframe).uses.values()), tuple(names)
    cycle = math.lcm(*(channel.periods(dt) for channel in of_airframe(airframe).channels))

    def advanced(autopilot: LinearAutopilot) -> _Advance:
        return _Advance(point, autopilot, uses, poles, direct, dt)

    (steady,) = linearise(airframe, point.memory, dt, sent)
    frames = None
    if cycle * dt > _SLOW_S:
        each = linearise(airframe, point.memory, dt, sent, range(cycle))
        a, b, c = (np.array(of) for of in list(zip(*(advanced(x).matrices() for x in each), strict=True))[:3])
        frames = a, b, c
    whole = advanced(steady)
    a, b, c, e, f = whole.matrices()
    return Model(a, b, c, dt, sent, point, e, f, whole.states(sent), frames)


def linear_or_none(airframe: Airframe, v: float, dt: float = 0.005) -> Model | None:
    """The linear model at v [m/s]; None for an aircraft whose surfaces follow by more than a lag.

    Raises  FdmError where the aircraft cannot fly level
    """
    try:
        return linear_model(airframe, v, dt)
    except NotFirstOrderError:
        return None


class _Advance:
    """One period of everything, linear, in JSBSim's order: propagate, autopilot, actuators, forces.

    z  STATES, their derivatives, the last velocity derivatives (Adams-Bashforth), surfaces, the autopilot's
       memory, the actuators' memory, properties that are two frames old, the height [m] if it is used
    """

    def __init__(
        self,
        point: Point,
        autopilot: LinearAutopilot,
        used: list[str],
        poles: Array,
        direct: Array,
        dt: float,
    ) -> None:
        self._point, self._autopilot, self._used, self._dt = point, autopilot, used, dt
        self._poles, self._direct = poles, direct
        fresh = [p.startswith(_FRESH) and not p.startswith(_FRESH_BUT_NOT) for p in used]
        self._fresh, self._old = np.array(fresh), np.array([p.startswith(_TWICE_OLD) for p in used])
        self._height = np.array([[1 / _HEIGHTS_M[p] if p in _HEIGHTS_M else 0.0] for p in used])
        self._height = self._height[:, : int(self._height.any())]
        m, heights = len(poles), self._height.shape[1]
        self._ends = np.cumsum([9, 9, 3, m, len(autopilot.a), m, int(self._old.sum()), heights])
        self.size = int(self._ends[-1])

    def states(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Names of z; `names` are the plant inputs'."""
        return (
            *STATES,
            *(f"{x}_rate" for x in STATES),
            *(f"{x}_rate_before" for x in STATES[:3]),
            *(f"{name}_moved" for name in names),
            *(f"ap_{name}" for name in self._autopilot.names),
            *(f"{name}_lag" for name in names),
            *(f"{path}_before" for path, old in zip(self._used, self._old, strict=True) if old),
            *(("height",) if self._height.size else ()),
        )

    def matrices(self) -> tuple[Array, Array, Array, Array, Array]:
        """(a, b, c, e, f) of `Model`."""
        still, silent = np.zeros(len(self._poles)), np.zeros(len(COMMANDS))
        columns, totals = zip(*(self(z, still, silent) for z in np.eye(self.size)), strict=True)
        inputs, _ = zip(*(self(np.zeros(self.size), u, silent) for u in np.eye(len(still))), strict=True)
        asked, sent = zip(*(self(np.zeros(self.size), still, u) for u in np.eye(len(silent))), strict=True)
        a, b, c, e, f = (np.array(x).T for x in (columns, inputs, totals, asked, sent))
        return a, b, c, e, f

    def __call__(self, z: Array, probe: Array, asked: Array) -> tuple[Array, Array]:
        """The next z, and what is sent to the plant inputs."""
        x, rate, last, surface, memory, lag, old, height = np.split(z, self._ends[:-1])
        p, ap = self._point, self._autopilot
        move = rate.copy()
        move[:3] = 1.5 * rate[:3] - 0.5 * last
        after = x + self._dt * move
        seen = p.c @ x + p.d @ surface
        used = np.where(self._fresh, p.c @ after, seen)
        used[self._old] = old
        risen = height - self._dt * x[2]
        used = used + self._height @ risen
        total = ap.c @ memory + ap.d @ used + ap.g @ asked + probe
        # First-order lag, share `direct` at once: y = direct u + memory.
        moved = self._direct * total + lag
        lagging = self._poles * moved + (1 - self._poles - self._direct) * total
        parts = [after, p.a @ after + p.b @ moved, rate[:3], moved]
        kept = ap.a @ memory + ap.b @ used + ap.e @ probe + ap.f @ asked
        parts += [kept, lagging, seen[self._old], risen]
        return np.concatenate(parts), total
