"""Checks the [[fence]] tables of a scenario against its vehicles, its manoeuvre and its remedies."""

from __future__ import annotations

from testbed.scenario.barrier import PairTurns
from testbed.scenario.contents import Contents


def check_fences(s: Contents) -> None:
    """Raises ValueError naming the first fence, from 1, that does not fit the scenario."""
    if not s.fence:
        return
    for number, fence in enumerate(s.fence, 1):
        beyond = [vehicle for vehicle in fence.vehicles if vehicle > s.vehicles]
        if beyond:
            raise ValueError(f"fence.{number}.vehicles: {beyond[0]}, but the vehicles are 1 to {s.vehicles}")
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
