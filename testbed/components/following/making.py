"""Makes the guidance of a fleet from its tables: one law for equal vehicles, a composite for others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from filters.model import Array, Command, Limits, View
from testbed.components.following.lines import Hold, Waypoints
from testbed.components.following.loiter import Loiter
from testbed.components.following.track import FollowTrack, Track
from testbed.components.guidance import Constant, Guidance, NearIdentity
from testbed.errors import UserError
from testbed.scenario import guidance as tables


@dataclass(frozen=True)
class Composite:
    """Several laws, each for its own vehicles.

    laws  (vehicles from 0, law) that cover all N vehicles; a law sees its own vehicles alone
    """

    laws: Sequence[tuple[np.ndarray, Guidance]]

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        wanted = np.empty((len(view.state), 3))
        for who, law in self.laws:
            wanted[who] = law(t, View(view.state[who], view.rates[who])).array()
        return Command.of(wanted)


def fleet_guidance(
    each: Sequence[tables.Guidance], limits: Limits, goal: Array, gamma: Callable[[], Command]
) -> Guidance:
    """The guidance of vehicles whose tables are `each`.

    limits (N,); goal (N, 3) m; gamma() is the evading manoeuvre (N,), asked for where a vehicle flies it
    """
    groups: list[tuple[Any, list[int]]] = []
    for k, table in enumerate(each):
        own = next((who for known, who in groups if known == table), None)
        if own is None:
            groups.append((table, [k]))
        else:
            own.append(k)
    if len(groups) == 1:
        return _law(groups[0][0], limits, goal, gamma)
    laws = []
    for table, listed in groups:
        who = np.array(listed)
        laws.append((who, _law(table, limits[who], goal[who], lambda who=who: gamma()[who])))  # type: ignore[misc]
    return Composite(laws)


def _law(table: tables.Guidance, limits: Limits, goal: Array, gamma: Callable[[], Command]) -> Guidance:
    match table:
        case tables.NearIdentity():
            return NearIdentity(goal, table.lookahead_m, table.gain_per_s)
        case tables.EvadingManoeuvre():
            return Constant(gamma())
        case tables.Hold():
            course, height = np.radians(table.course_deg), table.height_m
            gains = table.course_gain_per_s, table.height_gain_per_s
            return Hold(float(course), table.speed_mps, height, *gains, limits)
        case tables.Waypoints():
            places, speeds = table.places()
            gains = table.course_gain_per_s, table.height_gain_per_s
            return Waypoints(
                np.array(places), np.array(speeds), table.closed, *gains, limits, table.approach_m
            )
        case tables.Loiter():
            centre = np.array([*table.centre_m, table.height_m])
            sense = 1.0 if table.sense == "left" else -1.0
            gains = table.course_gain_per_s, table.height_gain_per_s
            return Loiter(centre, table.radius_m, table.speed_mps, sense, *gains, limits, table.approach_m)
        case tables.RecordedTrack():
            track = Track(np.array(table.rows))
            return FollowTrack(track, table.course_gain_per_s, table.position_gain_per_s, limits)
    raise UserError(
        f"vehicle.guidance.kind: {table.kind!r} is a part of an installed package, which flies all vehicles"
        " or none; say it in [guidance]"
    )
