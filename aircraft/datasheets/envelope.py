"""Computes what an airframe can do at each speed, and whether it can fly every input of a filter's box."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe, Speeds
from aircraft.autopilots.specification import TURN
from aircraft.autopilots.tuning import fly
from aircraft.jsbsim.climbs import climb_range
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import G_MPS2, Origin
from aircraft.jsbsim.rest import Start, hold, rotation
from aircraft.jsbsim.steady import Trim

_DT_S = 0.005
THROTTLE = "fcs/throttle-cmd-norm"
_MOST_SPEEDS = 11
# How near a command counts as flown, and for how long a corner is tried.
NEAR = (0.5, math.radians(0.5), 0.3)  # m/s, rad/s, m/s
TRIED_S = 60.0


@dataclass(frozen=True)
class Box:
    """The inputs a filter may ask for: the paper's, unless a scenario says otherwise."""

    v_min: float = 15.0  # m/s
    v_max: float = 25.0
    omega: float = math.radians(13.0)  # rad/s, either way
    zeta: float = 3.9  # m/s, either way


def box_of(speeds: Speeds) -> Box:
    """The paper's box at an airframe's own speeds, with the turn and climb rates that it states."""
    paper = Box()
    omega = paper.omega if speeds.turn_radps is None else speeds.turn_radps * paper.omega / TURN
    zeta = paper.zeta if speeds.climb_mps is None else speeds.climb_mps
    return Box(speeds.v_min_mps, speeds.v_max_mps, omega, zeta)


@dataclass(frozen=True)
class Limits:
    """What the airframe can do at one speed; SI, load factors in g."""

    v: float
    bank: float  # rad, in a steady level turn at the box's turn rate; NaN if it cannot
    load_in_turn: float
    climb: float  # m/s, steady, wings level, full throttle
    sink: float  # m/s, steady, idle; negative
    acceleration: float  # m/s^2, level, full throttle
    deceleration: float  # m/s^2, level, idle; negative
    load_available: float  # of the wing at its largest lift, elevator within its travel
    stall_speed: float  # m/s, in level flight
    alpha: float  # rad, level
    alpha_stall: float  # rad

    @property
    def stall_margin(self) -> float:
        """Speed over stall speed."""
        return self.v / self.stall_speed


@dataclass(frozen=True)
class Corner:
    """One corner of the box. Times are infinite for what never happens."""

    v: float
    omega: float
    zeta: float
    sustainable: bool
    held: float  # s from coming NEAR the corner until the autopilot leaves it; 0 if it never came near
    lasts: float  # s until the speed is off by NEAR if turn and climb are flown, throttle at its stop
    balances: float  # m/s, the nearest speed in the box at which they are sustainable; NaN if none
    gives: str  # the channel that the autopilot gives up


class _Bench:
    """One flight model that is evaluated and not flown: forces and steady flights."""

    def __init__(self, airframe: Airframe) -> None:
        self.fdm = Fdm(airframe, _DT_S, Origin())
        self.inputs = ["fcs/elevator-cmd-norm", "fcs/aileron-cmd-norm", THROTTLE]
        if airframe.has_rudder:
            self.inputs.append("fcs/rudder-cmd-norm")

    def trim(self, v: float, omega: float = 0.0) -> Trim | None:
        """Level flight at ground speed v [m/s], turning at omega [rad/s]; None if there is none."""
        try:
            return self.fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v), omega)
        except FdmError:
            return None

    def climbs(self, v: float, omega: float) -> tuple[float, float]:
        """Lowest and highest steady climb rate [m/s] at ground speed v and turn rate omega; NaN if none.

        Raises  FdmError if the airframe cannot fly level at its start speed
        """
        speed = self.fdm.airframe.speeds.start_mps
        return climb_range(self.fdm, v, omega, self.fdm.trim(Start(0.0, 0.0, 0.0, 0.0, speed)))


def climbs(airframe: Airframe, v: float, omega: float = 0.0) -> tuple[float, float]:
    """Lowest and highest climb rate [m/s] of steady flight in still air, mostly at idle and full throttle.

    v      ground speed [m/s];  omega  turn rate [rad/s]
    Returns NaN and NaN where there is no steady flight; a dive of 60 deg at most
    Raises  FdmError if the airframe cannot fly level at its start speed
    """
    return _Bench(airframe).climbs(v, omega)


