"""Tells whether an airframe under its autopilot is stable: by the poles of its linear model, and in flight.

The poles are those of `aircraft.autopilots.linear_model` with all loops closed. In level flight every loop
gets a small pulse, and what remains of the motion after some time is compared with what followed the pulse:
saturation turns an unstable loop into a steady oscillation, which a linear model cannot show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.airframes.sensors import silent
from aircraft.autopilots.linear_autopilot import loops
from aircraft.autopilots.linear_model import Model, linear_model
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start

Array = NDArray[np.float64]

# Growth of a pole that counts as none: the heading is neutral, and rounding moves it by 1e-9.
_NEUTRAL_PER_S = 1e-4
_PULSE, _PULSE_S = 0.02, 0.05  # of full deflection, s
_FLOWN_S, _WINDOW_S, _FROM_S = 24.0, 8.0, 1.0
_REMAINS = (
    0.7  # of the oscillation after the pulse: what decays leaves less, our slowest pole (0.10 per s) 0.2
)
_SMALL = 2e-4  # of full deflection, rms: a smaller oscillation is not counted


@dataclass(frozen=True)
class Instability:
    """One unstable motion in level flight at v [m/s].

    loop       the plant input that moves most, as a share of its full deflection
    frequency  rad/s; 0 if the motion does not oscillate
    growth     1/s, of the linear model; NaN where the flight shows an oscillation that does not decay
    """

    v: float
    loop: str
    frequency: float
    growth: float

    @property
    def flown(self) -> bool:
        """Whether a flight showed it; else the linear model did."""
        return math.isnan(self.growth)

    def __str__(self) -> str:
        moves = f"oscillates at {self.frequency:.1f} rad/s" if self.frequency else "diverges"
        how = "does not decay in flight" if self.flown else f"grows by {self.growth:.2g} per s"
        return f"unstable at {self.v:g} m/s: the {self.loop} loop {moves} and {how}"


def unstable_modes(model: Model, v: float) -> list[Instability]:
    """Poles that grow, one of each conjugate pair, the fastest first."""
    a, c, lasts = model.cycle()
    values, vectors = np.linalg.eig(a)
    found = []
    for z, vector in zip(values.astype(complex), vectors.T, strict=True):
        growth, frequency = math.log(max(abs(z), 1e-300)) / lasts, float(np.angle(z)) / lasts
        if growth > _NEUTRAL_PER_S and frequency >= 0:
            loop = model.loops[int(np.argmax(np.abs(c @ vector)))]
            found.append(Instability(v, loop, frequency, growth))
    return sorted(found, key=lambda mode: -mode.growth)


def flown_oscillation(airframe: Airframe, v: float, dt: float = 0.005) -> Instability | None:
    """Disturb level flight at v [m/s] in still air a little; what does not decay, or None.

    Noise of sensors and the dead band of servos are left out: what they move never decays.
    Raises  FdmError where it cannot fly level
    """
    airframe = airframe.model_copy(update={"sensors": silent(airframe.sensors)})
    fdm = Fdm(airframe, dt, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, v))
    names = list(loops(airframe))
    probes = [fdm.node(f"ap/{name}-probe") for name in names]
    sent = [fdm.node(f"ap/{name}-norm") for name in names]
    moved = np.empty((round(_FLOWN_S / dt), len(names)))
    for probe in probes:
        probe.set_double_value(_PULSE)
    for k in range(len(moved)):
        if k == round(_PULSE_S / dt):
            for probe in probes:
                probe.set_double_value(0.0)
        fdm.run((0.0, 0.0, 0.0), 1)
        moved[k] = [node.get_double_value() for node in sent]
    if not np.all(np.isfinite(moved)):
        return Instability(v, names[int(np.argmin(np.isfinite(moved).sum(axis=0)))], 0.0, math.nan)
    n, first = round(_WINDOW_S / dt), round(_FROM_S / dt)
    early, late = _swing(moved[first : first + n]), _swing(moved[-n:])
    before, after = early.std(axis=0), late.std(axis=0)
    worst = int(np.argmax(after))
    if after[worst] < max(_SMALL, _REMAINS * before[worst]):
        return None
    return Instability(v, names[worst], _frequency(late[:, worst], dt), math.nan)


def _swing(moved: Array) -> Array:
    """What is left of (T, M) when each column's straight line is taken off."""
    t = np.linspace(-1.0, 1.0, len(moved))
    slope, mean = np.polyfit(t, moved, 1)
    return moved - mean - np.outer(t, slope)


def _frequency(swing: Array, dt: float) -> float:
    """The frequency [rad/s] that carries most of an oscillation (T,)."""
    spectrum = np.abs(np.fft.rfft(swing * np.hanning(len(swing)), 4 * len(swing)))
    return float(2 * np.pi * np.argmax(spectrum) / (4 * len(swing) * dt))


def instabilities(airframe: Airframe, speeds: Sequence[float] | None = None) -> list[Instability]:
    """Every unstable motion in level flight at the airframe's trim speeds, or at `speeds` [m/s].

    A flight is asked only where the linear model has no unstable motion: an unstable motion moves every loop,
    and the loop that moves most in flight need not be its cause.
    Raises  FdmError where it cannot fly level
    """
    found = []
    for v in airframe.speeds.trim_mps if speeds is None else speeds:
        modes: list[Instability] = []
        with suppress(FdmError):  # an actuator that is no first-order lag: the flight still tells
            modes = unstable_modes(linear_model(airframe, v), v)
        flown = None if modes else flown_oscillation(airframe, v)
        found += modes if flown is None else [flown]
    return found
