"""Chooses velocities outside the reciprocal velocity obstacles of all others (ORCA), within turn limits.

van den Berg, Guy, Lin & Manocha, "Reciprocal n-body collision avoidance", Robotics Research (ISRR 2009),
Springer 2011; in space with spheres, as the authors' RVO2-3D library. Written anew here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from filters.cbf.problem import Problem, input_set
from filters.constraints import Indices, dot
from filters.filter import Decision, Declaration
from filters.model import Array, Command, Limits, View
from filters.rivals.least_violation import solve_or_violate_least

# Below this relation of the sideways part of a vector to its length two vehicles meet exactly head-on.
HEAD_ON = 1e-9


@dataclass(frozen=True, eq=False)
class VelocityObstacleFilter:
    """Each vehicle takes the velocity nearest to the wanted one in the half spaces of all whom it sees.

    d_safe          m, distance to keep between two vehicles: the sum of the authors' two radii
    horizon         s, tau: velocities that bring two vehicles that near within it are avoided
    response        s, T: the time in which the chosen velocity is to be flown; it is also the authors' time
                    step, within which two vehicles that are too near already are to be apart
    responsibility  share of the needed change u of the relative velocity that each vehicle takes
    range           m, vehicles further away are not seen
    space           "level": others are discs, the authors' paper; "full": spheres, the authors' library
    passive         vehicles, from 0, that do not avoid others: beside them the share is 1
    Raises  ValueError for numbers out of range.

    Premises  everybody uses the same rule with responsibility >= 1/2, sees all the others, and flies the
              chosen velocity at once. The turn limit breaks the last: an aeroplane takes T to get there.
    Mapping   wanted velocity: along the course T s from now under the nominal turn rate. A vehicle chooses in
              the box of forward, sideways and climbing velocity that its limits let it reach in T, and
              commands the speed, climb rate and turn rate that give the chosen one after T.
    Where no velocity of the box is in all half spaces, that of the least violation is taken, as the authors
    do. It has no h; its status is that of the QP.
    """

    d_safe: float
    horizon: float = 10.0
    response: float = 1.0
    responsibility: float = 0.5
    range: float = 300.0
    space: Literal["level", "full"] = "level"
    passive: Sequence[int] = ()

    def __post_init__(self) -> None:
        for name in ("d_safe", "horizon", "response", "responsibility"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if self.responsibility > 1:
            raise ValueError(f"responsibility is a share up to 1, got {self.responsibility}")
        if not (np.isfinite(self.range) and self.range >= 0):
            raise ValueError(f"range must be finite and not negative, got {self.range} m")
        if self.space not in ("level", "full"):
            raise ValueError(f"space is 'level' or 'full', not {self.space!r}")

    @property
    def declaration(self) -> Declaration:
        """It solves a QP per vehicle; it has no barrier."""
        return Declaration(solves_qp=True)

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The commands (N,) inside `limits` that lead to the chosen velocities.

        Raises  ValueError if a nominal command is not finite, FloatingPointError if what is seen is not.
        """
        problem = Problem(*input_set(view, nominal, limits))
        v, omega, zeta = problem.clipped.T
        n, response = len(v), self.response
        observer, other, change, normal = self.half_spaces(view)
        own = view.own()
        course = own.state.theta
        ahead = np.stack([np.cos(course), np.sin(course)])
        # Velocities as each vehicle sees them: forward, to its left, up.
        frame = np.zeros((n, 3, 3))
        frame[:, 0, :2], frame[:, 1, :2], frame[:, 2, 2] = ahead.T, np.stack([-ahead[1], ahead[0]], -1), 1.0
        turn = omega * response
        wanted = np.stack([v * np.cos(turn), v * np.sin(turn), zeta], axis=-1)
        flown = velocity(own.state.theta, own.rates)
        share = np.where(np.isin(other, self.passive), 1.0, self.responsibility)
        level = dot(flown[observer] + share[:, None] * change, normal)
        rows = np.einsum("rab,rb->ra", frame[observer], normal)
        short = level - dot(rows, wanted[observer]) > 0
        left = np.bincount(observer[short], minlength=n) > 0
        box = reachable(problem, np.hypot(flown[:, 0], flown[:, 1]), response)
        use = left[observer]
        chosen, status = solve_or_violate_least(wanted, observer[use], rows[use], level[use], *box)
        speed, side = np.hypot(chosen[:, 0], chosen[:, 1]), np.arctan2(chosen[:, 1], chosen[:, 0])
        u = np.stack([speed, side / response, chosen[:, 2]], axis=-1)
        u = np.where(left[:, None], np.clip(u, problem.lower, problem.upper), problem.clipped)
        residual = np.zeros(n)
        np.maximum.at(residual, observer[use], (level - dot(rows, chosen[observer]))[use])
        return problem.decision(u, status, residual, None, np.zeros(0))

    def half_spaces(self, view: View) -> tuple[Indices, Indices, Array, Array]:
        """Observers and others (R,), u and its outward unit normals n (R, 3) m/s of the pairs in range.

        A velocity V of the observer is allowed where (V - V_own - responsibility u) n >= 0.
        """
        n = len(view.state)
        observer, other = np.nonzero(~np.eye(n, dtype=bool))
        if view.known is not None:
            seen = view.knows(observer, other)
            observer, other = observer[seen], other[seen]
        place, flown = view.state.position, velocity(view.state.theta, view.rates)
        if view.shared:
            apart, relative = place[other] - place[observer], flown[observer] - flown[other]
        else:
            apart = place[observer, other] - place[observer, observer]
            relative = flown[observer, observer] - flown[observer, other]
        near = dot(apart, apart) <= self.range**2
        if self.space == "level":
            # Who stays above or below over the horizon is not met; the others are as if at one height.
            least = least_height(apart[:, 2], -relative[:, 2], self.horizon)
            near &= least < self.d_safe
            flat = np.array([1.0, 1.0, 0.0])
            apart, relative = apart * flat, relative * flat
        apart, relative = apart[near], relative[near]
        if not (np.isfinite(apart).all() and np.isfinite(relative).all()):
            raise FloatingPointError("velocity obstacles need finite poses and rates")
        change, normal = least_change(apart, relative, self.d_safe, self.horizon, self.response)
        return observer[near], other[near], change, normal


