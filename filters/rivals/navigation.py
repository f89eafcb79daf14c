"""Steers down a navigation function at constant speed: the baseline that the paper compares with.

Panyakeow & Mesbahi, "Decentralized deconfliction algorithms for unicycle UAVs" (ACC 2010), as the paper's
authors ran it: with a swirling term, and with the turn rate proportional to the heading error alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.cbf.problem import Problem, input_set
from filters.filter import Decision, Declaration
from filters.model import Array, Command, Limits, View
from filters.qp.single import Status

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class NavigationFilter:
    """Each vehicle descends V = gamma / (gamma^k + beta)^(1/k), computed from its own view.

    gamma is the squared distance to the goal plus `path_gain` times the squared distance to the line from
    start to goal, which fades within `path_radius` of the goal. beta is the product of one factor for each
    vehicle sensed, 0 in contact and 1 beyond `vehicle_radius + vehicle_margin`, and of factors that keep the
    vehicle inside a disc about the origin. The swirl adds to the gradient, for each vehicle sensed, a share
    of its length across the line of sight, so that head-on vehicles pass each other on one side.

    goal, start      (N, 2) or (N, 3) m; only x and y are used
    speed            m/s, what every vehicle flies
    gain             1/s, turn rate per heading error
    path_radius      m, r_p            path_gain      K_p
    exponent         k                 swirl          K_s
    vehicle_radius   m, rho_j          vehicle_margin m, delta_j
    disc_radius      m, rho_c          disc_margin    m, delta_c
    sensing_range    m, vehicles further away are not seen
    step             m, of the central differences
    Raises  ValueError if goal and start do not match or a length that divides is not positive.

    It guarantees nothing within actuator limits, so its status is NONE; the climb rate stays the nominal one.
    """

    goal: ArrayLike
    start: ArrayLike
    speed: float = 20.0
    gain: float = 0.6
    path_radius: float = 20.0
    path_gain: float = 20.0
    exponent: float = 0.2
    swirl: float = 0.08
    vehicle_radius: float = 0.0
    vehicle_margin: float = 5.0
    disc_radius: float = 2000.0
    disc_margin: float = 5.0
    sensing_range: float = 400.0
    step: float = 1.0

    def __post_init__(self) -> None:
        for name in ("goal", "start"):
            object.__setattr__(self, name, _plane(getattr(self, name), name))
        if np.shape(self.goal) != np.shape(self.start):
            raise ValueError(f"{np.size(self.goal)} goals do not match {np.size(self.start)} starts")
        positive = (
            "speed",
            "path_radius",
            "exponent",
            "vehicle_margin",
            "disc_margin",
            "sensing_range",
            "step",
        )
        for name in positive:
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive and finite, got {value}")

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """v = speed, omega = gain times the heading error, zeta nominal (N,), all clipped to the limits."""
        problem = Problem(*input_set(view, nominal, limits))
        n = len(problem.target)
        if np.shape(self.goal) != (n,):
            raise ValueError(f"{np.size(self.goal)} goals do not fit {n} vehicles")
        downhill = -self.gradient(view)
        error = np.angle(downhill * np.exp(-1j * view.own().state.theta))
        # On level ground there is no direction to seek: hold the course.
        omega = np.where(downhill == 0, 0.0, self.gain * error)
        wanted = np.stack([np.full(n, self.speed), omega, problem.target[:, 2]], axis=-1)
        u = np.minimum(np.maximum(wanted, problem.lower), problem.upper)
        return problem.decision(u, np.full(n, int(Status.NONE)), np.zeros(n), None, np.zeros(0))

    @property
    def declaration(self) -> Declaration:
        """Nothing: it has no barrier and solves no QP."""
        return Declaration()

    def gradient(self, view: View) -> Complex:
        """The direction (N,), east + 1j north, that each vehicle flies away from: grad V and the swirl."""
        own = view.own().state
        place = own.x + 1j * own.y
        seen = np.broadcast_to(view.state.x + 1j * view.state.y, (place.size, place.size))
        away = place[:, None] - seen
        height = np.broadcast_to(view.state.z, away.shape) - own.z[:, None]
        sensed = np.hypot(np.abs(away), height) <= self.sensing_range
        np.fill_diagonal(sensed, False)
        if view.known is not None:
            sensed &= view.knows(*np.indices(sensed.shape))

        east, west, north, south = (
            self._potential(place + d, seen, sensed)
            for d in (self.step, -self.step, 1j * self.step, -1j * self.step)
        )
        slope = (east - west + 1j * (north - south)) / (2 * self.step)
        distance = np.abs(away)
        # -1j turns the line of sight clockwise: the paper's cross product with the vertical.
        across = -1j * away / np.where(distance > 0, distance, 1.0)
        share = np.where(sensed, fade((self.sensing_range - distance) / self.sensing_range), 0.0)
        return np.asarray(slope - self.swirl * np.abs(slope) * np.sum(share * across, axis=1))

    def _potential(self, place: Complex, seen: Complex, sensed: NDArray[np.bool_]) -> Array:
        """V (N,) of each vehicle were it at `place` (N,), the others where it sees them (N, N)."""
        goal, start = np.asarray(self.goal), np.asarray(self.start)
        left = np.abs(place - goal)
        line = goal - start
        length = np.abs(line)
        offset = np.imag((place - start) * np.conj(line) / np.where(length > 0, length, 1.0))
        gamma = left**2 + self.path_gain * fade(left / self.path_radius) * offset**2
        apart = np.abs(place[:, None] - seen)
        disc = fade((self.disc_radius - np.abs(place)) / self.disc_margin)
        factor = fade((apart - self.vehicle_radius) / self.vehicle_margin) * disc[:, None]
        beta = np.prod(np.where(sensed, factor, 1.0), axis=1)
        bottom = (gamma**self.exponent + beta) ** (1.0 / self.exponent)
        return np.where(bottom > 0, gamma / np.where(bottom > 0, bottom, 1.0), 1.0)


def fade(r: Array) -> Array:
    """0 below r = 0, 1 above 1, two parabolas between; they jump from 1/4 to 3/4, as the authors ran it."""
    r = np.clip(r, 0.0, 1.0)
    return np.where(r < 0.5, r**2, 1.0 - (1.0 - r) ** 2)


def _plane(points: ArrayLike, name: str) -> Complex:
    p = np.asarray(points, dtype=float)
    if p.ndim != 2 or p.shape[1] not in (2, 3) or not np.isfinite(p).all():
        raise ValueError(f"{name} must be finite points (N, 2) or (N, 3) in metres, got shape {p.shape}")
    return np.asarray(p[:, 0] + 1j * p[:, 1])
