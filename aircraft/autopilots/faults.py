"""Names what makes an autopilot useless on its airframe: parameters of another aircraft, limits, instability.

- mis-scaled: the airspeeds or the feed-forward of roll of its parameters are another aircraft's
- saturated: a command of the airframe's own size is limited and not reached, or a deflection is at its stop
- unstable: `aircraft.autopilots.stability`

Each is one sentence with a remedy, for `testbed aircraft check` and `testbed tune`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aircraft.airframes.schema import INVERTING, Airframe
from aircraft.autopilots.linear_airframe import differentiate
from aircraft.autopilots.linear_autopilot import loops
from aircraft.autopilots.specification import CLIMB, climb_rate, duration, turn_rate
from aircraft.autopilots.stability import Instability, instabilities
from aircraft.equations.catalogue import values_of
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin, motions
from aircraft.jsbsim.rest import Start

_DT_S, _EVERY = 0.005, 20
_STOP = 0.98  # of full deflection
_MOST = 0.5  # of the time
_MISSED = 0.25  # of a step
_OTHER = 2.0  # times: a feed-forward that is more off is of another aircraft


@dataclass(frozen=True)
class Names:
    """What an autopilot's parameters are called.

    low, high, gains_at  airspeeds: least, largest, and where gains are as given
    roll_ff, per_travel  feed-forward of the roll rate, and how much aileron one of it gives
    limits   channel -> parameters that limit it
    gains    loop -> parameters that close it
    """

    low: str
    high: str
    gains_at: str
    roll_ff: str
    per_travel: float
    limits: Mapping[str, str]
    gains: Mapping[str, str]


_NAMES = {
    "arduplane": Names(
        "AIRSPEED_MIN",
        "AIRSPEED_MAX",
        "SCALING_SPEED",
        "RLL_RATE_FF",
        4 / math.pi,  # of 45 degrees
        {
            "v": "AIRSPEED_MIN, AIRSPEED_MAX, THR_MAX",
            "omega": "ROLL_LIMIT_DEG",
            "zeta": "TECS_CLMB_MAX, TECS_SINK_MAX, PTCH_LIM_MAX_DEG",
        },
        {
            "elevator": "PTCH_RATE_P, PTCH_RATE_I, PTCH_RATE_D",
            "aileron": "RLL_RATE_P, RLL_RATE_I, RLL_RATE_D",
            "throttle": "TECS_THR_DAMP, TECS_INTEG_GAIN",
            "rudder": "YAW2SRV_DAMP",
        },
    ),
    "px4": Names(
        "FW_AIRSPD_MIN",
        "FW_AIRSPD_MAX",
        "FW_AIRSPD_TRIM",
        "FW_RR_FF",
        1.0,
        {
            "v": "FW_AIRSPD_MIN, FW_AIRSPD_MAX, FW_THR_MAX",
            "omega": "FW_R_LIM",
            "zeta": "FW_T_CLMB_MAX, FW_T_SINK_MAX, FW_P_LIM_MAX",
        },
        {
            "elevator": "FW_PR_P, FW_PR_I",
            "aileron": "FW_RR_P, FW_RR_I",
            "throttle": "FW_T_THR_DAMPING, FW_T_THR_INTEG",
            "rudder": "FW_YR_P, FW_YR_I",
        },
    ),
}
# The sections of [gains] that close a loop, and that limit a channel.
_SECTIONS = {"elevator": "climb", "throttle": "speed", "aileron": "turn", "rudder": "rudder"}


@dataclass(frozen=True)
class Fault:
    """One thing wrong with an autopilot.

    kind     mis-scaled, saturated or unstable, with which `what` begins
    setting  of airframe.toml, where it is set: parameters.NAME or gains.SECTION; "" where nothing there is
    """

    kind: str
    what: str
    remedy: str
    setting: str

    def __str__(self) -> str:
        return f"{self.what}; {self.remedy}"


def in_short(found: Sequence[Fault]) -> list[str]:
    """One line for each remedy: the first fault that it is for, and how many more there are."""
    by_remedy: dict[str, list[Fault]] = {}
    for fault in found:
        by_remedy.setdefault(fault.remedy, []).append(fault)
    more = {1: "", 2: " (and once more)"}
    return [
        f"{of[0].what}{more.get(len(of), f' (and {len(of) - 1} times more)')}; {remedy}"
        for remedy, of in by_remedy.items()
    ]


def faults(airframe: Airframe) -> list[Fault]:
    """What is wrong, of one kind: parameters of another aircraft make it unstable and saturated as well, and
    an unstable autopilot reaches no command.

    Raises  FdmError where the airframe cannot fly level
    """
    if found := mis_scaled(airframe):
        return found
    unstable = [unstable_fault(airframe, motion) for motion in instabilities(airframe)]
    return unstable or list(saturated(airframe))


def unstable_fault(airframe: Airframe, found: Instability) -> Fault:
    """An unstable motion, with the gains that close its loop."""
    names = _NAMES.get(airframe.autopilot)
    said = str(found)
    if airframe.autopilot == INVERTING:
        section = f"gains.{_SECTIONS[found.loop]}"
        return Fault("unstable", said, f"lower the gains of [{section}]", section)
    if names is None:
        return Fault("unstable", said, f"lower the gains of {airframe.autopilot} there", "")
    gains = names.gains[found.loop]
    return Fault("unstable", said, f"lower {gains}", f"parameters.{gains.partition(',')[0]}")


def mis_scaled(airframe: Airframe) -> list[Fault]:
    """Whether airspeeds and feed-forward of ArduPlane's or PX4's parameters are this aircraft's; one line."""
    names = _NAMES.get(airframe.autopilot)
    if names is None:
        return []
    p, v, said = values_of(airframe), airframe.speeds.start_mps, []
    if not p[names.low] <= v <= p[names.high]:
        said.append(
            f"{names.low} {p[names.low]:g} and {names.high} {p[names.high]:g} m/s leave out its {v:g} m/s"
        )
    if not 1 / _OTHER <= p[names.gains_at] / v <= _OTHER:
        said.append(f"{names.gains_at} is {p[names.gains_at]:g} m/s")
    needed = roll_feedforward(airframe, v) / names.per_travel * v / p[names.gains_at]
    share = p[names.roll_ff] / needed
    if not 1 / _OTHER <= share <= _OTHER:
        said.append(f"{names.roll_ff} is {p[names.roll_ff]:.3g}, its ailerons need {needed:.3g}")
    if not said:
        return []
    what = f"mis-scaled: the parameters are another aircraft's: {', and '.join(said)}"
    return [Fault("mis-scaled", what, "take this aircraft's parameter file", f"parameters.{names.roll_ff}")]


