"""Defines what a collision filter is, what it returns, and what it declares about itself.

A filter is any callable `(view, nominal, limits) -> Decision`. It may also have a property `declaration`;
only what it declares there is judged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import Barrier, PairValues
from filters.constraints import Alpha, Maker
from filters.model import Array, Command, Limits, View


@dataclass(frozen=True, eq=False)
class Decision:
    """What a filter chose and why.

    command         (N,) inside the limits exactly
    status          (N,) `qp.Status` of the QP behind each vehicle's command
    residual        (N,) largest violation [m/s] over all rows of its QP the vehicle is in, dropped or not
    override        (N,) whether the filter changed the command beyond what the limits force
    deviation       (N,) |u - clip(u_hat)|_inf: what the filter changed beyond what the limits force
    pairs           the filter's own h over all pairs, or those it had to look at; None if it has none
    hdot_predicted  (P,) L_g h u [m/s] of those pairs under the chosen commands
    """

    command: Command
    status: NDArray[np.int_]
    residual: Array
    override: NDArray[np.bool_]
    deviation: Array
    pairs: PairValues | None
    hdot_predicted: Array


Choose = Callable[[View, Command, Limits], Decision]
"""What to fly instead of the nominal command (N,), given what each vehicle sees; it may declare nothing."""


class Filter(Protocol):
    """What to fly instead of `nominal`, given what each vehicle sees, and what the filter says it is."""

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision: ...

    @property
    def declaration(self) -> Declaration: ...


@dataclass
class Check:
    """One claim about a number that must not fall below `least`, over all steps.

    checked, failed  how often it was looked at and how often the number was below `least`
    worst            the smallest number; inf if it was never looked at
    worst_at, first  (step from 0, vehicles from 1) of the smallest and of the first below `least`
    """

    claim: str
    least: float
    checked: int = 0
    failed: int = 0
    worst: float = float("inf")
    worst_at: tuple[int, tuple[int, ...]] | None = None
    first: tuple[int, tuple[int, ...]] | None = None

    def see(self, step: int, numbers: Array, *vehicles: NDArray[np.intp]) -> None:
        """Count `numbers` (R,), each about the vehicles (R,), from 0, of the same place; -1 is no vehicle."""
        if numbers.size == 0:
            return
        below = np.flatnonzero(~(numbers >= self.least))
        self.checked += numbers.size
        self.failed += below.size

        def at(r: int) -> tuple[int, tuple[int, ...]]:
            return step, tuple(int(v[r]) + 1 for v in vehicles if v[r] >= 0)

        if below.size and self.first is None:
            self.first = at(int(below[0]))
        r = int(numbers.argmin())  # of the first that is no number, if there is one
        if np.isnan(numbers[r]) and not np.isnan(numbers).all():
            r = int(np.nanargmin(numbers))
        if numbers[r] < self.worst:
            self.worst, self.worst_at = float(numbers[r]), at(r)


@dataclass
class MonitorRecord:
    """What a theorem monitor has counted.

    steps         filter steps so far
    checks        name -> Check
    cost, cost_limited  sums of |u - u_hat|^2 of the two QPs over the `compared` steps where both were solved
    numbers       what the run's manifest says of the filter, by name with the unit; empty says nothing
    """

    steps: int = 0
    compared: int = 0
    cost: float = 0.0
    cost_limited: float = 0.0
    checks: dict[str, Check] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)

    @property
    def compares(self) -> bool:
        """Whether it compares the costs of two QPs."""
        return "cheaper" in self.checks


@dataclass(frozen=True)
class Declaration:
    """What a filter says it is. The empty declaration says nothing.

    barrier      what it keeps >= 0; a user's own filter is judged by it (claims O1 to O3). A catalogue
                 filter's `pairs` are its values at the very poses that it was shown; None if it has none, or
                 values it at other poses
    constraints  view -> the rows its commands have to satisfy, without margins; None if it declares none
    alpha        the class-K function of its barrier; None if it declares none
    solves_qp    whether quadratic programs stand behind its commands
    paper        whether it is the filter of the paper, alone or wrapped
    record       what a theorem monitor inside it has counted so far; None without a monitor
    """

    barrier: Barrier | None = None
    constraints: Maker | None = None
    alpha: Alpha | None = None
    solves_qp: bool = False
    paper: bool = False
    record: MonitorRecord | None = None


def declaration(filter_: Any) -> Declaration:
    """What `filter_` declares. A callable without a `Declaration` declares nothing.

    This is the only place that decides so; nothing else looks into a filter.
    """
    found = getattr(filter_, "declaration", None)
    return found if isinstance(found, Declaration) else Declaration()
