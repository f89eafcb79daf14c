"""Makes the filter's rows beside intruders: vehicles that are not under the filter and do not cooperate.

An intruder's input is not chosen. A row of a pair with one is therefore over the other vehicle alone,
L_g h_own u_own >= -alpha(h) - L_g h_intruder w, where w is what the intruder is assumed to do. To the vehicle
under the filter that input is a drift of h. Theorems 3 and 4 of Squires et al. 2022 do not cover such a row:
gamma satisfies it only if the intruder flies gamma too, so the QP may have no solution inside the safe set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from filters.constraints import Constraints, dot, taken
from filters.filter import Decision
from filters.model import Array, Command, Limits, View
from filters.qp.single import Status

Assumption = Literal["keep-course", "nothing"]


@dataclass(frozen=True, eq=False)
class Intruders:
    """Who is not under the filter, and what is assumed of them.

    vehicles  their numbers, from 0
    limits    (N,) input sets of all vehicles; those of intruders bound their worst input
    assume    "keep-course": they keep their present speed and climb rate and do not turn. The measured turn
              rate is left out: an aircraft's shakes by hundredths of a radian per second, and its lever on h
              is hundreds of metres per radian. "nothing": the input within their limits under which h falls
              fastest
    Raises    ValueError for an unknown assumption
    """

    vehicles: Sequence[int]
    limits: Limits
    assume: Assumption = "keep-course"
    mask: NDArray[np.bool_] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.assume not in ("keep-course", "nothing"):
            raise ValueError(f"assume is 'keep-course' or 'nothing', not {self.assume!r}")
        mask = np.zeros(len(self.limits), dtype=bool)
        mask[list(self.vehicles)] = True
        object.__setattr__(self, "mask", mask)

    def met(self, view: View, i: NDArray[np.intp], j: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether in each pair (i, j) one under the filter knows of the other; of two intruders, either."""
        ours = (view.knows(i, j) & ~self.mask[i]) | (view.knows(j, i) & ~self.mask[j])
        return np.asarray(ours | (self.mask[i] & self.mask[j] & view.joined(i, j)))

    def drift(self, lie: Array, vehicle: NDArray[np.intp], rates: Array) -> Array:
        """L_g h w (R,) of what intruders `vehicle` (R,) are assumed to do.

        lie    (R, 3) L_g h over their inputs
        rates  (R, 3) v, omega, zeta that they are seen to fly
        """
        if self.assume == "keep-course":
            return dot(lie, rates * np.array([1.0, 0.0, 1.0]))
        lower, upper = self.limits.corners
        return dot(lie, np.where(lie > 0, taken(lower, vehicle), taken(upper, vehicle)))

    def rows(self, rows: Constraints, rates: Array) -> tuple[Constraints, Constraints]:
        """The rows of pairs under the filter, and those over one vehicle, beside an intruder.

        rows   of pairs, over vehicles i and j
        rates  (N, 3) v, omega, zeta of all vehicles, as seen
        Of two intruders there is no row.
        """
        strange = [self.mask[vehicle] for vehicle in rows.vehicles]
        ours = ~(strange[0] | strange[1])
        sides = [
            self.beside(rows, side, ~strange[side] & strange[1 - side], rates[rows.vehicles[1 - side]])
            for side in (0, 1)
        ]
        both = (np.concatenate([getattr(s, name) for s in sides]) for name in ("h", "rhs", "drift"))
        (vehicle,), (lie,) = (
            [np.concatenate([getattr(s, name)[0] for s in sides])] for name in ("vehicles", "lie")
        )
        return _only(rows, ours), Constraints((vehicle,), (lie,), *both)

    def beside(self, rows: Constraints, side: int, which: NDArray[np.bool_], rates: Array) -> Constraints:
        """`which` (R,) of the rows of pairs as rows over one side's vehicles, the others being intruders.

        rates  (R, 3) v, omega, zeta that the vehicles of the other side are seen to fly
        """
        other = 1 - side
        drift = self.drift(rows.lie[other][which], rows.vehicles[other][which], rates[which])
        own = (rows.vehicles[side][which],), (rows.lie[side][which],)
        return Constraints(*own, rows.h[which], rows.rhs[which] - drift, drift)

    def hdot(self, rows: Constraints, u: Array, rates: Array) -> Array:
        """L_g h u (R,) of pairs under u (N, 3), intruders doing what is assumed; nan of two intruders."""
        parts = rows.parts(u)
        strange = [self.mask[vehicle] for vehicle in rows.vehicles]
        assumed = [
            np.where(who, self.drift(lie, vehicle, rates[vehicle]), part)
            for who, lie, vehicle, part in zip(strange, rows.lie, rows.vehicles, parts, strict=True)
        ]
        return np.where(strange[0] & strange[1], np.nan, assumed[0] + assumed[1])


def _only(rows: Constraints, which: NDArray[np.bool_]) -> Constraints:
    vehicles, lie = tuple(v[which] for v in rows.vehicles), tuple(side[which] for side in rows.lie)
    return Constraints(vehicles, lie, rows.h[which], rows.rhs[which])


def released(decision: Decision, nominal: Command, limits: Limits, who: Sequence[int]) -> Decision:
    """A filter's decision with vehicles `who` (from 0) flying what they want, inside their limits."""
    n = list(who)
    command, status, residual = decision.command.array(), decision.status.copy(), decision.residual.copy()
    deviation, override = decision.deviation.copy(), decision.override.copy()
    command[n] = limits.clip(nominal).array()[n]
    status[n], residual[n], deviation[n], override[n] = int(Status.NONE), 0.0, 0.0, False
    return replace(
        decision,
        command=Command.of(command),
        status=status,
        residual=residual,
        override=override,
        deviation=deviation,
    )
