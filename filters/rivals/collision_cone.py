"""Keeps each vehicle's velocity out of the collision cones of the others: the collision-cone CBF.

Thontepu, Goswami, Tayal, Singh, Sundar, Sundaram, Katewa & Kolathaya, "Collision cone control barrier
functions for kinematic obstacle avoidance in UGVs" (Indian Control Conference 2023, arXiv:2209.11524).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from filters.cbf.problem import Cost, Problem, input_set
from filters.constraints import Constraints, Indices, dot
from filters.filter import Check, Decision, Declaration, MonitorRecord
from filters.model import Array, Command, Limits, View
from filters.qp.single import Status
from filters.rivals.least_violation import solve_or_violate_least
from filters.rivals.velocity_obstacles import velocity

# Of the safe distance: the length of a tangent to the other's sphere is at least this. At the sphere itself
# the cone is a half space, and the rate of h is without bound.
LEAST_TANGENT = 0.1


# What a filter period's curvature may take from h [m^2/s]: 5 cm of distance at 20 m/s.
TOLERANCE = 1.0


def cone_checks() -> dict[str, Check]:
    """What the filter watches: h of pairs met for the first time, and of those outside a step ago."""
    return {
        "cone_start": Check("who is met for the first time is met outside the collision cone [m^2/s]", 0.0),
        "cone_kept": Check("relative velocities outside a collision cone stay outside [m^2/s]", -TOLERANCE),
    }


@dataclass(frozen=True, eq=False)
class CollisionConeFilter:
    """One QP per vehicle with a row hdot + gamma h >= 0 for every other vehicle in range.

    With p the other's position from the vehicle, w its velocity relative to the vehicle and r the distance to
    keep, h = p w + |p| |w| cos(phi), cos(phi) = sqrt(|p|^2 - r^2) / |p|: it is >= 0 where w does not point
    into the cone of directions that lead to the vehicle's sphere.

    d_safe          m, r
    decay           1/s, gamma
    speed_response  s, T_v: the authors' vehicle is driven by its acceleration a and its turn rate changes its
                    velocity; ours is given speeds, so a = (v_commanded - v) / T_v
    climb_response  s, T_z: likewise of the climb rate, which the authors' level vehicle has not
    range           m, vehicles further away have no row
    cost            see `filters.cbf.problem.Problem`
    Raises  ValueError for numbers out of range.

    Premises  the other keeps its velocity (each vehicle carries the whole row); h >= 0 at the start; some
              input within the limits satisfies the rows. The authors assume unlimited inputs for their proof.
    In units of the row the input is affine: hdot = L_f h + c (a e + v omega n + climb acceleration), with
    e and n the unit vectors along and to the left of the course and c = -(p + w sqrt(|p|^2 - r^2) / |w|). No
    point ahead of the axle is needed, which the authors use to reach a torque; omega turns the velocity
    itself. A vehicle whose rows contradict each other flies the input that violates them least.
    """

    d_safe: float
    decay: float = 1.0
    speed_response: float = 1.0
    climb_response: float = 1.0
    range: float = 150.0
    cost: Cost = "range"
    record: MonitorRecord = field(default_factory=lambda: MonitorRecord(checks=cone_checks()))
    _last: dict[str, Array] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        for name in ("d_safe", "decay", "speed_response", "climb_response"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not (np.isfinite(self.range) and self.range >= 0):
            raise ValueError(f"range must be finite and not negative, got {self.range} m")
        if self.cost not in ("raw", "range"):
            raise ValueError(f"cost is 'raw' or 'range', not {self.cost!r}")

    @property
    def declaration(self) -> Declaration:
        """It solves QPs; its h is of poses and velocities, so no barrier of poses is its own."""
        return Declaration(solves_qp=True, record=self.record)

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The nearest commands to `nominal` (N,) inside `limits` that satisfy every row.

        Raises  ValueError if a nominal command, FloatingPointError if a row, is not finite.
        """
        problem = Problem(*input_set(view, nominal, limits), cost=self.cost)
        rows, other = self.rows(view)
        self._note(len(view.state), rows.vehicles[0], other, rows.h)
        (vehicle,), (lie,), u = rows.vehicles, rows.lie, problem.clipped
        short, status = rows.rhs - rows.left(u), np.full(len(u), int(Status.SOLVED))
        residual = np.zeros(len(u))
        if (short > 0).any():
            use = (np.bincount(vehicle[short > 0], minlength=len(u)) > 0)[vehicle]
            w = np.ones_like(u) if problem.scale is None else problem.scale
            box = (x / w for x in (problem.lower, problem.upper))
            asked = vehicle[use], (lie * w[vehicle])[use], rows.rhs[use]
            found, status = solve_or_violate_least(problem.target / w, *asked, *box)
            altered = np.bincount(vehicle[use], minlength=len(u))[:, None] > 0
            u = np.where(altered, np.clip(found * w, problem.lower, problem.upper), u)
            np.maximum.at(residual, vehicle, rows.rhs - rows.left(u))
        return problem.decision(u, status, residual, None, np.zeros(0))

    def _note(self, n: int, observer: Indices, other: Indices, h: Array) -> None:
        """Watch h (R,) of this step against the last one's."""
        record, now = self.record, np.full((n, n), np.nan)
        now[observer, other] = h
        before = self._last.get("h", np.full((n, n), np.nan))[observer, other]
        for name, which in (("cone_start", np.isnan(before)), ("cone_kept", before >= 0)):
            record.checks[name].see(record.steps, h[which], observer[which], other[which])
        self._last["h"] = now
        record.steps += 1

    def rows(self, view: View) -> tuple[Constraints, Indices]:
        """A row for each vehicle and each other in range, as the vehicle sees it; and the others (R,)."""
        n = len(view.state)
        observer, other = np.nonzero(~np.eye(n, dtype=bool))
        if view.known is not None:
            seen = view.knows(observer, other)
            observer, other = observer[seen], other[seen]
        place, flown, own = view.state.position, velocity(view.state.theta, view.rates), view.own()
        theirs = (other,) if view.shared else (observer, other)
        mine = (observer,) if view.shared else (observer, observer)
        p, w = place[theirs] - place[mine], flown[theirs] - flown[mine]
        far = dot(p, p) > self.range**2
        observer, other, p, w = observer[~far], other[~far], p[~far], w[~far]
        h, tangent, speed = cone(p, w, self.d_safe)
        toward = w / np.where(speed > 0, speed, 1.0)[:, None]
        lever = -(p + tangent[:, None] * toward)
        course, v, climb = own.state.theta[observer], own.rates.v[observer], own.rates.zeta[observer]
        ahead = lever[:, 0] * np.cos(course) + lever[:, 1] * np.sin(course)
        left = lever[:, 1] * np.cos(course) - lever[:, 0] * np.sin(course)
        up = lever[:, 2] / self.climb_response
        drift = speed**2 + speed * dot(p, w) / tangent - ahead * v / self.speed_response - up * climb
        lie = np.stack([ahead / self.speed_response, v * left, up], axis=-1)
        return Constraints.of((observer,), (lie,), h, self.decay * h, drift), other


def cone(p: Array, w: Array, d_safe: float) -> tuple[Array, Array, Array]:
    """h (R,) m^2/s, the tangent's length sqrt(|p|^2 - r^2) m and the speed |w| m/s.

    p, w  (R, 3) m and m/s, the other's position and velocity relative to the vehicle
    The tangent is not shorter than `LEAST_TANGENT` d_safe, also inside the sphere.
    """
    tangent = np.sqrt(np.maximum(dot(p, p) - d_safe**2, (LEAST_TANGENT * d_safe) ** 2))
    speed = np.sqrt(dot(w, w))
    return dot(p, w) + tangent * speed, tangent, speed
