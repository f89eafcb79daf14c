"""Bounds how far any input of one period moves a vehicle from gamma's flow, so that rows can be left out.

The bounds are proofs. A channel told more is at no time lower, so the channels' integrals lie between those
under the ends of the box; and |v e^{j theta} - v' e^{j theta'}| <= |v - v'| + v' |theta - theta'|.

`Reach` knows of a direction as well. Almost all of a displacement comes of the course. A course that is
changed by delta before the vehicle has got far turns what lies ahead about where it is now: with P the
position at a sample and P0 that of now, P moves along the unit vector e by delta e j (P - P0). What that
leaves is `rest`: the way flown less or more; the way flown while the course still changes, which is the
integral of |P - P0| over delta; and terms of delta squared. Positions are summed over periods with each
period's mean course, for which a period's way times delta is added.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from filters.constraints import Indices
from filters.flow.rollout import Begun, Complex, steps
from filters.model import Array

# Numbers differ by rounding from one way of computing them to another [m].
_ROUND_OFF = 1e-9


@dataclass(frozen=True, eq=False)
class Reach:
    """How far any input of the box can move each vehicle from gamma's flow.

    at       (N, M) m at the instants, in any direction
    centre   (N,) m the circle's centre, level
    arm      (N,) m the arm
    circle   (N,) m at any phase of the circle, with its height
    start    (N,) complex m, where they are now
    right, left  (N, K) rad by which the course turns at most
    down, up     (N, K) m
    rest         (N, K) m along any unit vector, besides what the turn about `start` and the climb do
    begun        (N, M) m at any phase of the circles that begin at the instants; None if not asked for

    K is M instants, the circle, and if asked for the M circles that begin at the instants.
    """

    at: Array
    centre: Array
    arm: Array
    circle: Array
    start: Complex
    right: Array
    left: Array
    down: Array
    up: Array
    rest: Array
    begun: Array | None = None

    def along(self, k: Indices, across: Array, climb: Array) -> Array:
        """How far (R,) m any input moves vehicles against unit vectors e, at most.

        k       (R,) place in (N, K)
        across  (R,) m, e j (P - P0)
        climb   (R,) e's vertical part
        """
        most: Array = np.maximum(self.right.take(k) * across, self.left.take(k) * -across)
        most += np.maximum(self.down.take(k) * climb, self.up.take(k) * -climb)
        most += self.rest.take(k)
        return most

    def still(self, vehicles: Indices) -> Reach:
        """Of vehicles (P,) of which nothing is asked. What their circles may change stays."""
        none = np.zeros((vehicles.size, self.rest.shape[1]))
        at = none[:, : self.at.shape[1]]
        start, centre, arm = self.start[vehicles], self.centre[vehicles], self.arm[vehicles]
        begun = None if self.begun is None else at
        return Reach(at, centre, arm, none[:, 0], start, none, none, none, none, none, begun)

    def with_still(self, vehicles: Indices) -> Reach:
        """These vehicles, and after them as many of which nothing is asked."""
        other = self.still(vehicles)
        joined = {
            f.name: np.concatenate([getattr(self, f.name), getattr(other, f.name)])
            for f in fields(self)
            if getattr(self, f.name) is not None
        }
        return Reach(**joined)


def furthest(begun: Begun, gamma: Array, lower: Array, upper: Array, circles: bool = False) -> Reach:
    """How far any input of the box can move each vehicle.

    gamma, lower, upper  (N, 3, M) integrals of the channels under gamma and under the ends of the box
    circles              whether those that begin at the instants are asked for
    """
    low, high = gamma - lower, upper - gamma
    off = np.maximum(np.abs(low), np.abs(high))
    turned, climbed = off[:, 1], off[:, 2]
    way = np.abs(steps(gamma[:, 0]))
    swept, flown = np.cumsum(way * turned, axis=-1), np.cumsum(way, axis=-1)
    level = off[:, 0] + swept
    radius = np.abs(begun.gamma[:, 0] / begun.gamma[:, 1])
    arm = radius * turned[:, -1]
    centre = level[:, -1] + arm
    circle = centre + arm
    # The way flown over the course's change, by parts; then what is of second order.
    rest = off[:, 0] + (flown * turned - swept) + 0.5 * turned * swept
    rest += way.max(axis=-1, keepdims=True) * turned + _ROUND_OFF
    # The arm turns with the course, whose phase may be the opposite one.
    round_ = rest + radius[:, None] * turned**2
    circle_from = np.sqrt((level + 2 * radius[:, None] * turned) ** 2 + climbed**2) if circles else None
    later = slice(None) if circles else slice(0)
    right, left, down, up = (
        np.concatenate([x, x[:, -1:], x[:, later]], axis=-1)
        for x in (low[:, 1], high[:, 1], low[:, 2], high[:, 2])
    )
    return Reach(
        np.sqrt(level**2 + climbed**2),
        centre,
        arm,
        np.sqrt(circle**2 + climbed[:, -1] ** 2),
        begun.state.x + 1j * begun.state.y,
        right,
        left,
        down,
        up,
        np.concatenate([rest, round_[:, -1:], round_[:, later]], axis=-1),
        circle_from,
    )
