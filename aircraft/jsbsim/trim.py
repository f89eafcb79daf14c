"""Steady flight of an airframe over its speeds, climb rates and turn rates."""

from __future__ import annotations

from collections.abc import Iterable

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
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
