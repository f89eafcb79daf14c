"""Finds out whether the vehicles can fly the evading manoeuvre steadily, in the scenario's wind."""

from __future__ import annotations

import math
from collections.abc import Sequence

from aircraft.airframes.schema import Airframe
from filters.barriers.pairs import Barrier
from testbed.scenario import fleet
from testbed.scenario.scenario import Scenario


def unflyable(s: Scenario, barrier: Barrier, airframes: Sequence[Airframe]) -> list[str]:
    """Why vehicles cannot fly gamma steadily, a sentence each; empty if all can.

    airframes  one per vehicle, where aircraft fly
    In steady wind the airspeed of a turn at constant ground speed swings by the wind speed to either side,
    and the airframe must trim at both ends. Kinematic plants can fly every input in U.
    """
    gamma = barrier.manoeuvre(s.vehicles)
    if s.plant != "jsbsim" or gamma is None:
        return []
    from aircraft.jsbsim.errors import FdmError, UnsteadyError
    from aircraft.jsbsim.trim import trim

    reasons, known, strangers = [], {}, fleet.intruders(s)
    for vehicle, airframe in enumerate(airframes):
        if vehicle in strangers:
            continue
        v, omega, zeta = (float(c[vehicle]) for c in (gamma.v, gamma.omega, gamma.zeta))
        for airspeed in sorted({v - s.wind.speed_mps, v + s.wind.speed_mps}):
            case = (airframe.name, airspeed, omega, zeta)
            if case not in known:
                try:
                    trim(airframe, airspeed, zeta, omega)
                    known[case] = ""
                except (FdmError, ValueError) as error:
                    known[case] = error.missing if isinstance(error, UnsteadyError) else str(error)
            if known[case]:
                reasons.append(
                    f"vehicle {vehicle + 1} ({airframe.name}) has no steady turn of"
                    f" {math.degrees(omega):.1f} deg/s at {airspeed:.1f} m/s: {known[case]}"
                )
    return reasons
