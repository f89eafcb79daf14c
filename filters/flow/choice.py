"""Chooses each vehicle's input: the nearest to its target whose exact flow keeps every row.

Displacements are nearly linear in the input. So a QP with their slopes is solved, its rows corrected by the
exact displacements at its solution, and solved again. What is left is drawn towards gamma until it holds.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.constraints import Indices, dot
from filters.flow.separation import Rows
from filters.model import Array
from filters.qp.batch import solve_each

# Shares of the way from gamma to the QP's solution, tried in turn; the last always keeps every row.
DRAWN = np.array([0.9, 0.75, 0.5, 0.25, 0.1, 0.0])
TOLERANCE_M = 1e-4
_ROUNDS, _CORRECTIONS = 8, 2
_CHANGED = 1e-6


class Ending(enum.IntEnum):
    """How a vehicle's input was found.

    NOMINAL  its target, inside the limits, keeps every row
    SOLVED   the QP's solution does
    DRAWN    an input between that and gamma does
    EVADING  of those tried only gamma does
    """

    NOMINAL = 0
    SOLVED = 1
    DRAWN = 2
    EVADING = 3


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


def choose(
    wanted: Wanted, rows: Rows, slope: Array, moved: Array, exact: Callable[[Array], Array]
) -> tuple[Array, NDArray[np.int_]]:
    """Inputs (N, 3) and their `Ending` (N,) for vehicles whose targets break rows.

    slope  (R, 3) m per unit of input, of each row's displacement
    moved  (R,) m, displacements at the targets inside the box
    exact  inputs (..., N, 3) -> displacements (..., R) m of their flow

    Where the slack is negative, a vehicle aims at more than its rows ask; if it cannot have that at all of
    them, it keeps its rows.
    """
    u, reached = wanted.clipped, moved
    aims = [rows.least + _recovery(wanted, rows, slope)] if rows.back.any() else []
    for aim in (*aims, rows.least):
        fails = _who(rows, reached < aim - TOLERANCE_M, len(u))
        if not fails.any():
            break
        found, there = _nearest(wanted, rows, slope, moved, exact, aim)
        u = np.where(fails[:, None], found, u)
        reached = np.where(fails[rows.vehicle], there, reached)
    ending = np.where(np.abs(u - wanted.clipped).max(axis=1) > _CHANGED, Ending.SOLVED, Ending.NOMINAL)
    least = rows.least - TOLERANCE_M
    broken = np.flatnonzero(_who(rows, ~(reached >= least), len(u)))
    if broken.size:
        tried = wanted.gamma + DRAWN[:, None, None] * (u - wanted.gamma)
        fails = ~(exact(tried) >= least)
        for v in broken:
            kept = ~fails[:, rows.vehicle == v].any(axis=1)
            k = int(np.argmax(kept)) if kept.any() else len(DRAWN) - 1
            u[v] = tried[k, v]
            ending[v] = Ending.DRAWN if DRAWN[k] else Ending.EVADING
    return u, ending


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


def _nearest(
    wanted: Wanted, rows: Rows, slope: Array, moved: Array, exact: Callable[[Array], Array], aim: Array
) -> tuple[Array, Array]:
    """Inputs near the targets with displacements of at least `aim`, if there are, and their displacements."""
    u, at, need = wanted.clipped, wanted.gamma, aim
    v = rows.vehicle
    floor = dot(slope, np.where(slope > 0, wanted.lower.take(v, axis=0), wanted.upper.take(v, axis=0)))
    for _ in range(_CORRECTIONS):
        fails = _who(rows, ~(moved >= aim - TOLERANCE_M), len(u))
        if not fails.any():
            break
        # Whoever keeps its rows already is left alone: vehicles do not depend on each other.
        level = need + dot(slope, at.take(v, axis=0))
        # Rows that no input in the box can break are none to the QP.
        found = _solve(wanted, rows, slope, level, np.flatnonzero((floor < level) & fails[v]))
        u = np.where(fails[:, None], found, u)
        moved = exact(u)
        at, need = u, aim - moved
    return u, moved


def _solve(wanted: Wanted, rows: Rows, slope: Array, level: Array, some: Indices) -> Array:
    """The inputs nearest to the targets with slope u >= level in `some` rows, added as they are broken."""
    vehicle, slope, level = rows.vehicle[some], slope.take(some, axis=0), level[some]
    group = vehicle * (int(rows.other.max(initial=0)) + 1) + rows.other[some]
    scale = wanted.scale
    kept = np.zeros(vehicle.size, dtype=bool)
    u = wanted.clipped
    scaled = slope * scale.take(vehicle, axis=0)
    box = wanted.target / scale, wanted.lower / scale, wanted.upper / scale
    for _ in range(_ROUNDS):
        short = level - dot(slope, u.take(vehicle, axis=0))
        broken = np.flatnonzero((short > _CHANGED) & ~kept)
        if not broken.size:
            break
        # Of each vehicle and whom it meets the row that is broken most.
        worst = broken[np.argsort(-short[broken], kind="stable")]
        _, first = np.unique(group[worst], return_index=True)
        kept[worst[first]] = True
        use = np.flatnonzero(kept)
        found, _ = solve_each(
            box[0], vehicle[use], scaled[use], level[use], box[1], box[2], fallback=wanted.gamma / scale
        )
        u = np.minimum(np.maximum(found * scale, wanted.lower), wanted.upper)
    return u
