"""Makes the filter's constraints of fences: a row over one vehicle for each smooth part of its fences' h."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.barriers.fences.fences import Fences
from filters.constraints import Alpha, Constraints
from filters.model import View


@dataclass(frozen=True, eq=False)
class FenceConstraints:
    """A maker of constraints for `CollisionFilter(also=[...])`: hdot + alpha(h) >= 0 of every fence.

    alpha  h (R,) m -> (R,) m/s, extended class K
    """

    fences: Fences
    alpha: Alpha

    def __call__(self, view: View) -> tuple[Constraints, ...]:
        """The rows of a view whose arrays are `[vehicle]`.

        Raises FloatingPointError naming the vehicle if h, its derivative or alpha(h) is not finite.
        """
        vehicle, state = self.fences.row_vehicle, view.state
        rows = self.fences.rows(state)
        lie = rows.lie(state.theta[vehicle])
        alpha_h = np.asarray(self.alpha(rows.h), dtype=float)
        return (Constraints.of((vehicle,), (lie.T,), rows.h, alpha_h),)
