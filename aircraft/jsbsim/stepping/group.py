"""Steps some aircraft one after another in this process."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import M_PER_FT, Origin, motion
from aircraft.jsbsim.rest import Start

NOT_FINITE, GROUND, UPSET, STALLED = "state not finite", "hit the ground", "upset", "stalled"
FAULTS = ("", NOT_FINITE, GROUND, UPSET, STALLED)
_GROUND_CONTACT_M = 0.3  # below this the belly skids touch
# Loss of control. The autopilot keeps alpha below alpha_max; at twice that both our wings are past the stall
# (X8 0.40 of 0.27 rad, Rascal 0.34 of 0.23). A gust's moment of it is no stall, and no command banks so far.
_STALL_SHARE, _STALL_S, _UPSET_RAD = 2.0, 0.1, math.radians(100.0)

Move = tuple[float, float, float, float]
"""Course [rad], ground speed [m/s], course rate [rad/s] and climb rate [m/s] of a vehicle."""


class Group:
    """Aircraft about one origin, to be started and stepped.

    airframes   one per vehicle
    turbulence  as in `JsbsimFleet`

    vehicles    the aircraft; empty until `start`
    moves       how each moves now
    faults      per vehicle one of `FAULTS`, "" for none
    """

    def __init__(
        self, airframes: Sequence[Airframe], dt: float, origin: Origin, turbulence: tuple[float, int] | None
    ) -> None:
        self._airframes, self._dt, self._origin = airframes, dt, origin
        self._turbulence = turbulence
        self.vehicles: list[Fdm] = []
        self.moves: list[Move] = []
        self.faults: list[str] = []

    def start(
        self,
        starts: Sequence[Start],
        seeds: Sequence[int | None],
        wanted: Callable[[], bool] = lambda: True,
    ) -> None:
        """Load the aircraft and trim each at its start; a vehicle's seed is of its random numbers.

        wanted  asked before each aircraft; False ends it there
        Raises  FdmError where an aircraft does not load, or has no steady flight there
        """
        self.vehicles = []
        for airframe in self._airframes:
            if not wanted():
                return
            self.vehicles.append(Fdm(airframe, self._dt, self._origin))
        for vehicle, at, seed in zip(self.vehicles, starts, seeds, strict=True):
            if not wanted():
                return
            vehicle.start(at)
            if seed is not None and self._turbulence:
                vehicle.turbulence(*self._turbulence, seed=seed)
            elif seed is not None:
                vehicle.seed(seed)
        self.faults = [""] * len(self.vehicles)
        most = [a.gain_values().get("envelope_alpha_max_rad", math.inf) for a in self._airframes]
        self._stall, self._stalled_s = [_STALL_SHARE * alpha for alpha in most], [0.0] * len(most)
        self._axes = self._origin.axes.tolist()
        self.moves = [(at.theta, 0.0, 0.0, 0.0) for at in starts]
        for i in range(len(self.vehicles)):
            self.moves[i] = self._motion(i)

    def step(
        self,
        asked: Sequence[Sequence[float]],
        winds: Sequence[Sequence[float]],
        n: int,
        readings: list[float] | None,
    ) -> list[float]:
        """Fly n periods; returns rows of `Fdm.run`, n of each vehicle that flew, one vehicle after another.

        asked, winds  one triple a vehicle: v, omega, zeta; m/s, east, north and up
        readings      takes every vehicle's `Fdm.readings`. Reading now takes a third of what it takes later,
                      when the aircraft has left the processor's cache. None reads nothing
        """
        rows: list[float] = []
        for i, vehicle in enumerate(self.vehicles):
            if not self.faults[i]:
                vehicle.command(*asked[i])
                east, north, up = winds[i]
                flown = vehicle.run((east, north, up), n)
                rows += flown
                self._arrive(i, flown, n * self._dt)
            if readings is not None:
                readings += vehicle.readings()
        return rows

    def position(self) -> list[float]:
        """Rows of `Fdm.position`, one a vehicle."""
        return [x for vehicle in self.vehicles for x in vehicle.position()]

    def readings(self) -> list[float]:
        """Every vehicle's `Fdm.readings`, one after another."""
        return [x for vehicle in self.vehicles for x in vehicle.readings()]

    def _arrive(self, i: int, flown: list[float], period: float) -> None:
        """Take in where vehicle i has flown in `period` [s], how it moves, and whether it met a fault.

        A vehicle that has met a fault keeps the course it had and is at rest.
        flown  rows of `Fdm.run`
        """
        moves = self._motion(i)
        if math.isfinite(sum(flown) + sum(moves)):
            fault = self._lost(i, flown[-1] * M_PER_FT - self._origin.ground_m, period)
        else:
            fault = NOT_FINITE
        if fault:
            self.faults[i], moves = fault, (self.moves[i][0], 0.0, 0.0, 0.0)
        self.moves[i] = moves

    def _lost(self, i: int, height: float, period: float) -> str:
        """The fault that vehicle i met, `height` [m] above ground, over `period` [s]; "" for none."""
        if height < _GROUND_CONTACT_M:
            return GROUND
        alpha, roll = self.vehicles[i].upset()
        if abs(roll) > _UPSET_RAD:
            return UPSET
        self._stalled_s[i] = self._stalled_s[i] + period if alpha > self._stall[i] else 0.0
        return STALLED if self._stalled_s[i] > _STALL_S else ""

    def _motion(self, i: int) -> Move:
        """Course of vehicle i, counting turns, and its rates."""
        course, v, omega, zeta = motion(self.vehicles[i].motion(), self._axes)
        before = self.moves[i][0]
        turned = course - before
        if math.isfinite(turned):
            course = before + (turned - 2 * math.pi * round(turned / (2 * math.pi)))
        return course, v, omega, zeta
