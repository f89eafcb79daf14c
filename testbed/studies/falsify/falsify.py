"""Searches the least margin within bounds, and the smallest departure that violates.

The search begins at the theorem's assumptions and departs from them: the scenario as it stands; starts
alone, in a Latin hypercube; starts with wind and delay; then Powell's method from the best of these, over
the offsets of the two vehicles that came closest, wind and delay. It stops at the first violation, which is
then shrunk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.model import Array
from testbed.errors import UserError
from testbed.studies.falsify.flights import Flight, Flights
from testbed.studies.falsify.shrink import shrink
from testbed.studies.falsify.space import STARTS, Space

START_KINDS = tuple(k.kind for k in STARTS)
WEATHER_KINDS = ("wind_mps", "latency_s")
# Dropped first, because they are furthest from the theorem's assumptions.
DROPPED = ("latency_s", "wind_mps", "height_m", "lateral_m", "heading_deg")
# The margin of a refused start in a descent [m]: worse than that of any flight.
REFUSED = 1e6


@dataclass
class Falsified:
    """What was found.

    search   every flight up to the violation, or the whole budget
    found    the flight that violated, of the least margin; None if none did
    least    the flight of the least margin
    shrinks  every flight of the shrinking
    shrunk   the smallest that violates; None if none did
    """

    space: Space
    guarantee: str
    budget: int
    seed: int
    search: Flights
    found: Flight | None
    shrinks: Flights | None = None

    @property
    def least(self) -> Flight:
        return self.search.least()

    @property
    def shrunk(self) -> Flight | None:
        """The last flight of the shrinking that violated: every step of it is smaller than the one before."""
        if self.shrinks is None:
            return self.found
        return next((f for f in reversed(self.shrinks.flown) if f.violated), self.found)


def falsify(search: Flights, seed: int, thorough: bool = False) -> Falsified:
    """Search `search.space` for a violation and shrink it, each within `search.most` flights.

    thorough  spend the whole budget on a smaller margin, violation or not
    Raises    UserError if the guarantee does not apply, or the scenario as it stands cannot be flown
    """
    space = search.space
    found = _nominal(search)
    if found is None or thorough:
        explore(search, np.random.default_rng(seed), thorough)
        found = min((f for f in search.flown if f.violated), key=lambda f: f.margin, default=None)
    result = Falsified(space, search.guarantee, search.most, seed, search, found)
    if found is None or not found.x.any():
        return result
    shrinks = result.shrinks = Flights(
        space, search.guarantee, search.most, search.pool, search.work, search.parts
    )
    parts = [a.coordinates for a in space.atoms]
    kinds = [tuple(space.coordinates([kind]).tolist()) for kind in DROPPED]
    small = shrink(found.x, [k for k in kinds if k], parts, lambda xs: shrinks.first("shrink", xs))
    shrinks.first("round", [r for digits in (1, 2, 3) if (r := space.rounded(small, digits)).any()])
    return result


def _nominal(search: Flights) -> Flight | None:
    """Fly the scenario as it stands; the flight if it violates already."""
    space = search.space
    search.first("as it stands", [np.zeros(space.size)])
    flight = search.flown[0]
    if flight.refused:
        raise UserError(flight.refused)
    if np.isnan(flight.margin):
        raise UserError(f"guarantee {search.guarantee} does not apply to {space.scenario.name}")
    return flight if flight.violated else None


def explore(search: Flights, rng: np.random.Generator, thorough: bool) -> None:
    """Starts alone for a third of the budget, all departures for another, descents for the rest."""
    space, third = search.space, search.most // 3
    starts, everything = space.coordinates(START_KINDS), np.arange(space.size)
    for stage, chosen in (("starts", starts), ("starts and weather", everything)):
        if not chosen.size or (stage != "starts" and chosen.size == starts.size):
            continue
        points = hypercube(space, chosen, third, rng)
        if search.first(stage, points, stop=not thorough) is not None and not thorough:
            return
    descend(search, thorough)


def hypercube(space: Space, chosen: np.ndarray, count: int, rng: np.random.Generator) -> list[Array]:
    """`count` departures of the coordinates `chosen`, a Latin hypercube over their bounds."""
    from scipy.stats.qmc import LatinHypercube

    unit = LatinHypercube(chosen.size, rng=rng).random(count)
    points = np.zeros((count, space.size))
    points[:, chosen] = space.lower[chosen] + (1.0 - space.lower[chosen]) * unit
    return list(points)


class _EndError(Exception):
    """Ends a scipy descent from within its objective."""


def descend(search: Flights, thorough: bool) -> None:
    """Powell's method from the best flights so far, one after another, until the budget is spent.

    A descent moves the two vehicles that came closest, wind and delay: of twenty vehicles, all others would
    cost a line search each. Powell's lines cross the whole box, which suits a margin with several valleys:
    from the same 40 starts of two lagged vehicles, 50 flights brought it to -2.98 and -2.01 m (two seeds),
    Nelder-Mead to -1.11 and -0.81 m, more sampling to -0.29 and -0.08 m; differential evolution, tried on
    the first, to -0.74 m.
    """
    from scipy.optimize import minimize

    space = search.space
    for best in sorted(search.flown, key=lambda f: (np.isnan(f.margin), f.margin)):
        if best.refused or search.left <= 0:
            return
        chosen = space.coordinates(START_KINDS + WEATHER_KINDS, best.vehicles)
        low = space.lower[chosen]

        def margin(own: Array, best: Flight = best, chosen: np.ndarray = chosen) -> float:
            x = best.x.copy()
            x[chosen] = own
            if search.left <= 0:
                raise _EndError
            if search.first("descent", [x]) is not None and not thorough:
                raise _EndError
            last = search.flown[-1]
            return REFUSED if last.refused else last.margin

        try:
            minimize(
                margin,
                best.x[chosen],
                method="Powell",
                bounds=list(zip(low, np.ones(chosen.size), strict=True)),
                options={"xtol": 0.1, "ftol": 0.01},
            )
        except _EndError:
            return
