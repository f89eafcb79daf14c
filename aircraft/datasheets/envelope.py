"""What an airframe can do at each speed, and whether it can fly every input of a filter's box."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.autopilots.tuning import fly
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.initialisation import G_MPS2
from aircraft.jsbsim.rest import Start, hold, initialise, rotation

_DT_S = 0.005
THROTTLE = "fcs/throttle-cmd-norm"
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
    """One corner of the box. Times are infinite where nothing ends."""

    v: float
    omega: float
    zeta: float
    sustainable: bool
    held: float  # s from coming NEAR the corner until the autopilot leaves it; 0 if it never came near
    lasts: float  # s until the speed is off by NEAR if turn and climb are flown, throttle at its stop
    balances: float  # m/s, the nearest speed in the box at which they are sustainable; NaN if none
    gives: str  # the channel that the autopilot gives up


class _Bench:
    """An airframe at rest in time, to ask for forces and steady flights."""

    def __init__(self, airframe: Airframe) -> None:
        self.fdm = Fdm(airframe, _DT_S, Origin())
        self.inputs = ["fcs/elevator-cmd-norm", "fcs/aileron-cmd-norm", THROTTLE]
        if airframe.has_rudder:
            self.inputs.append("fcs/rudder-cmd-norm")

    def climb(self, v: float, omega: float, throttle: float) -> float:
        """The steady climb rate [m/s] at ground speed v and turn rate omega with `throttle`; NaN if none."""
        from scipy.optimize import root

        fdm, place = self.fdm, Start(0.0, 0.0, 0.0, 0.0, v)
        try:
            level = fdm.trim(place)
        except FdmError:
            return math.nan
        inputs = [path for path in self.inputs if path != THROTTLE]
        balance = [fdm.nodes[k] for k in ("udot", "vdot", "wdot", "pdot", "qdot", "rdot")]
        balance += [fdm.nodes["beta"]] if len(inputs) == 3 else []
        fdm.nodes["throttle"].set_double_value(throttle)

        def residuals(unknown: NDArray[np.float64]) -> list[float]:
            roll, above, aside, slope, *commands = map(float, unknown)
            for path, value in zip(inputs, commands, strict=True):
                fdm.node(path).set_double_value(value)
            attitude = (roll, slope + above, level.yaw + aside)
            initialise(fdm, attitude, np.array([0.0, v, -v * math.tan(slope)]), -omega)
            return [node.get_double_value() for node in balance]

        bank = -math.atan(v * omega / G_MPS2)
        commands = [level.elevator, level.aileron, level.rudder][: len(inputs)]
        found = root(residuals, [bank, level.alpha, 0.0, 0.0, *commands], tol=1e-11).x
        if max(map(abs, residuals(found))) > 1e-6 or np.abs(found[4:]).max() > 1:
            return math.nan
        return v * math.tan(float(found[3]))


def limits(airframe: Airframe, v: float, omega: float) -> Limits:
    """The envelope at ground speed v [m/s] in still air, turning at `omega` [rad/s] where a turn is meant."""
    bench = _Bench(airframe)
    try:
        bank = abs(bench.fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v), omega).roll)
    except FdmError:
        bank = math.nan
    climb, sink = (bench.climb(v, 0.0, throttle) for throttle in (1.0, 0.0))
    level = bench.fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v))
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
    throttle = 1.0 if zeta > 0 else 0.0

    def steady(speed: float) -> float:
        """Climb rate beyond the one asked for, positive where it can be had."""
        return math.copysign(1.0, zeta) * (bench.climb(speed, omega, throttle) - zeta)

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
    """`limits` at each of `speeds` [m/s], by default every metre per second the airframe is flown at."""
    if speeds is None:
        low, high = airframe.speeds.v_min_mps, airframe.speeds.v_max_mps
        speeds = np.linspace(low, high, max(2, round(high - low) + 1)).tolist()
    return [limits(airframe, v, box.omega) for v in speeds]
