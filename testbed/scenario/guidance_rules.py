"""Checks the guidance of each vehicle against its limits, and whether it has a goal."""

from __future__ import annotations

from collections.abc import Iterator
from math import radians

import numpy as np
from numpy.typing import NDArray

from testbed.scenario import fleet
from testbed.scenario.contents import Contents
from testbed.scenario.guidance import (
    EvadingManoeuvre,
    Guidance,
    Hold,
    Layers,
    Loiter,
    NearIdentity,
    RecordedTrack,
    Roundabout,
    Waypoints,
)
from testbed.scenario.tables import InputSet
from testbed.scenario.track_file import shorter


def check_guidance(s: Contents) -> None:
    """Raises ValueError naming the first table whose guidance its vehicle cannot fly within its limits."""
    if not s.vehicle and not isinstance(s.guidance, Hold | Waypoints | Loiter | Layers | Roundabout):
        return
    for table, where, box in _each(s):
        speeds = _speeds(table)
        for speed in speeds:
            if not box.v_min_mps <= speed <= box.v_max_mps:
                raise ValueError(
                    f"{where}.speed_mps: {speed:g} m/s is outside the limits {box.v_min_mps:g} to"
                    f" {box.v_max_mps:g} m/s"
                )
        if isinstance(table, Loiter | Roundabout):
            _check_circle(table, where, box)
        if isinstance(table, Layers):
            _check_layers(table, where, box, s.d_safe_m)


def _check_layers(table: Layers, where: str, box: InputSet, d_safe: float) -> None:
    if box.zeta_max_mps == 0:
        raise ValueError(f"{where}.kind: with limits.zeta_max_mps = 0 no layer can be climbed to")
    if table.climb_mps is not None and table.climb_mps > box.zeta_max_mps:
        raise ValueError(
            f"{where}.climb_mps: {table.climb_mps:g} m/s is above the limit {box.zeta_max_mps:g} m/s"
        )
    if table.spacing_m is not None and table.spacing_m < d_safe:
        raise ValueError(
            f"{where}.spacing_m: {table.spacing_m:g} m is below Ds, d_safe_m = {d_safe:g} m: vehicles in"
            " neighbouring layers would not be apart; give more, or leave it out"
        )


def _check_circle(table: Loiter | Roundabout, where: str, box: InputSet) -> None:
    if box.omega_max_degps == 0:
        raise ValueError(f"{where}.radius_m: with limits.omega_max_degps = 0 no circle can be flown")
    if table.radius_m is None:
        return
    least = table.speed_mps / radians(box.omega_max_degps)
    if table.radius_m < least * (1 - 1e-9):
        raise ValueError(
            f"{where}.radius_m: {table.radius_m:g} m at {table.speed_mps:g} m/s takes"
            f" {table.speed_mps / table.radius_m / radians(1):.3g} deg/s and the limit is"
            f" {box.omega_max_degps:g} deg/s; give {least:.4g} m or more, or fly slower"
        )


def _each(s: Contents) -> Iterator[tuple[Guidance, str, InputSet]]:
    """The guidance of each vehicle, what says it, and the vehicle's limits."""
    for k, (table, box) in enumerate(zip(fleet.guidances(s), fleet.limits(s), strict=True)):
        own = s.vehicle and s.vehicle[k].guidance is not None
        yield table, f"vehicle.{k + 1}.guidance" if own else "guidance", box


def _speeds(table: Guidance) -> list[float]:
    match table:
        case Hold() | Loiter() | Layers() | Roundabout():
            return [table.speed_mps]
        case Waypoints():
            return table.places()[1]
    return []


def notes(s: Contents) -> list[str]:
    """What a person should know of the guidance although it is no mistake."""
    said = {
        where: table.rows[-1][0] - table.rows[0][0]
        for table, where, _box in _each(s)
        if isinstance(table, RecordedTrack)
    }
    return list(shorter(list(said.items()), s.duration_s))


def goals(s: Contents) -> dict[int, list[float]]:
    """Vehicle (from 0) -> the goal (x, y, z) [m] that its guidance gives it: its last waypoint."""
    found = {}
    for k, table in enumerate(fleet.guidances(s)):
        own = s.vehicle and s.vehicle[k].goal_x_m is not None
        if isinstance(table, Waypoints) and not table.closed and not own:
            found[k] = table.places()[0][-1]
    return found


def goalless(s: Contents) -> tuple[int, ...]:
    """Vehicles (from 0) without a goal: their guidance seeks none, and their table gives none."""
    without = []
    for k, table in enumerate(fleet.guidances(s)):
        own = s.vehicle and s.vehicle[k].goal_x_m is not None
        seeks_none = isinstance(table, Hold | Loiter | RecordedTrack) or (
            isinstance(table, Waypoints) and table.closed
        )
        if seeks_none and not own:
            without.append(k)
    return tuple(without)


def seeking(s: Contents) -> NDArray[np.bool_]:
    """(N,) whether each vehicle has a goal."""
    found = np.ones(s.vehicles, dtype=bool)
    found[list(goalless(s))] = False
    return found


def straight_to_goal(s: Contents) -> list[bool]:
    """Whether each vehicle's time alone is that of the straight way to its goal, at its guidance's speed."""
    direct = NearIdentity | EvadingManoeuvre | Layers | Roundabout
    return [isinstance(table, direct) for table in fleet.guidances(s)]


def follow_tracks(s: Contents) -> bool:
    """Whether any vehicle follows a recorded track."""
    return any(isinstance(table, RecordedTrack) for table in fleet.guidances(s))
