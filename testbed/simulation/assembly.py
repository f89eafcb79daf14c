"""Puts the pieces of one run together: first what the scenario alone decides, then the parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.plant import Plant
from aircraft.replay import Replay
from filters.barriers.fences.fences import Fences
from filters.barriers.pairs import Barrier, all_pairs
from filters.constraints import Constraints
from filters.filter import Choose, declaration
from filters.model import Array, Command, Limits, State, View
from testbed.claims.guarantees import H_TOLERANCE_M
from testbed.components import catalogue
from testbed.components.border.contract import Breach
from testbed.components.border.making import Maker
from testbed.components.border.others import OwnFilter
from testbed.components.components import Parts
from testbed.components.fences import check_start, fences
from testbed.components.guidance import Guidance
from testbed.components.initial_conditions import generators, places
from testbed.components.provenance import Origin
from testbed.environment.environment import Environment
from testbed.errors import UserError
from testbed.measures.declared_barrier import at_one_step
from testbed.measures.roles import Mask, Roles, roles
from testbed.scenario import fleet
from testbed.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Setting:
    """What the scenario alone decides.

    start, goal   (N,) and (N, 3) m
    i, j          (P,) vehicles of each pair, from 0
    started_safe  whether h >= 0 for all pairs at t = 0
    roles         who is under the filter; None without intruders
    fences, started_in_fences  None without fences; whether h >= 0 for all of them at t = 0
    """

    scenario: Scenario
    rngs: dict[str, np.random.Generator]
    start: State
    goal: Array
    limits: Limits
    barrier: Barrier
    i: np.ndarray
    j: np.ndarray
    started_safe: bool
    fences: Fences | None = None
    started_in_fences: bool = True
    roles: Roles | None = None


def set_up(s: Scenario, force: bool) -> Setting:
    """Start, goals, limits and barrier of `s`.

    force   accept a start outside the safe set
    Raises  UserError for a start outside the safe set (of a pair or a fence), two vehicles at one place, or a
            barrier that is none.
    """
    rngs = generators(s.seed)
    start, goal = places(s, rngs["start"])
    barrier = catalogue.barrier(s)
    i, j = all_pairs(s.vehicles)
    who = roles(s, i, j)
    safe = _check_start(barrier, start, i, j, force, None if who is None else who.judged)
    made = fences(s, barrier)
    inside = made is None or check_start(made, start, force)
    return Setting(s, rngs, start, goal, catalogue.limits(s), barrier, i, j, safe, made, inside, who)


@dataclass(frozen=True, eq=False)
class Assembled:
    """The parts of one run, made and reset.

    air       (N, 3) m/s, the wind at the start; None in still air
    replay    the plant where branches of the flight are wanted, else None
    aircraft  one airframe per vehicle, where aircraft of the catalogue fly; else none
    arcs      whether the vehicles are the catalogue's unicycles, which fly exact arcs over a filter period
    valued    the barrier whose values the catalogue's own filter returns; None where they are not trusted
    """

    environment: Environment
    plant: Plant
    filter: Choose
    guidance: Guidance
    air: Array | None
    replay: Replay | None
    aircraft: Sequence[Airframe]
    arcs: bool
    valued: Barrier | None

    @property
    def refused(self) -> Breach | None:
        """Why no plant can fly the last command of a user's filter; None if it can."""
        return self.filter.refused if isinstance(self.filter, OwnFilter) else None

    def declared(self, state: State, command: Command | None) -> Array:
        """Of the barrier that a user's filter declares, see `declared_barrier.at_one_step`.

        command  None where the vehicles fly other commands than the filter's
        """
        assert isinstance(self.filter, OwnFilter)
        u = None if command is None else command.array()
        return at_one_step(*self.filter.barrier_values(state), state, u)

    def rows(self, view: View) -> tuple[Constraints, ...]:
        """The rows that a user's filter declares for this view; none of other filters."""
        return self.filter.rows(view) if isinstance(self.filter, OwnFilter) else ()


def put_together(setting: Setting, parts: Parts, own: dict[str, Origin]) -> Assembled:
    """Make every part once, and the plant ready to fly.

    own     `parts.own()`: the parts that are a user's

    Raises  UserError where there is no steady flight at the start; Breach if a user's part is none
    """
    s = setting.scenario
    maker = Maker(parts, own, s, setting.barrier, setting.goal, setting.limits)
    environment = maker.environment(setting.rngs)
    air = environment.wind(0.0, setting.start)
    wind = np.zeros((s.vehicles, 3)) if air is None else air

    def make() -> Plant:
        return maker.plant(wind)

    # Remembering the flight costs memory that grows with it: only where branches are wanted.
    replay = Replay(make) if s.checks.manoeuvre_instants else None
    plant = replay or make()
    try:
        plant.reset(setting.start, setting.rngs["plant"], wind, np.array(fleet.speeds(s)))
    except RuntimeError as error:  # no steady flight at the start, in this wind
        raise UserError(f"start: {error}") from None
    try:
        aircraft = catalogue.airframes(s) if s.plant == "jsbsim" and "plant" not in own else []
        filter_, guidance = maker.filter(), maker.guidance()
    except BaseException:  # nobody else has the plant yet, and its worker processes
        plant.close()
        raise
    arcs = s.plant == "unicycle" and "plant" not in own
    valued = None if "filter" in own else declaration(filter_).barrier
    return Assembled(environment, plant, filter_, guidance, air, replay, aircraft, arcs, valued)


def _check_start(
    barrier: Barrier, start: State, i: np.ndarray, j: np.ndarray, force: bool, judged: Mask | None
) -> bool:
    """Whether h >= 0 for every pair that is judged; refused without `force`, and two at one place always."""
    if not i.size:
        return True
    place = start.position
    distance = np.linalg.norm(place[i] - place[j], axis=-1)
    p = int(np.argmin(distance))
    if distance[p] == 0.0:
        raise UserError(f"vehicles {i[p] + 1} and {j[p] + 1} start at one place, {place[i[p]]} m")
    h = barrier.values(start).h
    if judged is not None:
        h = np.where(judged, h, np.inf)
    p = int(np.argmin(h))
    if h[p] >= -H_TOLERANCE_M:
        return True
    if not force:
        raise UserError(
            f"the start is outside the safe set: h = {h[p]:.3f} for vehicles {i[p] + 1} and {j[p] + 1},"
            f" {distance[p]:.1f} m apart; --force flies it all the same"
        )
    return False
