"""Reduces a departure that violates to the smallest one found that still does.

A list of vectors is tried at a time, and the answer is the place of the first that violates, whether they are
flown one after another or at once. Nothing is assumed about the violation, not even that it grows with the
departure: the result has been flown and violates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from filters.model import Array

# The place of the first of these vectors that violates; None if none does, or nothing more may be flown.
First = Callable[[Sequence[Array]], int | None]
Part = tuple[int, ...]

# Factors at which a scale is tried, the smallest first; then the bracket is bisected so many times.
FACTORS = (1 / 256, 1 / 16, 1 / 4, 1 / 2)
BISECTIONS = 3
# Below this share of what was found rounding decides, so scaling stops.
SMALLEST = 1e-6


def shrink(x: Array, kinds: Sequence[Part], parts: Sequence[Part], first: First) -> Array:
    """The smallest departure found below `x` (n,), which violates.

    kinds  coordinates of each kind of departure, in the order in which dropping them is tried
    parts  coordinates of each thing that departs; dropped by delta debugging, then scaled down
    """
    for kind in kinds:
        x = _better(x, [_without(x, [kind])] if x[list(kind)].any() else [], first)
    left = [p for p in parts if x[list(p)].any()]
    x = _only(x, ddmin(left, lambda trials: first([_only(x, t) for t in trials])))
    x = scale(x, [c for p in parts for c in p], first)
    left = [p for p in parts if x[list(p)].any()]
    for part in left if len(left) > 1 else []:
        x = scale(x, part, first)
    return x


def ddmin(parts: Sequence[Part], first: Callable[[Sequence[Sequence[Part]]], int | None]) -> list[Part]:
    """A part of `parts`, which violate together, of which no single one can be left out.

    Source  Zeller and Hildebrandt, Simplifying and Isolating Failure-Inducing Input, IEEE TSE 28(2), 2002
    """
    kept, pieces = list(parts), 2
    while len(kept) >= 2:
        pieces = min(pieces, len(kept))
        cuts = np.linspace(0, len(kept), pieces + 1).round().astype(int)
        subsets = [kept[a:b] for a, b in pairwise(cuts)]
        rests = [kept[:a] + kept[b:] for a, b in pairwise(cuts)] if pieces > 2 else []
        found = first(subsets + rests)
        if found is not None:
            kept = (subsets + rests)[found]
            pieces = 2 if found < pieces else max(pieces - 1, 2)
        elif pieces == len(kept):
            break
        else:
            pieces *= 2
    return kept


def scale(x: Array, part: Sequence[int], first: First) -> Array:
    """`x` with the coordinates of `part` scaled down together as far as it still violates."""

    def at(factor: float) -> Array:
        scaled = x.copy()
        scaled[list(part)] *= factor
        return scaled

    high = 1.0
    while (found := first([at(high * f) for f in FACTORS])) == 0 and high > SMALLEST:
        high *= FACTORS[0]
    if found == 0:
        return at(high * FACTORS[0])
    low, high = (
        (FACTORS[-1] * high, high) if found is None else (FACTORS[found - 1] * high, FACTORS[found] * high)
    )
    for _ in range(BISECTIONS):
        middle = float(np.sqrt(low * high))
        if first([at(middle)]) is not None:
            high = middle
        else:
            low = middle
    return at(high) if high < 1.0 else x


def _better(x: Array, trials: Sequence[Array], first: First) -> Array:
    found = first(trials) if trials else None
    return x if found is None else trials[found]


def _only(x: Array, parts: Sequence[Part]) -> Array:
    kept = np.zeros_like(x)
    for part in parts:
        kept[list(part)] = x[list(part)]
    return kept


def _without(x: Array, parts: Sequence[Part]) -> Array:
    return x - _only(x, parts)
