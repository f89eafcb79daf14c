"""The autopilot's feed-forward from derivatives, thrusts and trims: [gains.airframe], level and thrust."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from aircraft.adopt.controls import Controls
from aircraft.adopt.derivatives import Local
from aircraft.adopt.rig import Rig
from aircraft.adopt.thrust import Thrust
from aircraft.airframes.setup import Engines
from aircraft.jsbsim.geodesy import G_MPS2

KNOTS = 5  # airspeeds at which the autopilot knows level flight and thrust
_ELEVATOR_SHARE = 0.86  # of elevons that pitch may take: roll always keeps a seventh
_SEPARATE = 2.0  # travels: surfaces of their own take nothing from each other

Gains = dict[str, float]


def airframe_gains(rig: Rig, locals_: Sequence[Local], controls: Controls) -> Gains:
    """[gains.airframe]: the combinations that the equations use, averaged over the trims."""

    def mean(value: Callable[[Local], float]) -> float:
        return float(np.mean([value(x) for x in locals_]))

    elevator, aileron = controls.elevator, controls.aileron
    drag = _drag_by_lift(locals_)
    gains = {
        "mass_kg": rig.mass,
        "wing_area_m2": rig.wing_area,
        "cl_alpha": mean(lift_slope),
        "cl_q_m": mean(
            lambda x: (x.lift["q"] + x.lift["elevator"] * _elevator(x, "q")) / x.lift_per_cl * x.v
        ),
        "cd_1": drag[0],
        "cd_2": drag[1],
        "elevator_per_alpha": mean(lambda x: _elevator(x, "alpha")),
        "elevator_per_alpha2": 0.0,
        "elevator_per_q_m": mean(lambda x: _elevator(x, "q") * x.v),
        "elevator_per_alphadot_m": mean(lambda x: _elevator(x, "alphadot") * x.v),
        "elevator_per_qdot_m": mean(lambda x: x.lift_per_cl / x.pitch["elevator"]),
        "aileron_per_p_m": mean(lambda x: -x.roll["p"] / x.roll["aileron"] * x.v),
        "aileron_per_r_m": mean(lambda x: -x.roll["r"] / x.roll["aileron"] * x.v),
        "aileron_per_beta": mean(lambda x: -x.roll["beta"] / x.roll["aileron"]),
        "roll_lag_m": mean(lambda x: x.v * roll_time(x)),
        "elevator_max_rad": abs(elevator.travel) * (_ELEVATOR_SHARE if controls.shared else 1.0),
        "aileron_max_rad": abs(aileron.travel),
        "shared_max_rad": _shared(controls),
        "elevator_norm_rad": elevator.travel,
        "aileron_norm_rad": aileron.travel,
    }
    if controls.rudder is not None:
        gains |= {
            "rudder_per_r_m": mean(lambda x: -x.yaw["r"] / x.yaw["rudder"] * x.v),
            "rudder_per_rdot_m": mean(lambda x: x.lift_per_cl / x.yaw["rudder"]),
            "rudder_per_aileron": mean(lambda x: -x.yaw["aileron"] / x.yaw["rudder"]),
            "rudder_max_rad": abs(controls.rudder.travel),
            "rudder_norm_rad": controls.rudder.travel,
        }
    return gains


def level_gains(locals_: Sequence[Local], controls: Controls, airframe: Gains) -> Gains:
    """[gains.level]: at each of KNOTS airspeeds what level flight needs beside the slopes."""
    gains: Gains = {}
    for k, x in enumerate(locals_, 1):
        cl, t = G_MPS2 / x.lift_per_cl, x.trim
        gains[f"v{k}_mps"] = x.v
        gains[f"cl{k}"] = cl - airframe["cl_alpha"] * t.alpha
        gains[f"cd{k}"] = x.drag / x.lift_per_cl - (airframe["cd_1"] + airframe["cd_2"] * cl) * cl
        gains[f"elevator{k}_rad"] = (
            t.elevator * airframe["elevator_norm_rad"] - airframe["elevator_per_alpha"] * t.alpha
        )
        aileron = t.aileron * airframe["aileron_norm_rad"]
        gains[f"aileron{k}_rad"] = aileron - airframe["aileron_per_beta"] * t.beta
        if controls.rudder is not None:
            trim = t.rudder * airframe["rudder_norm_rad"] - airframe["rudder_per_aileron"] * aileron
            gains[f"rudder{k}_rad"] = trim
    return gains


def thrust_gains(thrusts: Sequence[Thrust], engines: Engines) -> Gains:
    """[gains.thrust]: the thrust at each of KNOTS airspeeds."""
    gains = {"idle": engines.idle, "full": engines.full}
    for k, thrust in enumerate(thrusts, 1):
        gains[f"max{k}_mps2"], gains[f"min{k}_mps2"] = thrust.most, thrust.least
        for j, share in enumerate(thrust.shares, 1):
            gains[f"share{k}_{j}"] = share
    return gains


def lift_slope(x: Local) -> float:
    """Lift coefficient by angle of attack, the elevator trimming the moment [1/rad]."""
    return (x.lift["alpha"] + x.lift["elevator"] * _elevator(x, "alpha")) / x.lift_per_cl


def roll_time(x: Local) -> float:
    """The roll mode's time constant [s]; long for a wing without roll damping."""
    return 1.0 / max(-x.roll["p"], 0.05)


def _elevator(x: Local, name: str) -> float:
    """The elevator [rad] that balances the pitching moment of one unit of `name`."""
    return -x.pitch[name] / x.pitch["elevator"]


def _drag_by_lift(locals_: Sequence[Local]) -> tuple[float, float]:
    """cd_1 and cd_2: drag by lift coefficient is cd_1 + 2 cd_2 CL, fitted to its slopes at the trims."""
    cl = [G_MPS2 / x.lift_per_cl for x in locals_]
    slopes = [x.drag_by_alpha / x.lift["alpha"] if x.lift["alpha"] else 0.0 for x in locals_]
    rise, at_zero = np.polyfit(cl, slopes, 1)
    if rise > 0.0:
        return float(at_zero), float(rise / 2)
    return 0.0, max(float(np.mean(np.array(slopes) / (2 * np.array(cl)))), 0.0)


def _shared(controls: Controls) -> float:
    """Travel [rad] that elevator and aileron have together."""
    most = max(abs(controls.elevator.travel), abs(controls.aileron.travel))
    apart = min(_SEPARATE * most + abs(controls.elevator.travel), 1.57)  # as an angle may be
    return most if controls.shared else apart