def roll_feedforward(airframe: Airframe, v: float) -> float:
    """Aileron [share of full deflection] that holds a roll rate of 1 rad/s at v [m/s], without yaw."""
    names = loops(airframe)
    point = differentiate(airframe, v, _DT_S, names)
    return float(abs(point.a[6, 6] / point.b[6, list(names).index("aileron")]))


def saturated(airframe: Airframe) -> Iterator[Fault]:
    """Commands of the airframe's own size that a limit keeps it from reaching, and deflections at a stop."""
    speeds = airframe.speeds
    v, fast, slow = speeds.start_mps, speeds.within(0.9), speeds.within(0.1)
    climb = 2.0 * climb_rate(speeds) / CLIMB
    turn = turn_rate(speeds, v)
    asked = (
        ("omega", (v, turn, 0.0), 0.0, turn, 10.0, f"a turn of {math.degrees(turn):.3g} deg/s at {v:g} m/s"),
        ("zeta", (v, 0.0, climb), 0.0, climb, 15.0, f"a climb of {climb:.2g} m/s at {v:g} m/s"),
        ("v", (fast, 0.0, 0.0), v, fast, 25.0, f"{fast:g} m/s from {v:g} m/s"),
        ("v", (slow, 0.0, 0.0), v, slow, 25.0, f"{slow:g} m/s from {v:g} m/s"),
    )
    stops: dict[str, str] = {}
    for channel, command, before, after, seconds, case in asked:
        limited, ends, at_stop = _flown(airframe, channel, command, duration(speeds, seconds))
        missed = abs(ends - after) / abs(after - before)
        if limited > _MOST and missed > _MISSED:
            shown = f"{math.degrees(ends):.2g} deg/s" if channel == "omega" else f"{ends:.3g} m/s"
            what = f"saturated: {case} is limited {limited:.0%} of the time and ends at {shown}"
            yield Fault("saturated", what, *_widen(airframe, channel))
        for name, share in at_stop.items():
            if share > _MOST:
                stops.setdefault(
                    name, f"saturated: the {name} is at its stop {share:.0%} of the time in {case}"
                )
    for name, what in stops.items():
        remedy, setting = _ease(airframe, name)
        yield Fault("saturated", what, remedy, setting)


def _flown(
    airframe: Airframe, channel: str, command: Sequence[float], seconds: float
) -> tuple[float, float, dict[str, float]]:
    """A step from level flight, its second half: share of time limited, value at its end, share at stops."""
    index = ("v", "omega", "zeta").index(channel)
    fdm = Fdm(airframe, _DT_S, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, airframe.speeds.start_mps))
    limit = fdm.node(f"ap/limited-{channel}")
    sent = {name: fdm.node(f"ap/{name}-norm") for name in loops(airframe)}
    fdm.command(*command)
    count = round(seconds / (_DT_S * _EVERY))
    moves, limited, stops = [], [], {name: 0 for name in sent}
    for k in range(count):
        fdm.run((0.0, 0.0, 0.0), _EVERY)
        if k < count // 2:
            continue
        moves.append(fdm.motion())
        limited.append(limit.get_double_value() != 0.0)
        for name, node in sent.items():
            value = node.get_double_value()
            least = value <= 1 - _STOP if name == "throttle" else value <= -_STOP
            stops[name] += value >= _STOP or least
    rates = motions(moves, fdm.origin)[1]
    of = len(limited)
    return (
        float(np.mean(limited)),
        float(np.mean(rates[-10:, index])),
        {name: n / of for name, n in stops.items()},
    )


def _widen(airframe: Airframe, channel: str) -> tuple[str, str]:
    """What limits a channel: the remedy, and where it is set."""
    names = _NAMES.get(airframe.autopilot)
    if airframe.autopilot == INVERTING:
        return "widen [gains.envelope], or narrow [speeds]", "gains.envelope"
    if names is None:
        return f"widen the limits of {airframe.autopilot}, or narrow [speeds]", ""
    limits = names.limits[channel]
    return f"widen {limits}, or narrow [speeds]", f"parameters.{limits.partition(',')[0]}"


def _ease(airframe: Airframe, loop: str) -> tuple[str, str]:
    """What drives a deflection to its stop: the remedy, and where it is set."""
    names = _NAMES.get(airframe.autopilot)
    if airframe.autopilot == INVERTING:
        section = f"gains.{_SECTIONS[loop]}"
        return f"lower the gains of [{section}]", section
    if names is None:
        return f"lower the gains of {airframe.autopilot} there", ""
    gains = names.gains[loop]
    return f"lower {gains}, or the speeds asked for", f"parameters.{gains.partition(',')[0]}"
