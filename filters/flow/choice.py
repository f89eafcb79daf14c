"""Chooses each vehicle's input: the nearest to its target whose exact flow keeps every row.

Displacements are nearly linear in the input. So a QP with their slopes is solved, its rows corrected by the
exact displacements at its solution, and solved again. What is left is drawn towards gamma until it holds.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.constraints import Indices, dot, taken
from filters.flow.posed import Posed
from filters.flow.separation import Rows
from filters.model import Array
from filters.qp.active_set import attempt_each
from filters.qp.batch import solve_each

# Shares of the way from gamma to the QP's solution, tried in turn; the last always keeps every row.
DRAWN = np.array([0.9, 0.75, 0.5, 0.25, 0.1, 0.0])
# Shares of the largest climb or descent, tried in turn where only gamma is left.
CLIMBED = np.array([1.0, 0.5, 0.25, 0.1])
TOLERANCE_M = 1e-4
_ROUNDS, _CORRECTIONS = 8, 2
_CHANGED = 1e-6


class Ending(enum.IntEnum):
    """How a vehicle's input was found.

    NOMINAL  its target, inside the limits, keeps every row
    SOLVED   the QP's solution does
    DRAWN    an input between that and gamma does
    EVADING  of those tried only gamma does
    APART    outside, gamma with a climb or a descent away from whom it is too near to
    """

    NOMINAL = 0
    SOLVED = 1
    DRAWN = 2
    EVADING = 3
    APART = 4


@dataclass(frozen=True, eq=False)
class Wanted:
    """Targets and box of all vehicles, arrays (N, 3).

    gamma  the evading manoeuvre inside the box
    scale  what each channel's cost is divided by
    """

    target: Array
    lower: Array
    upper: Array
    gamma: Array
    scale: Array

    def of(self, vehicles: Indices) -> Wanted:
        """Those of some vehicles."""
        each = (self.target, self.lower, self.upper, self.gamma, self.scale)
        return Wanted(*(x[vehicles] for x in each))

    @property
    def clipped(self) -> Array:
        return np.minimum(np.maximum(self.target, self.lower), self.upper)


def choose(wanted: Wanted, posed: Posed, slope: Array, moved: Array) -> tuple[Array, NDArray[np.int_]]:
    """Inputs (N, 3) and their `Ending` (N,) for vehicles whose targets break rows.

    slope  (R, 3) m per unit of input, of each row's displacement
    moved  (R,) m, displacements at the targets inside the box

    Where the slack is negative, a vehicle aims at more than its rows ask; if it cannot have that at all of
    them, it keeps its rows.
    """
    u, reached, rows = wanted.clipped, moved, posed.rows
    aims = [rows.least + _recovery(wanted, rows, slope)] if rows.back.any() else []
    for aim in (*aims, rows.least):
        fails = _who(rows, reached < aim - TOLERANCE_M, len(u))
        if not fails.any():
            break
        found, there = _nearest(wanted, posed, slope, moved, aim)
        u = np.where(fails[:, None], found, u)
        reached = np.where(fails[rows.vehicle], there, reached)
    ending = np.where(np.abs(u - wanted.clipped).max(axis=1) > _CHANGED, Ending.SOLVED, Ending.NOMINAL)
    broken = np.flatnonzero(_who(rows, ~(reached >= rows.least - TOLERANCE_M), len(u)))
    if broken.size:
        u[broken], ending[broken] = _drawn(wanted.gamma[broken], u[broken], posed.of(broken))
    outside = _who(rows, rows.back > 0, len(u))
    stuck = np.flatnonzero(outside & (np.abs(u - wanted.gamma).max(axis=1) < _CHANGED))
    if stuck.size:
        u[stuck], may = _apart(wanted.of(stuck), posed.of(stuck))
        ending[stuck[may]] = Ending.APART
    return u, ending


def _apart(wanted: Wanted, posed: Posed) -> tuple[Array, NDArray[np.bool_]]:
    """Gamma and a climb or descent (N, 3) for vehicles outside that only gamma is left to, and who may do so.

    Samples before and after the nearest one lie on both sides of the other vehicle: no level displacement is
    away from it at all of them. A climb of the upper one is, whatever the phase.
    """
    rows, gamma = posed.rows, wanted.gamma
    order = np.lexsort((-rows.back, rows.vehicle))
    worst = order[np.flatnonzero(np.diff(rows.vehicle[order], prepend=-1))]
    # Of two at one height, one vector's vertical part is 0 and the other's -0.
    end = np.where(np.signbit(rows.up[worst]), wanted.lower[:, 2], wanted.upper[:, 2]) - gamma[:, 2]
    tried = gamma + np.zeros((CLIMBED.size, 1, 3))
    tried[..., 2] += CLIMBED[:, None] * end
    fails = posed.moved(tried) < rows.least - TOLERANCE_M
    kept = ~np.stack([_who(rows, each, len(gamma)) for each in fails])
    k = np.argmax(kept, axis=0)
    found = np.asarray(kept.any(axis=0))
    return np.where(found[:, None], tried[k, np.arange(len(gamma))], gamma), found


def _drawn(gamma: Array, u: Array, posed: Posed) -> tuple[Array, NDArray[np.int_]]:
    """The first inputs (N, 3) on the way from u to gamma that keep every row, and their `Ending` (N,)."""
    tried = gamma + DRAWN[:, None, None] * (u - gamma)
    fails = ~(posed.moved(tried) >= posed.rows.least - TOLERANCE_M)
    kept = ~np.stack([_who(posed.rows, each, len(u)) for each in fails])
    kept[-1] = True
    k = np.argmax(kept, axis=0)
    return tried[k, np.arange(len(u))], np.where(DRAWN[k] > 0, Ending.DRAWN, Ending.EVADING)


def _who(rows: Rows, which: NDArray[np.bool_], vehicles: int) -> NDArray[np.bool_]:
    """The vehicles (N,) of some rows (R,)."""
    found = np.zeros(vehicles, dtype=bool)
    found[rows.vehicle[which]] = True
    return found


def _recovery(wanted: Wanted, rows: Rows, slope: Array) -> Array:
    """What rows of negative slack aim at beyond their least (R,) m: at most half of what they could alone."""
    v = rows.vehicle
    end = np.where(slope > 0, wanted.upper[v], wanted.lower[v]) - wanted.gamma[v]
    return np.minimum(rows.back, 0.5 * dot(slope, end))


def _nearest(wanted: Wanted, posed: Posed, slope: Array, moved: Array, aim: Array) -> tuple[Array, Array]:
    """Inputs near the targets with displacements of at least `aim`, if there are, and their displacements."""
    u, at, need, rows = wanted.clipped, wanted.gamma, aim, posed.rows
    v = rows.vehicle
    floor = dot(slope, np.where(slope > 0, taken(wanted.lower, v), taken(wanted.upper, v)))
    for _ in range(_CORRECTIONS):
        fails = _who(rows, ~(moved >= aim - TOLERANCE_M), len(u))
        if not fails.any():
            break
        # Whoever keeps its rows already is left alone: vehicles do not depend on each other.
        level = need + dot(slope, taken(at, v))
        # Rows that no input in the box can break are none to the QP.
        found = _solve(wanted, rows, slope, level, np.flatnonzero((floor < level) & fails[v]))
        u = np.where(fails[:, None], found, u)
        moved = posed.moved(u)
        at, need = u, aim - moved
    return u, moved


def _solve(wanted: Wanted, rows: Rows, slope: Array, level: Array, some: Indices) -> Array:
    """The inputs nearest to the targets with slope u >= level in `some` rows, added as they are broken."""
    group = rows.vehicle[some] * (int(rows.other.max(initial=0)) + 1) + rows.other[some]
    order = np.argsort(group, kind="stable")
    some, group = some[order], group[order]
    vehicle, slope, level = rows.vehicle[some], taken(slope, some), level[some]
    scale = wanted.scale
    scaled = slope * taken(scale, vehicle)
    box = wanted.target / scale, wanted.lower / scale, wanted.upper / scale
    norm = np.sqrt(dot(scaled, scaled))
    norm[norm == 0.0] = 1.0
    unit, unit_level = scaled / norm[:, None], level / norm

    def checked(use: Indices) -> Array:
        """The inputs of the vehicles with rows `use`; of others their targets."""
        found, _ = solve_each(
            box[0],
            vehicle[use],
            taken(scaled, use),
            level[use],
            box[1],
            box[2],
            fallback=wanted.gamma / scale,
        )
        return np.minimum(np.maximum(found * scale, wanted.lower), wanted.upper)

    u, sure = wanted.clipped, np.ones(len(scale), dtype=bool)
    kept = np.zeros(some.size, dtype=bool)
    # Rows of vehicles that are not at rest yet: their places, vehicles, groups, slopes and levels.
    now: Indices = np.arange(some.size)
    mine, group_of, along, need = vehicle, group, slope, level
    for _ in range(_ROUNDS):
        short = need - dot(along, taken(u, mine))
        new = _worst(group_of, short, (short > _CHANGED) & ~kept[now])
        if not new.size:
            break
        kept[now[new]] = True
        changed = np.zeros(len(u), dtype=bool)
        changed[mine[new]] = True
        still = np.flatnonzero(changed[mine])
        if still.size < now.size:
            now, mine, group_of = now.take(still), mine.take(still), group_of.take(still)
            need, along = need.take(still), taken(along, still)
        use = now[kept[now]]
        # While rows are still added the solver's answers are taken as they are, and checked at the end.
        count, who = np.bincount(vehicle[use], minlength=len(u)), np.flatnonzero(changed)
        target, lower, upper = (x.take(who, axis=0) for x in box)
        found, _, _, there = attempt_each(
            target, count[who], unit.take(use, axis=0), unit_level[use], lower, upper
        )
        if there.all():
            u, sure = u.copy(), sure & ~changed
            u[who] = np.minimum(np.maximum(found * scale[who], wanted.lower[who]), wanted.upper[who])
        else:
            u, sure = np.where(changed[:, None], checked(use), u), sure | changed
    last = np.flatnonzero(kept & ~sure[vehicle])
    return np.where(sure[:, None], u, checked(last)) if last.size else u


def _worst(group: Indices, short: Array, broken: NDArray[np.bool_]) -> Indices:
    """Of each group of rows (R,), which stand together, the one that is broken most."""
    rows = np.flatnonzero(broken)
    if not rows.size:
        return rows
    group, short = group[rows], short[rows]
    begins = _begins(group)
    most = np.maximum.reduceat(short, np.flatnonzero(begins))
    equal = np.flatnonzero(short == most[np.cumsum(begins) - 1])
    return np.asarray(rows[equal[_begins(group[equal])]])


def _begins(group: Indices) -> NDArray[np.bool_]:
    """Where (R,) another group begins."""
    found = np.ones(group.size, dtype=bool)
    np.not_equal(group[1:], group[:-1], out=found[1:])
    return found
