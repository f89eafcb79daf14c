"""Checks the [[fence]] tables of a scenario against its vehicles, their manoeuvres and its remedies."""

from __future__ import annotations

from testbed.scenario import fleet
from testbed.scenario.barrier import PairTurns
from testbed.scenario.contents import Contents
from testbed.scenario.fence import Fence, HeightBand, KeepIn, KeepOut


def check_fences(s: Contents) -> None:
    """Raises ValueError naming the first fence, from 1, that does not fit the scenario."""
    if not s.fence:
        return
    for number, fence in enumerate(s.fence, 1):
        _check_vehicles(s, f"fence.{number}.vehicles", fence.vehicles)
    if isinstance(s.barrier, PairTurns):
        raise ValueError(
            "fence: needs one evading manoeuvre of each vehicle, and barrier.shared = false gives each pair"
            " its own; leave out one of them"
        )
    if s.remedy.air_mass:
        raise ValueError(
            "remedy.air_mass: a turn flown in moving air drifts over the ground and leaves every fence; leave"
            " out the remedy or the fences"
        )
    for number, fence in enumerate(s.fence, 1):
        for vehicle in fenced(s, fence):
            _check_manoeuvre(s, number, fence, vehicle)


def fenced(s: Contents, fence: Fence) -> list[int]:
    """The vehicles, from 1 and ascending, that a fence is for: all under the filter, where it lists none."""
    strangers = fleet.intruders(s)
    return sorted(fence.vehicles) or [k + 1 for k in range(s.vehicles) if k not in strangers]


def _check_vehicles(s: Contents, where: str, listed: list[int]) -> None:
    strangers = fleet.intruders(s)
    for vehicle in listed:
        if vehicle > s.vehicles:
            raise ValueError(f"{where}: {vehicle}, but the vehicles are 1 to {s.vehicles}")
        if vehicle - 1 in strangers:
            raise ValueError(f"{where}: vehicle {vehicle} is an intruder, which no filter keeps in a fence")


def _check_manoeuvre(s: Contents, number: int, fence: Fence, vehicle: int) -> None:
    m = fleet.manoeuvre(fleet.barrier(s), vehicle - 1)
    if isinstance(fence, HeightBand):
        if m.zeta_mps:
            raise ValueError(
                f"fence.{number}: the manoeuvre of vehicle {vehicle} climbs at {m.zeta_mps:g} m/s and leaves"
                " every height band; give it no climb"
            )
    elif m.omega_degps == 0 and isinstance(fence, KeepIn):
        raise ValueError(
            f"fence.{number}: the manoeuvre of vehicle {vehicle} is straight flight and leaves every area to"
            " stay in; give it one that turns"
        )
    elif m.omega_degps == 0 and isinstance(fence, KeepOut) and fence.polygon_m is not None:
        raise ValueError(
            f"fence.{number}: straight flight of vehicle {vehicle} past a polygon is not computed; give a"
            " circle around it, or a manoeuvre that turns"
        )
