"""Loop gains from time constants of the aircraft: roll mode, short period, lift, actuators and thrust."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aircraft.adopt.controls import Controls
from aircraft.adopt.derivatives import Local
from aircraft.adopt.feedforward import roll_time
from aircraft.adopt.speeds import Found

Gains = dict[str, float]

_SAMPLING_S = 0.012  # of the loop: two periods and the filter of the course rate, beside the actuator
_BANK_RAD_OF_STEP = 0.45  # of the turn that the bandwidth is for
_ROLL_SHARE = 0.55  # of the ailerons' travel, that such a turn may take


@dataclass(frozen=True)
class Scales:
    """Factors on what the formulas give: a search finds them."""

    turn: float = 1.0  # bandwidth of turns
    turn_lag: float = 1.0  # lag of the turn's model
    climb: float = 1.0  # bandwidth of climbs
    climb_lag: float = 1.0
    pitch: float = 1.0  # feedback of angle of attack and pitch rate
    roll: float = 1.0  # feedback of bank and roll rate
    speed: float = 1.0  # bandwidth of speed
    speed_lag: float = 1.0
    hold: float = 1.0  # feedback of speed
    side: float = 0.0  # share of the side force that bank answers
    yaw: float = 1.0  # feedback of sideslip and yaw rate


@dataclass(frozen=True)
class Times:
    """Time constants and accelerations at the middle of the speeds, the slowest where they differ."""

    roll: float
    aileron: float
    elevator: float
    thrust: float
    short_period: float  # rad/s
    damping: float  # 2 zeta omega of the short period
    lift: float  # 1/s, L_alpha
    roll_power: float  # rad/s^2 at full aileron
    roll_rate: float  # rad/s at full aileron
    speed: float  # m/s


def times(locals_: Sequence[Local], controls: Controls, thrust_lag: float) -> Times:
    """Of the aircraft, from its derivatives."""
    x = locals_[len(locals_) // 2]
    lift = x.lift["alpha"] / x.v
    damping = lift - x.pitch["q"] - x.pitch["alphadot"]
    stiffness = -x.pitch["alpha"] - x.pitch["q"] * lift
    power = min(abs(y.roll["aileron"] * controls.aileron.travel) for y in locals_)
    return Times(
        roll=max(roll_time(y) for y in locals_),
        aileron=controls.aileron.lag + _SAMPLING_S,
        elevator=controls.elevator.lag + _SAMPLING_S,
        thrust=thrust_lag,
        short_period=math.sqrt(max(stiffness, 0.0)),
        damping=damping,
        lift=lift,
        roll_power=power,
        roll_rate=power * roll_time(x),
        speed=x.v,
    )


def loop_gains(
    t: Times, locals_: Sequence[Local], controls: Controls, airframe: Gains, scales: Scales
) -> dict[str, Gains]:
    """[gains.turn], climb, speed and rudder."""
    found = {
        "turn": _turn(t, airframe, scales),
        "climb": _climb(t, airframe, scales),
        "speed": _speed(t, scales),
    }
    if controls.rudder is not None:
        found["rudder"] = {name: scales.yaw * gain for name, gain in _rudder(locals_).items()}
    return found


def _turn(t: Times, airframe: Gains, s: Scales) -> Gains:
    omega = min(2.4 / t.roll, 0.45 / t.aileron, 9.0) * math.sqrt(s.roll)
    rate = min(max(2 * 0.85 * omega * t.roll - 1.0, 0.0), 0.5 * t.roll / t.aileron)
    bandwidth = min(
        8.0,
        0.95 * omega,
        math.sqrt(_ROLL_SHARE * t.roll_power / _BANK_RAD_OF_STEP),
        t.roll_rate / 0.17,
    )
    bandwidth *= s.turn
    return {
        "aileron_rad": 0.6 * airframe["aileron_max_rad"],
        "bandwidth_radps": bandwidth,
        "damping": 1.0,
        "feedback": 0.12,
        "model_lag_s": max((t.aileron + 0.25 / omega) * s.turn_lag, 0.02),
        "side_share": s.side,
        "integral_per_s": 0.05 * bandwidth,
        "rate_feedback": rate,
        "bank_feedback_per_s": omega**2 * t.roll,
        "servo_lead_s": max(t.aileron - _SAMPLING_S, 0.0),
        "filter_s": 0.02,
    }


def _climb(t: Times, airframe: Gains, s: Scales) -> Gains:
    wanted = min(max(1.35 * t.short_period, 1.2 * t.lift + 0.8), 0.45 / t.elevator)
    omega = max(t.short_period, wanted) * math.sqrt(s.pitch)
    per_qdot = abs(airframe["elevator_per_qdot_m"])
    reference = 1.3 * omega
    # What changes lift must not be asked faster than the wing answers.
    bandwidth = 0.28 * reference * s.climb
    return {
        "elevator_rad": 0.35 * airframe["elevator_max_rad"],
        "bandwidth_radps": bandwidth,
        "filter_radps": reference,
        "filter_damping": 0.95,
        "model_lag_s": max((t.elevator + 0.2 / omega) * s.climb_lag, 0.02),
        "push_mps2": 5.5,
        "pull_mps2": 8.3,
        "feedback_per_s": 0.4 * bandwidth,
        "integral_per_s2": 0.05 * bandwidth**2,
        "alpha_feedback_mps2": max(omega**2 - t.short_period**2, 0.0) * per_qdot,
        "q_feedback_mps": max(1.6 * omega - t.damping, 0.0) * per_qdot,
        "servo_lead_s": max(t.elevator - _SAMPLING_S, 0.0),
    }


def _speed(t: Times, s: Scales) -> Gains:
    lag = max(t.thrust, 0.1)
    bandwidth = min(0.9 / lag, 3.2) * s.speed
    feedback = min(0.55 / lag, 2.0) * s.hold
    return {
        "bandwidth_radps": bandwidth,
        "filter_s": max(0.75 * lag, 0.1),
        "feedback_per_s": feedback,
        "integral_per_s2": 0.15 * feedback * min(0.9 / lag, 3.2),
        "model_lag_s": max(0.15 * lag * s.speed_lag, 0.03),
        "thrust_lead_s": lag,
        "release_per_s": 4.0 / max(lag / 0.2, 1.0),
        "reserved_mps2": 0.3,
        "window_mps": 1.5 * max(t.speed / 20.0, 0.5),
    }


def _rudder(locals_: Sequence[Local]) -> Gains:
    """Weathercock stability raised to 0.8 per s^2, Dutch roll damped by a half."""
    feedback, rate = [], []
    for x in locals_:
        power = abs(x.yaw["rudder"])
        stiffness = max(x.yaw["beta"], 0.8)
        feedback.append(max(0.8 - x.yaw["beta"], 0.0) / power)
        has = -x.yaw["r"] - x.side_by_beta / x.v
        rate.append(max(2 * 0.5 * math.sqrt(stiffness) - has, 0.0) / power * x.v)
    return {"feedback": float(np.mean(feedback)), "rate_feedback_m": float(np.mean(rate))}


def envelope_gains(found: Found, locals_: Sequence[Local], airframe: Gains, level: Gains) -> Gains:
    """[gains.envelope]: airspeeds, angles of attack and lift that the autopilot keeps within."""
    slow = found.stall + 0.6 * (found.lowest - found.stall)
    alpha_max = max(0.75 * found.stall_alpha, found.trims[0].alpha + 0.02)
    at_most = level["cl1"] + airframe["cl_alpha"] * alpha_max
    alphas = [x.trim.alpha for x in locals_]
    return {
        "airspeed_min_mps": slow,
        "airspeed_max_mps": min(1.2 * found.highest, max(1.02 * found.top, 1.1 * found.highest)),
        "slack_mps": 0.5 * max(found.lowest / 15.0, 0.5),
        "exchange_per_s": 1.0,
        "cl_turn": min(0.82 * at_most, 0.85 * found.cl_max),
        "bank_tan_max": 1.2,
        "alpha_min_rad": min(min(alphas) - 0.08, -0.08),
        "alpha_max_rad": alpha_max,
    }
