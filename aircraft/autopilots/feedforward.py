"""Fits the autopilot's feed-forward of lift, drag and elevator to level trims of the model."""

from __future__ import annotations

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import G_MPS2, Origin
from aircraft.jsbsim.rest import Start

_ANY_DT_S = 0.005  # trim does not move
_ROUNDING = 1e-9  # a coefficient below is what rounding leaves of zero
_LEAST = 6  # trims that a fit needs


def feedforward(airframe: Airframe, count: int = 15) -> dict[str, float]:
    """Lift curve and elevator to trim over angle of attack, drag over lift, fitted to level trims.

    The trims are spaced evenly in lift coefficient, from a tenth above the highest speed flown to the lowest
    airspeed of the envelope; of those outside [speeds], only the ones that exist count. Lift is all that
    carries the aircraft, the thrust's share included; drag is what the thrust formula gives.
    Returns  name in [gains.airframe] -> value, of the names `provenance.FITTED`
    Raises   FdmError if the airframe cannot fly level at a speed within [speeds]
    """
    g = airframe.gain_values()
    slow, fast = g["envelope_airspeed_min_mps"], 1.1 * airframe.speeds.v_max_mps
    fdm = Fdm(airframe, _ANY_DT_S, Origin())
    rows = []
    for v in (1 / np.sqrt(np.linspace(fast**-2, slow**-2, count))).tolist():
        try:
            at = fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v))
        except FdmError:
            if airframe.speeds.v_min_mps <= v <= airframe.speeds.v_max_mps:
                raise
            continue
        per_cl = fdm.read("ap/lift-per-cl-mps2")
        driven = v + at.throttle * (g["airframe_motor_speed_mps"] - v)
        drag = g["airframe_thrust_area_share"] * driven * (driven - v) / v**2
        rows.append((at.alpha, G_MPS2 / per_cl, at.elevator * g["airframe_elevator_norm_rad"], drag))
    if len(rows) < _LEAST:
        raise FdmError(
            f"{airframe.name} flies level at {len(rows)} of {count} speeds from {slow:g} to {fast:.3g} m/s;"
            f" a fit needs {_LEAST}: check [speeds] and envelope.airspeed_min_mps"
        )
    alpha, lift, elevator, drag = np.array(rows).T
    cl_alpha, cl_0 = np.polyfit(alpha, lift, 1)
    per_alpha2, per_alpha, elevator_0 = np.polyfit(alpha, elevator, 2)
    cd_2, cd_1, cd_0 = np.polyfit(lift, drag, 2)
    fitted = {
        "cl_0": cl_0, "cl_alpha": cl_alpha, "cd_0": cd_0, "cd_1": cd_1, "cd_2": cd_2,
        "elevator_0_rad": elevator_0, "elevator_per_alpha": per_alpha,
        "elevator_per_alpha2": per_alpha2,
    }  # fmt: skip
    return {name: 0.0 if abs(value) < _ROUNDING else float(value) for name, value in fitted.items()}
