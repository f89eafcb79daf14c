"""Says which vehicles and pairs a run's claims are about, where some vehicles are intruders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from testbed.scenario import fleet
from testbed.scenario.contents import Contents

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Roles:
    """Vehicles under the filter, and pairs by how many of theirs are.

    intruders  vehicles that are not under the filter, from 0
    under      (N,) vehicles under the filter
    ours       (P,) pairs of two such
    beside     (P,) pairs of one such and an intruder
    judged     (P,) pairs of either kind: what happens between two intruders is nobody's promise
    """

    intruders: tuple[int, ...]
    under: Mask
    ours: Mask
    beside: Mask
    judged: Mask


def roles(s: Contents, i: NDArray[np.intp], j: NDArray[np.intp]) -> Roles | None:
    """The roles in a scenario with pairs (i, j), from 0; None without intruders."""
    who = fleet.intruders(s)
    if not who:
        return None
    under = np.ones(s.vehicles, dtype=bool)
    under[list(who)] = False
    ours, beside = under[i] & under[j], under[i] ^ under[j]
    return Roles(who, under, ours, beside, ours | beside)
