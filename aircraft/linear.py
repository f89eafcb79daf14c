"""Frequency responses and stability margins of the autopilot's loops, measured in the nonlinear simulation.

A loop is broken at a plant input: an impulse is added to the autopilot's output there, all else closed. What
the total becomes is the sensitivity S = 1 / (1 + L) at every frequency, sampling and actuators included.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.airframe import Airframe
from aircraft.earth import Origin
from aircraft.fdm import Fdm, Start

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


def response(airframe: Airframe, v: float, loop: str, dt: float = 0.005, duration: float = 30.0) -> Response:
    """The loop broken at `loop`, one of LOOPS, around level trim at ground speed v [m/s] in still air.

    The difference of an impulse up and one down cancels what the trim leaves and the even nonlinearities.
    """
    up, down = (_impulse(airframe, v, loop, dt, duration, sign * _IMPULSE) for sign in (1.0, -1.0))
    impulse = (up - down) / (2 * _IMPULSE)
    sensitivity = np.fft.rfft(impulse, 4 * len(impulse))
    frequency = 2 * np.pi * np.fft.rfftfreq(4 * len(impulse), dt)
    # Below, the record is too short; at the Nyquist frequency the loop has no phase.
    keep = (frequency > 2 * np.pi / duration) & (frequency < 0.98 * np.pi / dt)
    return Response(frequency[keep], 1.0 / sensitivity[keep] - 1.0)


def _impulse(airframe: Airframe, v: float, loop: str, dt: float, duration: float, size: float) -> Array:
    """What the plant input becomes, (T,), when `size` is added to it for the first period."""
    fdm = Fdm(airframe, dt, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, v))
    probe, total = fdm.node(f"ap/{loop}-probe"), fdm.node(f"ap/{loop}-norm")
    probe.set_double_value(size)
    out = np.empty(round(duration / dt))
    for k in range(len(out)):
        fdm.run((0.0, 0.0, 0.0), 1)
        out[k] = total.get_double_value()
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
