"""A filter and guidance of your own: a collision cone with a barrier that it declares, and a way point.

testbed run paper-2-turn --parts 'my_parts.py:Cone(gain=2)' --parts my_parts.py:Aside
"""

import numpy as np

from filters.barriers.class_k import linear
from filters.barriers.pairs import ARRAYS, PairValues, all_pairs, root_form
from filters.cbf.collision import CollisionFilter
from filters.filter import Declaration
from filters.model import Command


class ConeBarrier:
    """h = sqrt(|p|^2 - Ds^2) + p.w/|w| [m], p and w being position and velocity of j relative to i.

    If all fly straight on at speeds v_k, Ds is kept for ever exactly if h >= 0: w lies outside the cone of
    directions that lead to the disc of radius Ds. On that manoeuvre dh/dt = |w| (1 + p.w / (|w| sqrt(...)))
    is not negative where h >= 0: it satisfies the rows of all pairs at once, so the QP has a solution. The
    speeds differ, which keeps w from vanishing and h smooth.
    """

    def __init__(self, d_safe, speeds):
        self.d_safe, self.speeds = d_safe, speeds

    def manoeuvre(self, n):
        return Command(self.speeds, np.zeros(n), np.zeros(n))

    def values(self, state, i=None, j=None):
        i, j = all_pairs(len(state)) if i is None else (i, j)
        v = self.speeds[:, None] * np.stack([np.cos(state.theta), np.sin(state.theta), 0 * state.z], axis=-1)
        turned = np.stack([-v[:, 1], v[:, 0], v[:, 2]], axis=-1)  # d v / d theta
        p, w = state.position[j] - state.position[i], v[j] - v[i]
        speed = np.linalg.norm(w, axis=-1)[:, None]
        ahead = w / speed
        side, slope = root_form(np.sum(p * p, axis=-1) - self.d_safe**2, self.d_safe, ARRAYS)
        h = side + self.d_safe + np.sum(p * ahead, axis=-1)
        along = 2 * slope[:, None] * p + ahead  # d h / d p
        across = (p - np.sum(p * ahead, axis=-1)[:, None] * ahead) / speed  # d h / d w
        on_i, on_j = -np.sum(across * turned[i], axis=-1), np.sum(across * turned[j], axis=-1)
        x, y, z = along.T
        return PairValues(i, j, h, np.stack([-x, -y, on_i, -z, x, y, on_j, z], axis=-1))


class Cone:
    """The QP of the paper with the rows of the cone: hdot + gain h >= 0."""

    def __init__(self, scenario, barrier, gain=1.0, speed_mps=20.0, step=0.01):
        speeds = speed_mps * (1 + step * np.arange(scenario.vehicles))
        self.filter = CollisionFilter(ConeBarrier(barrier.d_safe, speeds), linear(gain))

    def __call__(self, view, nominal, limits):
        return self.filter(view, nominal, limits)

    @property
    def declaration(self):
        rows = self.filter.declaration
        return Declaration(rows.barrier, rows.constraints, rows.alpha, solves_qp=True)


class Aside:
    """Flies to a point `aside_m` to the right of the middle of its way, and from there to its goal."""

    def __init__(self, goal, aside_m=20.0, near_m=25.0, speed_mps=20.0, gain_per_s=0.5):
        self.goal, self.aside, self.near = goal, aside_m, near_m
        self.speed, self.gain, self.points = speed_mps, gain_per_s, None

    def __call__(self, t, state):
        if self.points is None:
            way = self.goal - state.position
            right = np.stack([way[:, 1], -way[:, 0], 0 * way[:, 2]], axis=-1)
            right /= np.linalg.norm(right, axis=-1)[:, None]
            self.points = state.position + way / 2 + self.aside * right
        to = self.points - state.position
        passed = np.linalg.norm(to[:, :2], axis=-1) < self.near
        self.points = np.where(passed[:, None], self.goal, self.points)
        to = self.points - state.position
        error = np.remainder(np.arctan2(to[:, 1], to[:, 0]) - state.theta + np.pi, 2 * np.pi) - np.pi
        return Command(np.full(len(state), self.speed), self.gain * error, 0.1 * to[:, 2])
