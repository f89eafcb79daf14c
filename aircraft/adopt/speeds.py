"""Finds the speeds of an aircraft: stall, lowest and highest level flight, and the [speeds] that follow."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numpy as np
from numpy.typing import NDArray

from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.rig import Held, Rig
from aircraft.airframes.schema import Speeds
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.geodesy import G_MPS2
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.steady import Trim, attempt, lacking

Array = NDArray[np.float64]

STAGE = "speeds"
_ANGLES = np.radians(np.arange(-4.0, 45.1, 1.0))
_ASSUMED_STALL = np.radians(15.0)  # of a model whose lift has no maximum below 30 deg
_NO_STALL = np.radians(30.0)
_ABOVE_STALL, _RANGE, _BELOW_TOP = 1.3, 1.75, 0.93
_FINER = 1.1  # ratio of speeds that are tried upwards
_NARROWEST = 1.12  # least v_max / v_min that steps of an autopilot can be flown in
_PERIODS = 8
_SOUGHT_S = 10.0  # processor time
_MOST_CL = 20.0
_LEVEL_RAD = 0.05  # angle of attack where nothing is known yet
_GIVEN = 400  # periods, 2 s
_STAYS = 0.01  # rad/s^2
_MOST_COMMAND = 0.92  # of elevator, aileron, rudder in level flight


@dataclass(frozen=True)
class Found:
    """Speeds [m/s], angle of attack [rad] and lift coefficient of the stall, level trims."""

    stall: float
    lowest: float
    highest: float
    top: float
    stall_alpha: float
    cl_max: float
    trims: tuple[Trim, ...]  # by speed, from the lowest up
    notes: tuple[str, ...]

    def near(self, v: float) -> Trim:
        """The trim whose speed is nearest."""
        return min(self.trims, key=lambda t: abs(t.airspeed - v))


def find_speeds(rig: Rig) -> Found:
    """Stall speed from the lift's maximum, then level trims upwards. Raises AdoptionError."""
    integrated = _integrated(rig) if rig.airframe.setup.captive else ""
    alpha, cl_max, stalls = _stall(rig)
    notes = [] if stalls else [f"its lift has no maximum: a stall at {np.degrees(alpha):.0f} deg is assumed"]
    stall = float(np.sqrt(2 * rig.mass * G_MPS2 / (rig.density * rig.wing_area * cl_max)))
    try:
        lowest = _lowest(rig, _ABOVE_STALL * stall)
    except AdoptionError:
        if not integrated:
            raise
        raise AdoptionError(
            STAGE,
            f"its own flight control integrates the {integrated}'s command: no command holds level flight",
        ) from None
    if lowest.airspeed > 1.01 * _ABOVE_STALL * stall:
        notes.append(f"it flies level from {lowest.airspeed / stall:.2f} times its stall speed, not from 1.3")
    trims = [lowest]
    most = _RANGE / _BELOW_TOP * lowest.airspeed
    reason = ""
    while trims[-1].airspeed < most:
        v = min(trims[-1].airspeed * _FINER, most * 1.0001)
        found = _level(rig, v, trims[-1])
        if found is None:
            low, high = trims[-1].airspeed, v
            for _ in range(2):
                middle = (low + high) / 2
                found = _level(rig, middle, trims[-1])
                if found is None:
                    high = middle
                else:
                    low = middle
                    trims.append(found)
            reason = _why(rig, high, trims[-1])
            break
        trims.append(found)
    top = trims[-1].airspeed
    highest = min(_RANGE * lowest.airspeed, _BELOW_TOP * top)
    if highest < _NARROWEST * lowest.airspeed:
        raise AdoptionError(
            STAGE, f"it flies level only from {lowest.airspeed:.1f} to {top:.1f} m/s; above, {reason}"
        )
    return Found(stall, lowest.airspeed, highest, top, alpha, cl_max, tuple(trims), tuple(notes))


def rounded(found: Found) -> Speeds:
    """The [speeds] of airframe.toml; turn and climb rates of the steps are left to who knows them."""
    low, high = round(found.lowest, 1), round(found.highest, 1)
    trims = [round(float(v), 1) for v in np.linspace(low, high, 4)]
    return Speeds(v_min_mps=low, v_max_mps=high, start_mps=round((low + high) / 2, 1), trim_mps=trims)


