"""The aircraft and its autopilot as one linear discrete-time system around level flight.

It is built from parts, not identified from a flight: JSBSim's accelerations differentiated at rest, its
integration scheme and order of evaluation, actuators from a step, and the autopilot's equations
differentiated as text. `margins` measures the same loops in flight; a test compares the two.

Two things are simplified, both far above the crossovers: channels that run every few periods count as running
in each, and forces due to the angle of attack's rate, which JSBSim feeds back a period late, act at once.
"""

from __future__ import annotations

from dataclasses import dataclass

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

Array = NDArray[np.float64]

# Age [frames] of a property when the autopilot, which runs right after the propagation, reads it.
_FRESH = ("velocities/v-", "velocities/h-dot", "velocities/p-", "velocities/q-", "velocities/r-", "attitude/")
_FRESH_BUT_NOT = ("velocities/vt", "velocities/vg", "velocities/p-aero", "velocities/q-aero")
_TWICE_OLD = ("accelerations/N",)


@dataclass(frozen=True)
class Model:
    """x[k+1] = a x[k] + b probe[k] + e asked[k], total[k] = c x[k] + f asked[k] + probe[k], every dt seconds.

    All loops are closed. `total` is what the autopilot sends to the plant inputs `loops`, the probe
    included; `asked` is the commands (v, omega, zeta). `point` is the airframe alone, in continuous time;
    `states` names what x consists of.
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
    autopilot = linearise(airframe, point.memory, dt, tuple(names))
    advance = _Advance(point, autopilot, list(of_airframe(airframe).uses.values()), poles, direct, dt)
    n, m = advance.size, len(names)
    still, silent = np.zeros(m), np.zeros(len(COMMANDS))
    columns, totals = zip(*(advance(z, still, silent) for z in np.eye(n)), strict=True)
    inputs, _ = zip(*(advance(np.zeros(n), u, silent) for u in np.eye(m)), strict=True)
    asked, sent = zip(*(advance(np.zeros(n), still, u) for u in np.eye(len(COMMANDS))), strict=True)
    a, b, c, e, f = (np.array(x).T for x in (columns, inputs, totals, asked, sent))
    return Model(a, b, c, dt, tuple(names), point, e, f, advance.states(tuple(names)))


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
       memory, the actuators' memory, properties that are two frames old
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
        m = len(poles)
        self._ends = np.cumsum([9, 9, 3, m, len(autopilot.a), m, int(self._old.sum())])
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
        )

    def __call__(self, z: Array, probe: Array, asked: Array) -> tuple[Array, Array]:
        """The next z, and what is sent to the plant inputs."""
        x, rate, last, surface, memory, lag, old = np.split(z, self._ends[:-1])
        p, ap = self._point, self._autopilot
        move = rate.copy()
        move[:3] = 1.5 * rate[:3] - 0.5 * last
        after = x + self._dt * move
        seen = p.c @ x + p.d @ surface
        used = np.where(self._fresh, p.c @ after, seen)
        used[self._old] = old
        total = ap.c @ memory + ap.d @ used + ap.g @ asked + probe
        # First-order lag, share `direct` at once: y = direct u + memory.
        moved = self._direct * total + lag
        lagging = self._poles * moved + (1 - self._poles - self._direct) * total
        parts = [after, p.a @ after + p.b @ moved, rate[:3], moved]
        kept = ap.a @ memory + ap.b @ used + ap.e @ probe + ap.f @ asked
        parts += [kept, lagging, seen[self._old]]
        return np.concatenate(parts), total
