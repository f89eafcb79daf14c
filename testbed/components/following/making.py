"""Makes the guidance of a fleet from its tables: one law for equal vehicles, a composite for others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from filters.model import Array, Command, Limits, View
from testbed.components.following.evading import evading
from testbed.components.following.layers import SPARE_M, Layers, dealt, descent_rate
from testbed.components.following.lines import Hold, Waypoints
from testbed.components.following.loiter import Loiter
from testbed.components.following.roundabout import Roundabout, ring_radius, sense_against
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


@dataclass(frozen=True)
class Fleet:
    """What laws that keep vehicles apart know of the fleet.

    each    the tables of all N vehicles
    limits  (N,); goal (N, 3) m
    gamma() the evading manoeuvre (N,), asked for where a vehicle flies it or against it
    start() (N, 3) m, where vehicles begin, asked for where layers are dealt
    """

    each: Sequence[tables.Guidance]
    limits: Limits
    goal: Array
    gamma: Callable[[], Command]
    start: Callable[[], Array]
    d_safe: float
    goal_radius: float

    def who(self, kind: type) -> np.ndarray:
        """The vehicles, from 0, whose table is of a kind."""
        return np.array([k for k, table in enumerate(self.each) if isinstance(table, kind)], dtype=int)

    def layers(self) -> Array:
        """(N,) m, the layer of each vehicle; nan of those that fly in none."""
        who, made = self.who(tables.Layers), np.full(len(self.each), np.nan)
        way = np.hypot(*(self.goal - self.start())[who, :2].T)
        dealing: list[Any] = [self.each[k] for k in who]
        made[who] = dealt(dealing, self.limits[who], way, self.goal_radius, self.d_safe)
        return made


def fleet_guidance(fleet: Fleet) -> Guidance:
    """The guidance of a fleet."""
    each = fleet.each
    groups: list[tuple[Any, list[int]]] = []
    for k, table in enumerate(each):
        own = next((who for known, who in groups if known == table), None)
        if own is None:
            groups.append((table, [k]))
        else:
            own.append(k)
    if len(groups) == 1:
        return _law(groups[0][0], fleet, np.arange(len(each)))
    return Composite([(np.array(who), _law(table, fleet, np.array(who))) for table, who in groups])


def _law(table: tables.Guidance, fleet: Fleet, who: np.ndarray) -> Guidance:
    """The law of the vehicles `who`, whose table is `table`."""
    limits, goal = fleet.limits[who], fleet.goal[who]
    match table:
        case tables.NearIdentity():
            return NearIdentity(goal, table.lookahead_m, table.gain_per_s)
        case tables.EvadingManoeuvre():
            return Constant(fleet.gamma()[who])
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
        case tables.Layers():
            return _layers(table, fleet, who)
        case tables.Roundabout():
            return _roundabout(table, fleet, who)
    raise UserError(
        f"vehicle.guidance.kind: {table.kind!r} is a part of an installed package, which flies all vehicles"
        " or none; say it in [guidance]"
    )


def _layers(table: tables.Layers, fleet: Fleet, who: np.ndarray) -> Guidance:
    """Layers of all vehicles that fly in some, whichever of their tables says what."""
    layer, limits, known = fleet.layers(), fleet.limits[who], None
    if table.evading:
        try:
            known = evading(fleet.gamma(), layer, fleet.d_safe + SPARE_M).of(who)
        except ValueError as error:
            raise UserError(f"guidance.evading: {error}; barrier.kind = 'turn' has one") from None
    gains, descent = (table.course_gain_per_s, table.height_gain_per_s), descent_rate(table, limits)
    way = layer[who], table.speed_mps, descent
    return Layers(fleet.goal[who], fleet.goal_radius, *way, *gains, limits, table.goal_offset_m, known)


def _roundabout(table: tables.Roundabout, fleet: Fleet, who: np.ndarray) -> Guidance:
    """One ring for all vehicles that fly a roundabout, whichever of their tables says what."""
    all_ = fleet.who(tables.Roundabout)
    try:
        sense = sense_against(fleet.gamma()[all_])
    except ValueError as error:
        raise UserError(f"guidance.kind: {error}; barrier.kind = 'turn' has one") from None
    centre = fleet.goal[all_, :2].mean(axis=0) if table.centre_m is None else np.array(table.centre_m)
    radius = ring_radius(table, len(all_), fleet.limits[all_], fleet.d_safe)
    rest = table.course_gain_per_s, table.height_gain_per_s, fleet.limits[who], table.approach_m
    return Roundabout(fleet.goal[who], centre, radius, sense, table.speed_mps, *rest)
