"""Builds the fences' barrier from a scenario, and says why vehicles cannot start where it puts them."""

from __future__ import annotations

import numpy as np

from filters.barriers.fences.fences import Fence, Fences
from filters.barriers.pairs import Barrier
from filters.model import State
from testbed.components.fence_room import nowhere
from testbed.errors import UserError
from testbed.scenario.fence import title
from testbed.scenario.fence_rules import fenced
from testbed.scenario.scenario import Scenario

# Round-off of h at coordinates of some hundred metres [m].
H_TOLERANCE_M = 1e-9


def fences(s: Scenario, barrier: Barrier, buffer_m: float = 0.0) -> Fences | None:
    """The fences of a scenario with the manoeuvre of `barrier`; None if it has none.

    buffer_m  added to every margin
    Raises    UserError naming a fence and a vehicle whose manoeuvre leaves it from everywhere
    """
    if not s.fence:
        return None
    gamma = barrier.manoeuvre(s.vehicles)
    if gamma is None:
        raise UserError("fence: needs one evading manoeuvre of each vehicle, and this barrier has none")
    made = []
    for number, f in enumerate(s.fence, 1):
        who = np.array(fenced(s, f), dtype=int) - 1
        try:
            made.append(Fence(f.shape(buffer_m), who, title(number, f.name)))
        except ValueError as error:
            raise UserError(f"{title(number, f.name)}, widened by {buffer_m:g} m: {error}") from None
    try:
        return Fences(made, gamma)
    except ValueError as error:
        raise UserError(str(error)) from None


def check_start(made: Fences, start: State, force: bool) -> bool:
    """Whether h >= 0 for every vehicle and fence at the start (N,).

    force   accept a start outside the safe set
    Raises  UserError without `force`: fences that leave no room, a start beyond a fence, or a start from
            which the evading manoeuvre leaves one.
    """
    h = made.values(start)
    if h.size == 0 or h.min() >= -H_TOLERANCE_M:
        return True
    if force:
        return False
    beyond = made.clearance(start.position)
    p = int(np.argmin(beyond if beyond.min() < 0 else h))
    vehicle = int(made.vehicle[p])
    why = nowhere(made, vehicle)
    if why:
        raise UserError(f"fence: {why}")
    name, number = made.fences[made.fence[p]].name, vehicle + 1
    if beyond[p] < 0:
        raise UserError(
            f"the start is outside the safe set: vehicle {number} starts {-beyond[p]:.1f} m beyond {name} or"
            " its margin; --force flies it all the same"
        )
    raise UserError(
        f"the start is outside the safe set: vehicle {number} starts clear of {name}, but its evading"
        f" manoeuvre passes it by {-h[p]:.1f} m; start it farther away or heading elsewhere; --force flies it"
        " all the same"
    )
