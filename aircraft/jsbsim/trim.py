"""Steady flight of an airframe over its speeds, climb rates and turn rates; what a feed-forward learns of it.

    python -m aircraft.jsbsim.trim x8

prints the lines of `[gains.airframe]` that are fitted to level trims.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable

import numpy as np

from aircraft.airframes.schema import Airframe, folder_of, read_airframe
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import G_MPS2, Origin
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.steady import Trim

_ANY_DT_S = 0.005  # trim does not move


def trim(
    airframe: Airframe, v: float, zeta: float = 0.0, omega: float = 0.0, altitude: float = 300.0
) -> Trim:
    """Steady flight at ground speed v [m/s] in still air, climb rate zeta [m/s], course rate omega [rad/s].

    altitude  m above the ellipsoid
    Raises    FdmError if the airframe has none there.
    """
    fdm = Fdm(airframe, _ANY_DT_S, Origin(altitude_m=altitude))
    return fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v, zeta), omega)


def trim_map(
    airframe: Airframe,
    speeds: Iterable[float],
    climbs: Iterable[float] = (0.0,),
    turns: Iterable[float] = (0.0,),
) -> dict[tuple[float, float, float], Trim | None]:
    """Trim at every (v, zeta, omega) [m/s, m/s, rad/s]; None where the airframe cannot fly steadily."""
    fdm = Fdm(airframe, _ANY_DT_S, Origin())
    climbs, turns = list(climbs), list(turns)
    found: dict[tuple[float, float, float], Trim | None] = {}
    for v in speeds:
        for zeta in climbs:
            for omega in turns:
                try:
                    found[v, zeta, omega] = fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v, zeta), omega)
                except FdmError:
                    found[v, zeta, omega] = None
    return found


def feedforward(airframe: Airframe, count: int = 15) -> dict[str, float]:
    """Lift curve and elevator to trim over angle of attack, drag over lift, fitted to level trims.

    They are spaced evenly in lift coefficient, from a tenth above the highest speed flown to the lowest
    airspeed of the envelope. Lift is all that carries the aircraft, the thrust's share included; drag is what
    the thrust formula gives.
    """
    g = airframe.gain_values()
    slow, fast = g["envelope_airspeed_min_mps"], 1.1 * airframe.speeds.v_max_mps
    fdm = Fdm(airframe, _ANY_DT_S, Origin())
    rows = []
    for v in 1 / np.sqrt(np.linspace(fast**-2, slow**-2, count)):
        at = fdm.trim(Start(0.0, 0.0, 0.0, 0.0, float(v)))
        per_cl = fdm.read("ap/lift-per-cl-mps2")
        driven = v + at.throttle * (g["airframe_motor_speed_mps"] - v)
        drag = g["airframe_thrust_area_share"] * driven * (driven - v) / v**2
        rows.append((at.alpha, G_MPS2 / per_cl, at.elevator * g["airframe_elevator_norm_rad"], drag))
    alpha, lift, elevator, drag = np.array(rows).T
    cl_alpha, cl_0 = np.polyfit(alpha, lift, 1)
    per_alpha2, per_alpha, elevator_0 = np.polyfit(alpha, elevator, 2)
    cd_2, cd_1, cd_0 = np.polyfit(lift, drag, 2)
    fitted = {
        "cl_0": cl_0, "cl_alpha": cl_alpha, "cd_0": cd_0, "cd_1": cd_1, "cd_2": cd_2,
        "elevator_0_rad": elevator_0, "elevator_per_alpha": per_alpha,
        "elevator_per_alpha2": per_alpha2,
    }  # fmt: skip
    return {name: float(value) for name, value in fitted.items()}


def main(name: str) -> None:
    """Print the fitted lines of an airframe."""
    for key, value in feedforward(read_airframe(folder_of(name))).items():
        print(f"{key} = {value:.6g}")


if __name__ == "__main__":
    main(sys.argv[1])