def limits(airframe: Airframe, v: float, omega: float) -> Limits:
    """The envelope at ground speed v [m/s] in still air, turning at `omega` [rad/s] where a turn is meant."""
    bench = _Bench(airframe)
    turning = bench.trim(v, omega)
    bank = abs(turning.roll) if turning is not None else math.nan
    sink, climb = bench.climbs(v, 0.0)
    level = bench.trim(v)
    if level is None:
        nothing = math.nan
        return Limits(v, bank, 1.0 / math.cos(bank), climb, sink, *[nothing] * 6)
    commands = {path: bench.fdm.read(path) for path in bench.inputs}
    attitude = np.array([level.roll, level.pitch, level.yaw])
    turn = rotation(*attitude)
    body = turn.T @ np.array([math.cos(level.yaw - level.beta), math.sin(level.yaw - level.beta), 0.0]) * v

    def along(throttle: float) -> float:
        at = {**commands, THROTTLE: throttle}
        return float(hold(bench.fdm, body, attitude, np.zeros(3), at)[:3] @ body / v)

    load, alpha_stall = _largest_lift(bench, v, commands)
    return Limits(
        v=v,
        bank=bank,
        load_in_turn=1.0 / math.cos(bank),
        climb=climb,
        sink=sink,
        acceleration=along(1.0),
        deceleration=along(0.0),
        load_available=load,
        stall_speed=v / math.sqrt(load),
        alpha=level.alpha,
        alpha_stall=alpha_stall,
    )


def _largest_lift(bench: _Bench, v: float, commands: dict[str, float]) -> tuple[float, float]:
    """Largest lift over weight with the pitching moment trimmed, and its angle of attack [rad]."""

    def lift(alpha: float) -> float:
        body = v * np.array([math.cos(alpha), 0.0, math.sin(alpha)])

        def at(elevator: float) -> NDArray[np.float64]:
            held = {**commands, "fcs/elevator-cmd-norm": elevator, THROTTLE: 0.0}
            return hold(bench.fdm, body, (0.0, alpha, 0.0), (0.0, 0.0, 0.0), held)

        pitch = [at(e)[4] for e in (0.0, 0.1)]
        slope = (pitch[1] - pitch[0]) / 0.1
        forward, _, down, *_ = at(float(np.clip(-pitch[0] / slope, -1, 1)) if slope else 0.0)
        # Level path: gravity is along the path's normal, and what the wing adds is the rest.
        return 1.0 + (forward * math.sin(alpha) - down * math.cos(alpha)) / G_MPS2

    angles = np.radians(np.arange(0.0, 45.0, 0.5))
    lifts = np.array([lift(float(a)) for a in angles])
    best = int(np.argmax(lifts))
    return float(lifts[best]), float(angles[best])


def corners(airframe: Airframe, box: Box) -> list[Corner]:
    """Each corner of the box, and the middles of its faces in climb rate without a turn.

    Left and right are alike for a symmetric airframe: left turns only.
    """
    bench = _Bench(airframe)
    cases = product((box.v_min, box.v_max), (0.0, box.omega), (box.zeta, -box.zeta))
    return [_corner(airframe, bench, box, *case) for case in cases]


def _corner(airframe: Airframe, bench: _Bench, box: Box, v: float, omega: float, zeta: float) -> Corner:
    lowest_or_highest = 1 if zeta > 0 else 0

    def steady(speed: float) -> float:
        """Climb rate beyond the one asked for, positive where it can be had."""
        return math.copysign(1.0, zeta) * (bench.climbs(speed, omega)[lowest_or_highest] - zeta)

    if steady(v) >= 0:
        return Corner(v, omega, zeta, True, math.inf, math.inf, v, "")
    # What is asked beyond the steady climb rate is paid from speed: v dv/dt = g (steady - asked).
    lasts = NEAR[0] * v / (G_MPS2 * abs(steady(v)))
    speeds = np.linspace(v, box.v_min if zeta > 0 else box.v_max, 21)
    balanced = [s for s in speeds.tolist() if steady(s) >= 0]
    f = fly(airframe, v, (v, omega, zeta), TRIED_S)
    misses = np.abs(np.stack([f.v - v, f.omega - omega, f.zeta - zeta])) / np.array(NEAR)[:, None]
    reached = np.flatnonzero(np.all(misses < 1, axis=0))
    held, gives = 0.0, ("v", "omega", "zeta")[int(np.argmax(misses[:, -1]))]
    if len(reached):
        lost = np.flatnonzero(np.any(misses[:, reached[0] :] >= 1, axis=0))
        held = float(f.t[reached[0] + lost[0]] - f.t[reached[0]]) if len(lost) else math.inf
    return Corner(v, omega, zeta, False, held, lasts, balanced[0] if balanced else math.nan, gives)


def envelope(airframe: Airframe, box: Box, speeds: Sequence[float] | None = None) -> list[Limits]:
    """`limits` at each of `speeds` [m/s], by default every metre per second flown at, eleven at most."""
    if speeds is None:
        low, high = airframe.speeds.v_min_mps, airframe.speeds.v_max_mps
        speeds = np.linspace(low, high, min(_MOST_SPEEDS, max(2, round(high - low) + 1))).tolist()
    return [limits(airframe, v, box.omega) for v in speeds]
