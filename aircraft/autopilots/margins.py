"""Frequency responses, margins and modes: measured in the nonlinear simulation, and of a linear model.

A loop is broken at a plant input: an impulse is added to the autopilot's output there, with all loops
closed. The total's response is the sensitivity S = 1 / (1 + L) at every frequency, sampling and actuators
included.
`aircraft.autopilots.linear_model` gives the same loops without flying them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.airframes.sensors import sensors_of, silent
from aircraft.autopilots.linear_airframe import Point
from aircraft.autopilots.linear_model import Model
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start, rotation
from aircraft.jsbsim.steady import Trim

Array = NDArray[np.float64]

LOOPS = ("elevator", "aileron", "throttle")
_IMPULSE = 1e-5  # of full deflection: small enough for linearity, 1e8 above rounding


@dataclass(frozen=True)
class Response:
    """The loop transfer L at frequencies [rad/s]."""

    frequency: NDArray[np.floating[Any]]
    loop: NDArray[np.complex128]


@dataclass(frozen=True)
class Margins:
    """Gain margin [dB], phase margin [deg], disk margin (skew 0), crossover [rad/s]; inf if none."""

    gain_db: float
    phase_deg: float
    disk: float
    crossover: float


def response(
    airframe: Airframe,
    v: float,
    loop: str,
    dt: float = 0.005,
    duration: float = 30.0,
    near: Trim | None = None,
    waits: Sequence[int] = (0,),
) -> Response:
    """The loop broken at `loop`, one of LOOPS, around level trim at ground speed v [m/s] in still air.

    near   a trim of a flight like this one, which makes starting quicker
    waits  periods before the impulse, a flight each, of which the mean is taken: where channels are slow, it
           matters how long an impulse waits for them (`waits_of`)

    The difference of an impulse up and one down cancels what the trim leaves and the even nonlinearities.
    Where servos hear a command only every few periods, the impulse lasts as long: a shorter one could go by
    unheard. Frequencies are then those below the servos' Nyquist frequency. Noise of sensors and dead
    bands of servos are left out: they hide an impulse.
    """
    airframe = airframe.model_copy(update={"sensors": silent(airframe.sensors)})
    rate = sensors_of(airframe.sensors).servo_rate_hz
    width = max(1, round(1 / (rate * dt))) if rate else 1
    flights = [
        sign * _impulse(airframe, v, loop, dt, duration, sign * _IMPULSE, width, near, wait)
        for wait in waits
        for sign in (1.0, -1.0)
    ]
    impulse = np.sum(flights, axis=0) / (len(flights) * _IMPULSE)
    sensitivity = np.fft.rfft(impulse, 4 * len(impulse))
    frequency = 2 * np.pi * np.fft.rfftfreq(4 * len(impulse), dt)
    # Below, the record is too short; at the Nyquist frequency the loop has no phase.
    keep = (frequency > 2 * np.pi / duration) & (frequency < 0.98 * np.pi / (width * dt))
    if width > 1:
        sensitivity[keep] /= np.exp(-1j * np.outer(frequency[keep] * dt, np.arange(width))).sum(axis=1)
    return Response(frequency[keep], 1.0 / sensitivity[keep] - 1.0)


def waits_of(model: Model | None, flights: int = 4) -> list[int]:
    """Waits for `response`, spread over the cycle of the model's slow channels; only 0 without such."""
    if model is None or model.frames is None:
        return [0]
    cycle = len(model.frames[0])
    return list(range(0, cycle, max(1, cycle // flights)))


def _impulse(
    airframe: Airframe,
    v: float,
    loop: str,
    dt: float,
    duration: float,
    size: float,
    width: int,
    near: Trim | None,
    wait: int,
) -> Array:
    """The plant input (T,) from the first of the `width` periods on in which `size` is added to it."""
    fdm = Fdm(airframe, dt, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, v), near)
    probe, total = fdm.node(f"ap/{loop}-probe"), fdm.node(f"ap/{loop}-norm")
    if wait:
        fdm.run((0.0, 0.0, 0.0), wait)
    probe.set_double_value(size)
    out = np.empty(round(duration / dt))
    for k in range(len(out)):
        fdm.run((0.0, 0.0, 0.0), 1)
        out[k] = total.get_double_value()
        if k + 1 >= width:
            probe.set_double_value(0.0)
    return out


def margins(measured: Response) -> Margins:
    """Classical and disk margins of a loop that is closed with negative feedback and stable."""
    w, loop = measured.frequency, measured.loop
    size = np.abs(loop)
    crosses_axis = np.flatnonzero((loop.imag[:-1] * loop.imag[1:] < 0) & (loop.real[:-1] < 0))
    crosses_unity = np.flatnonzero((size[:-1] - 1) * (size[1:] - 1) < 0)
    return Margins(
        gain_db=float(min(abs(20 * np.log10(size[crosses_axis])), default=np.inf)),
        phase_deg=float(min(abs(np.degrees(np.angle(-loop[crosses_unity]))), default=np.inf)),
        disk=float(1.0 / np.max(np.abs(1.0 / (1.0 + loop) - 0.5))),
        crossover=float(w[crosses_unity[-1]]) if len(crosses_unity) else float("inf"),
    )


def model_response(model: Model, loop: str, frequency: NDArray[np.floating[Any]]) -> Response:
    """The loop transfer of a linear model at `frequency` [rad/s]."""
    if model.frames is not None:
        return Response(frequency, 1.0 / model.sensitivity(loop, frequency) - 1.0)
    a, b, c = model.loop(loop)
    z = np.exp(1j * frequency * model.dt)[:, None, None]
    gain = c @ np.linalg.solve(z * np.eye(len(a)) - a, b[None])
    return Response(frequency, gain[:, 0, 0].astype(np.complex128))


def model_margins(model: Model, loop: str) -> Margins:
    """Margins of a linear model's loop as python-control computes them, disk margin with skew 0."""
    import control

    frequency = np.geomspace(1e-2, 0.98 * np.pi / model.dt, 500)
    found = model_response(model, loop, frequency)
    at = control.frd(found.loop, frequency, dt=model.dt)
    gain, phase, _, _, crossovers, _ = control.stability_margins(at, returnall=True)
    disk = margins(found).disk
    if model.frames is None:
        disk, _, _ = control.disk_margins(control.ss(*model.loop(loop), 0.0, model.dt), frequency, skew=0.0)
    return Margins(
        gain_db=float(min(abs(20 * np.log10(np.asarray(gain))), default=np.inf)),
        phase_deg=float(min(abs(np.asarray(phase)), default=np.inf)),
        disk=float(disk),
        crossover=float(max(crossovers, default=np.inf)),
    )


@dataclass(frozen=True)
class Mode:
    """A natural mode: eigenvalue [1/s], natural frequency [rad/s] and damping ratio."""

    name: str
    eigenvalue: complex

    @property
    def frequency(self) -> float:
        return abs(self.eigenvalue)

    @property
    def damping(self) -> float:
        """1 for a real stable mode, -1 for a real unstable one."""
        return -self.eigenvalue.real / abs(self.eigenvalue) if self.eigenvalue else 0.0


def modes(point: Point) -> list[Mode]:
    """The airframe's own modes in level flight, controls fixed, one of each conjugate pair.

    Pitch and roll are solved apart: level flight of a symmetric aircraft does not couple them.
    """
    turn = np.eye(9)
    turn[:3, :3] = rotation(0.0, 0.0, point.trim[5])  # forward, right, down
    a = turn.T @ point.a @ turn
    along, aside = [0, 2, 4, 7], [1, 3, 5, 6, 8]
    pitch = sorted(np.linalg.eigvals(a[np.ix_(along, along)]), key=abs, reverse=True)
    roll = sorted(np.linalg.eigvals(a[np.ix_(aside, aside)]), key=abs, reverse=True)[:4]  # not the heading
    named = [("short period", x) for x in pitch[:2]] + [("phugoid", x) for x in pitch[2:]]
    named += [("Dutch roll" if abs(x.imag) > 1e-6 else "", x) for x in roll]
    reals = [x for name, x in named if not name]
    named = [(name or ("roll" if x is reals[0] else "spiral"), x) for name, x in named]
    return [Mode(name, complex(x)) for name, x in named if x.imag >= 0]