def velocity(course: Array, rates: Command) -> Array:
    """Velocities (..., 3) m/s over the ground: east, north, up."""
    return np.stack([rates.v * np.cos(course), rates.v * np.sin(course), rates.zeta], axis=-1)


def reachable(problem: Problem, speed: Array, response: float) -> tuple[Array, Array]:
    """The box (N, 3) of forward, sideways and climbing velocity that can be flown `response` s from now.

    speed  (N,) m/s over the ground now
    Sideways is what the turn limit gives at the present speed, up to a quarter turn.
    """
    lower, upper = problem.lower, problem.upper
    most = np.minimum(np.maximum(-lower[:, 1], upper[:, 1]) * response, 0.5 * np.pi)
    side = np.clip(speed, lower[:, 0], upper[:, 0]) * np.sin(most)
    forward = lower[:, 0] * np.cos(most)
    return (
        np.stack([forward, -side, lower[:, 2]], axis=-1),
        np.stack([upper[:, 0], side, upper[:, 2]], axis=-1),
    )


def least_change(
    apart: Array, relative: Array, d_safe: float, horizon: float, step: float
) -> tuple[Array, Array]:
    """u (R, 3), the least change of `relative` to the border of the velocity obstacle, and its normal.

    apart, relative  (R, 3) m and m/s: the other's position from the observer, the observer's velocity
                     relative to it
    The obstacle is the cone of velocities that lead to within `d_safe` inside `horizon`: a truncated cone
    with a spherical cap. Two nearer than d_safe are to be apart after `step`. Normals point out of it; of an
    exact head-on or overtaking course they point to the right, of which each has its own.
    """
    distance2 = dot(apart, apart)
    distance = np.sqrt(distance2)
    inside = distance <= d_safe
    tau = np.where(inside, step, horizon)
    # From the centre of the cap, or of the sphere of two that are too near.
    w = relative - apart / tau[:, None]
    size = np.sqrt(dot(w, w))
    ahead = dot(w, apart)
    on_cap = inside | ((ahead < 0.0) & (ahead**2 > d_safe**2 * size**2))
    right = _rightwards(apart)
    cap = np.where((size > HEAD_ON)[:, None], w / np.where(size > HEAD_ON, size, 1.0)[:, None], right)
    # Side of the cone: away from its axis, tilted back by the cone's half angle.
    axis = apart / np.where(distance > 0, distance, 1.0)[:, None]
    along = dot(relative, axis)
    across = relative - along[:, None] * axis
    off = np.sqrt(dot(across, across))
    speed = np.sqrt(dot(relative, relative))
    off_axis = off > HEAD_ON * np.maximum(speed, 1e-300)
    away = np.where(off_axis[:, None], across / np.where(off_axis, off, 1.0)[:, None], right)
    sine = np.where(inside, 0.0, d_safe / np.where(distance > 0, distance, 1.0))
    cosine = np.sqrt(np.maximum(1.0 - sine**2, 0.0))
    leg = cosine[:, None] * away - sine[:, None] * axis
    normal = np.where(on_cap[:, None], cap, leg)
    # How far inside the obstacle the relative velocity is: outside it is negative, and u then leads back.
    depth = np.where(on_cap, d_safe / tau - size, sine * along - cosine * off)
    return depth[:, None] * normal, normal


def least_height(height: Array, rate: Array, horizon: float) -> Array:
    """The least |height + rate t| (R,) m over t from 0 to `horizon` s; rate in m/s."""
    end = height + rate * horizon
    return np.where(height * end <= 0, 0.0, np.minimum(np.abs(height), np.abs(end)))


def _rightwards(apart: Array) -> Array:
    """Unit vectors (R, 3) level and to the right of the line of sight; north of a vertical one."""
    level = np.hypot(apart[:, 0], apart[:, 1])
    flat = level > 0
    scale = np.where(flat, level, 1.0)
    east = np.where(flat, apart[:, 1], 0.0) / scale
    north = np.where(flat, -apart[:, 0], 1.0) / scale
    return np.stack([east, north, np.zeros(len(apart))], axis=-1)
