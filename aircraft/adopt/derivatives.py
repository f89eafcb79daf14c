"""Differentiates a model around level flights: what each angle, rate and command does to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.adopt.controls import Controls
from aircraft.adopt.rig import Held, Rig
from aircraft.jsbsim.geodesy import G_MPS2
from aircraft.jsbsim.steady import Trim

Array = NDArray[np.float64]

_ANGLE, _RATE, _COMMAND = 0.01, 0.02, 0.05  # rad, rad/s, of full command
_HALF_TURN = np.pi


@dataclass(frozen=True)
class Local:
    """Derivatives in one level flight by rad and rad/s; moments as rad/s^2, lift and drag as m/s^2."""

    trim: Trim
    lift_per_cl: float  # m/s^2, dynamic pressure times wing area over mass
    drag: float  # m/s^2
    lift: dict[str, float]  # by alpha, q, elevator
    drag_by_alpha: float
    pitch: dict[str, float]  # by alpha, q, alphadot, elevator
    roll: dict[str, float]  # by beta, p, r, aileron, rudder
    yaw: dict[str, float]
    side_by_beta: float  # m/s^2 per rad

    @property
    def v(self) -> float:
        """Airspeed [m/s]."""
        return self.trim.airspeed


def differentiate(rig: Rig, held: Held, trim: Trim, controls: Controls) -> Local:
    """Central differences around a level flight."""
    v = held.speed
    per_cl = 0.5 * rig.density * v**2 * rig.wing_area / rig.mass
    held.measure()
    drag = -float(rig.aerodynamic() @ held.along)

    def both(name: str, size: float) -> tuple[Array, float, float]:
        """Differences by one unit: accelerations (6,), lift, aero drag, and of alpha's rate with them."""
        rows = []
        for sign in (1.0, -1.0):
            moved, velocity, rates = _varied(held, name, sign * size, controls)
            rows.append(_measure(rig, held, velocity, rates, moved))
        (a, lift_a, dot_a), (b, lift_b, dot_b) = rows
        return (a - b) / (2 * size), (lift_a - lift_b) / (2 * size), (dot_a - dot_b) / (2 * size)

    by_dot = _by_alphadot(rig, held)
    lift, pitch, roll, yaw = {}, {"alphadot": by_dot}, {}, {}
    drag_by_alpha = _drag_by_alpha(rig, held)
    for name in ("alpha", "q", "elevator"):
        slope, lift[name], dot = both(name, {"alpha": _ANGLE, "q": _RATE}.get(name, _COMMAND))
        pitch[name] = float(slope[4]) - by_dot * dot
    side = 0.0
    for name in ("beta", "p", "r", "aileron", "rudder"):
        if name == "rudder" and controls.rudder is None:
            continue
        slope, _, _ = both(name, {"beta": _ANGLE, "p": _RATE, "r": _RATE}.get(name, _COMMAND))
        roll[name], yaw[name] = float(slope[3]), float(slope[5])
        if name == "beta":
            side = float(slope[1])
    return Local(trim, per_cl, drag, lift, drag_by_alpha, pitch, roll, yaw, side)


def _varied(held: Held, name: str, size: float, controls: Controls) -> tuple[dict[str, float], Array, Array]:
    """Commands, velocity and rates with one of them changed by `size`, surfaces in rad."""
    velocity, rates = held.velocity, np.zeros(3)
    moved: dict[str, float] = {}
    if name in ("alpha", "beta"):
        velocity = held.relative(**{name: size})
    elif name in ("p", "q", "r"):
        rates["pqr".index(name)] = size
    else:
        control = getattr(controls, name)
        # A step over the same share of the travel, whatever the travel is.
        moved[name] = held.commands[name] + size / control.travel
    return moved, velocity, rates


def _measure(
    rig: Rig, held: Held, velocity: Array, rates: Array, moved: dict[str, float]
) -> tuple[Array, float, float]:
    """Accelerations, the force over mass across the path, and alpha's rate [rad/s]."""
    found = held.measure(velocity=velocity, rates=rates, commands=moved)
    force = found[:3] + np.cross(rates, velocity) - G_MPS2 * held.gravity
    u, _, w = velocity
    across = np.array([w, 0.0, -u]) / np.hypot(u, w)
    return found, float(force @ across), float(rig.fdm.read("aero/alphadot-rad_sec"))


def _by_alphadot(rig: Rig, held: Held) -> float:
    """Pitch acceleration by alpha's rate: on its back, gravity turns the path the other way."""
    upright = held.measure()
    dot = rig.fdm.read("aero/alphadot-rad_sec")
    back = held.measure(attitude=np.array([held.attitude[0] + _HALF_TURN, *held.attitude[1:]]))
    change = dot - rig.fdm.read("aero/alphadot-rad_sec")
    return float((upright[4] - back[4]) / change) if abs(change) > 1e-6 else 0.0


def _drag_by_alpha(rig: Rig, held: Held) -> float:
    drags = []
    for sign in (1.0, -1.0):
        velocity = held.relative(alpha=sign * _ANGLE)
        held.measure(velocity=velocity)
        drags.append(-float(rig.aerodynamic() @ velocity) / held.speed)
    return (drags[0] - drags[1]) / (2 * _ANGLE)
