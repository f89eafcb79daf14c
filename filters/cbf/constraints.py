"""Makes the filter's constraints: the paper's rows of all pairs, and each vehicle's share of them.

A pair's row is L_g h_i u_i + L_g h_j u_j >= -alpha(h); L_f h is 0 for the unicycle (Squires et al. 2022,
"Composition of multiple safety constraints").
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filters.barriers.pairs import Barrier, PairValues, vehicle_of
from filters.barriers.per_pair import PerPair
from filters.cbf.intruders import Intruders
from filters.constraints import Alpha, Constraints, Maker, Margin, amount, dot, taken
from filters.model import Array, State, View


def pair_rows(pairs: PairValues, state: State, alpha: Alpha) -> Constraints:
    """The rows of pairs, as `Constraints` over vehicles i and j.

    pairs  a barrier's values at `state`, (N,) or the state of a View
    Raises FloatingPointError naming the pair if h, its derivative or alpha(h) is not finite.
    """
    rhs = -np.asarray(alpha(pairs.h), dtype=float)
    rows = Constraints((vehicle_of(pairs.i), vehicle_of(pairs.j)), pairs.lie(state), pairs.h, rhs)
    rows.check_finite()
    return rows


def manoeuvres(barrier: Barrier, rows: Constraints, n: int, gamma: Array | None) -> tuple[Array, ...] | None:
    """gamma of every vehicle of every row, k arrays (R, 3), or None if there is none.

    gamma  the manoeuvre (N, 3) shared by all, None without one; a `PerPair` has one for each pair's row
    """
    if gamma is not None:
        return tuple([taken(gamma, vehicle) for vehicle in rows.vehicles])
    if isinstance(barrier, PerPair) and len(rows.vehicles) == 2:
        return barrier.manoeuvres(*rows.vehicles, n)
    return None


def shares(
    rows: Constraints, gammas: tuple[Array, ...] | None, margin: Margin | None = None
) -> tuple[Array, ...]:
    """The right-hand sides, k arrays (R,), of each vehicle's own limited-communication row.

    They add up to the row's rhs. Each of its k vehicles assumes that the others fly gamma, and takes a k-th
    of what is left over when all fly gamma:
    rhs_s = L_g h_s gamma_s - (alpha(h) + L_f h + sum over r of L_g h_r gamma_r) / k.
    gammas  from `manoeuvres`; not needed for rows over one vehicle, whose share is all of it
    margin  added to each share, beyond what adds up; see `row_margins`
    Raises  ValueError if rows over several vehicles have no manoeuvre.
    Source  Squires et al. 2022, the QP of "Control calculation with limited communication", with |V^j| = k.
    """
    found = _plain_shares(rows, gammas)
    if margin is None:
        return found
    return tuple(rhs + amount(margin, lie) for rhs, lie in zip(found, rows.lie, strict=True))


def _plain_shares(rows: Constraints, gammas: tuple[Array, ...] | None) -> tuple[Array, ...]:
    k = len(rows.vehicles)
    if k == 1 or not rows.rhs.size:
        return (rows.rhs,) * k
    if gammas is None:
        raise ValueError(
            "limited communication splits a row by an evading manoeuvre that all know, and this barrier has"
            " none; give it one, or use the centralised filter"
        )
    flown = [dot(lie, gamma) for lie, gamma in zip(rows.lie, gammas, strict=True)]
    level = rows.rhs / k
    if k == 2:  # the same in fewer steps; most rows are of pairs
        difference = (flown[0] - flown[1]) / 2
        return level + difference, level - difference
    mean = sum(flown[1:], flown[0]) / k
    return tuple(level + (own - mean) for own in flown)


def own_rows(blocks: Sequence[Constraints], parts: Sequence[tuple[Array, ...]]) -> Constraints:
    """Every vehicle's own rows, as `Constraints` over one vehicle each.

    Block by block, first those of the rows' first vehicles, then of the second.
    parts  the `shares` of each block
    """
    sides = [
        (vehicle, lie, block.h, rhs)
        for block, each in zip(blocks, parts, strict=True)
        for vehicle, lie, rhs in zip(block.vehicles, block.lie, each, strict=True)
    ]
    vehicle, lie, h, rhs = (np.concatenate(column) for column in zip(*sides, strict=True))
    return Constraints((vehicle,), (lie,), h, rhs)


def observed_rows(
    barrier: Barrier,
    alpha: Alpha,
    view: View,
    gamma: Array | None = None,
    intruders: Intruders | None = None,
) -> Constraints:
    """Every vehicle's own rows (N (N-1),) of its pairs with vehicles it knows, each from what it sees.

    gamma      as for `manoeuvres`
    intruders  they have no rows; a row beside one is the other vehicle's alone
    """
    n = len(view.state)
    observer, other = np.nonzero(~np.eye(n, dtype=bool))
    if view.known is not None:
        seen = view.knows(observer, other)
        observer, other = observer[seen], other[seen]
    if intruders is not None:
        ours = ~intruders.mask[observer]
        observer, other = observer[ours], other[ours]
    i, j = np.minimum(observer, other), np.maximum(observer, other)
    pairs = barrier.values(view.state, (observer, i), (observer, j))
    rows = pair_rows(pairs, view.state, alpha)
    rhs_i, rhs_j = shares(rows, manoeuvres(barrier, rows, n, gamma))
    first = observer < other
    lie_i, lie_j = rows.lie
    lie, rhs = np.where(first[:, None], lie_i, lie_j), np.where(first, rhs_i, rhs_j)
    if intruders is not None:
        theirs, rates = np.where(first[:, None], lie_j, lie_i), view.rates.array()[observer, other]
        rhs = np.where(intruders.mask[other], rows.rhs - intruders.drift(theirs, other, rates), rhs)
    return Constraints((observer,), (lie,), rows.h, rhs)


def observed_shares(maker: Maker, barrier: Barrier, view: View, gamma: Array | None) -> list[Constraints]:
    """Every vehicle's own rows of a maker's constraints, each from what that vehicle sees."""
    found, n = [], len(view.state)
    for observer in range(n):
        seen = view.of(observer)
        for block in maker(seen):
            block = block.known(seen)
            each = shares(block, manoeuvres(barrier, block, n, gamma))
            for vehicle, lie, rhs in zip(block.vehicles, block.lie, each, strict=True):
                mine = vehicle == observer
                found.append(Constraints((vehicle[mine],), (lie[mine],), block.h[mine], rhs[mine]))
    return found