def _stall(rig: Rig) -> tuple[float, float, bool]:
    """Angle of attack [rad] and lift coefficient of the stall; whether the model has one."""
    speed = float(np.sqrt(2 * rig.mass * G_MPS2 / (rig.density * rig.wing_area * 0.6)))
    alpha, cl, stalls = 0.0, 0.0, False
    for _ in range(2):
        lift = np.array([_lift(rig, speed, float(a)) for a in _ANGLES])
        if not np.all(np.isfinite(lift)):
            raise AdoptionError(STAGE, "its forces are not finite; look at its tables and sizes")
        cls = lift / (0.5 * rig.density * speed**2 * rig.wing_area / rig.mass)
        if np.abs(cls).max() > _MOST_CL:
            raise AdoptionError(
                STAGE,
                f"its forces run away while it is held (a lift coefficient of {np.abs(cls).max():.2g}): they"
                " depend on the rate of alpha, which they make themselves",
            )
        falls = [k for k in range(3, len(cls) - 1) if cls[k] > cls[k + 1] and cls[k] > 0.2]
        stalls = bool(falls) and _ANGLES[falls[0]] < _NO_STALL
        if stalls:
            alpha, cl = float(_ANGLES[falls[0]]), float(cls[falls[0]])
        else:
            alpha = float(_ASSUMED_STALL)
            cl = float(np.interp(alpha, _ANGLES, cls))
        if cl < 0.1:
            raise AdoptionError(
                STAGE, f"its wing does not lift: the largest lift coefficient below 45 deg is {cls.max():.2f}"
            )
        speed = float(np.sqrt(2 * rig.mass * G_MPS2 / (rig.density * rig.wing_area * cl)))
    return alpha, cl, stalls


def _lift(rig: Rig, speed: float, alpha: float) -> float:
    """Aerodynamic lift over mass [m/s^2] with all commands at zero."""
    velocity = speed * np.array([np.cos(alpha), 0.0, np.sin(alpha)])
    commands = dict.fromkeys(("elevator", "aileron", "rudder"), 0.0)
    commands["throttle"] = rig.airframe.engines.idle
    held = Held(rig, np.array([0.0, alpha, 0.0]), velocity, commands, [])
    held.measure(periods=_PERIODS)
    force = rig.aerodynamic()
    return float(force[0] * np.sin(alpha) - force[2] * np.cos(alpha))


def _level(rig: Rig, v: float, near: Trim | None) -> Trim | None:
    """Level flight at v with some travel left to every surface; None if there is none."""
    try:
        found = attempt(rig.fdm, _start(v), 0.0, near)
    except FdmError:  # an engine that does not settle there
        return None
    if found is None or max(map(abs, (found.elevator, found.aileron, found.rudder))) > _MOST_COMMAND:
        return None
    return found if abs(found.alpha) < 0.6 and abs(found.roll) < 0.5 else None


def _lowest(rig: Rig, v: float) -> Trim:
    first, until = v, process_time() + _SOUGHT_S
    for _ in range(9):
        if process_time() > until:  # engines that settle slowly: say what is missing in time
            break
        found = _level(rig, v, None)
        if found is not None:
            return found
        v *= _FINER
    raise AdoptionError(
        STAGE, f"no level flight from {first:.1f} to {v:.1f} m/s: {_why(rig, 1.3 * first, None)}"
    )


def _integrated(rig: Rig) -> str:
    """The command that the model's own flight control integrates, "" if none.

    The body is held, a command given for two seconds and taken back: what it did to the moments stays.
    """
    speed = float(np.sqrt(2 * rig.mass * G_MPS2 / (rig.density * rig.wing_area * 0.6)))
    velocity = speed * np.array([np.cos(_LEVEL_RAD), 0.0, np.sin(_LEVEL_RAD)])
    commands = dict.fromkeys(("elevator", "aileron", "rudder"), 0.0)
    held = Held(rig, np.array([0.0, _LEVEL_RAD, 0.0]), velocity, commands, [])
    for name in commands:
        for command in (0.05, -0.05):  # one of them if an integrator is at its end
            before, moved, after = (
                held.measure(commands={name: c}, periods=_GIVEN)[3:] for c in (0.0, command, 0.0)
            )
            stays = float(np.abs(after - before).max())
            if stays > _STAYS and stays > 0.5 * float(np.abs(moved - before).max()):
                return name
    return ""


def _why(rig: Rig, v: float, near: Trim | None) -> str:
    """What is missing for level flight at v."""
    try:
        at = attempt(rig.fdm, _start(v), 0.0, near)
        if at is None:
            return lacking(rig.fdm, _start(v), near)
    except FdmError as error:
        return str(error).split(": ", 1)[-1]
    names = ("elevator", "aileron", "rudder")
    worst = max(names, key=lambda name: abs(float(getattr(at, name))))
    if abs(float(getattr(at, worst))) > _MOST_COMMAND:
        return f"{worst} {getattr(at, worst):.2f} at {v:.1f} m/s leaves no travel"
    return f"it would fly at an angle of attack of {np.degrees(at.alpha):.0f} deg at {v:.1f} m/s"


def _start(v: float) -> Start:
    return Start(0.0, 0.0, 0.0, 0.0, v)
