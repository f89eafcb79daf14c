"""Joins the vehicles' flows with the rows that they keep: what an input moves them, for all or for some."""

from __future__ import annotations

from dataclasses import dataclass

from filters.constraints import Indices
from filters.flow.rollout import Begun, Flow, Paths
from filters.flow.separation import Rows
from filters.model import Array


@dataclass(frozen=True, eq=False)
class Posed:
    """Rows, and the flows that they are about.

    begun  what is certain whatever is commanded next
    gamma  paths (N, M) under gamma, from which displacements are measured
    rows   of the same vehicles
    """

    flow: Flow
    begun: Begun
    gamma: Paths
    rows: Rows

    def of(self, vehicles: Indices) -> Posed:
        """The same of some vehicles (increasing), numbered anew from 0."""
        if vehicles.size == len(self.gamma.centre):
            return self
        return Posed(self.flow, self.begun.of(vehicles), self.gamma[vehicles], self.rows.of(vehicles))

    def moved(self, u: Array) -> Array:
        """Displacements (..., R) m of the rows when u (..., N, 3) is commanded."""
        return self.rows.displacement(self.flow.roll(self.begun, u), self.gamma)
