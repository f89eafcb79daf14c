"""Computes h by flying the evading manoeuvre on from recorded states, without the filter's closed forms.

Two vehicles that turn at one rate come back after a period, and along it the safety function is a constant
and one harmonic: its least value follows from a few instants of the rollout. Two that fly straight are
closest where their range stops shrinking. The response of h to an input follows by the chain rule through
the safety function at those instants.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import radians
from typing import Any

import numpy as np

from testbed.verification import rollouts
from testbed.verification.recorded import Array

INSTANTS = 12  # of a turn's period; three would do
# Below this share of Ds the root of the paper's safety function is carried on as a straight line.
LINEAR_SHARE = 0.1
# Round-off of sums of squared ranges, as a share of the largest; a harmonic below it has no direction. Errors
# seen are a tenth of that (tests/test_verification_future.py).
NOISE = 1e-13


@dataclass(frozen=True)
class Pose:
    """Where vehicles are: position (..., 3) m, theta (...) rad."""

    position: Array
    theta: Array

    def of(self, vehicle: Array) -> Pose:
        """The poses (..., P) of the vehicles (P,) of pairs."""
        return Pose(self.position[..., vehicle, :], self.theta[..., vehicle])


@dataclass(frozen=True)
class Flown:
    """The result of flying on from poses: h, and its response to inputs.

    h         (..., P)        m, or m^2 in its squared form
    lie       (2, 3, ..., P)  change of h as vehicle i or j moves ahead, turns, climbs
    off, lie_off              what round-off may have done to them
    harmonic  (..., P)        complex, m^2: its size is the distance to the kink; None where there is none
    """

    h: Array
    lie: Array
    off: Array
    lie_off: Array
    harmonic: Array | None

    def among(self, which: Array) -> Flown:
        """Of `which` (P,) of the pairs alone."""
        harmonic = None if self.harmonic is None else self.harmonic[..., which]
        lies = self.lie[..., which], self.lie_off[..., which]
        return Flown(self.h[..., which], lies[0], self.off[..., which], lies[1], harmonic)

    def hdot(self, u_i: Array, u_j: Array) -> tuple[Array, Array]:
        """L_g h u (..., P) under inputs (..., P, 3), and what round-off may have done to it."""
        total, off = np.zeros(self.h.shape), np.zeros(self.h.shape)
        for side, u in enumerate((u_i, u_j)):
            for k in range(3):
                total = total + self.lie[side, k] * u[..., k]
                off = off + self.lie_off[side, k] * np.abs(u[..., k])
        return total, off


@dataclass(frozen=True)
class Future:
    """The evading manoeuvre of a scenario's `barrier` table, and Ds, for pairs i < j (P,) of its vehicles."""

    kind: str
    form: str
    d_safe: float
    speed_i: Array
    speed_j: Array
    rate: Array
    climb_i: Array
    climb_j: Array
    delta: float
    smoothing: float
    rate_j: Array | float = 0.0  # of the vehicles j, where it differs
    any_kink: bool = False  # whether the gradient at a kink may be that of any minimum, as a rollout's is

    def fly(self, a: Pose, b: Pose) -> Flown:
        """From poses (..., P) of the vehicles i and j."""
        flown = {"turn": self._turn, "rollout": self._rollout}.get(self.kind, self._straight)(a, b)
        least, change, off, change_off, harmonic = flown
        h, slope = self._root(least)
        if self.form == "root":
            change_off = change_off + np.abs(change) * off * 2.0 * slope**2
        return Flown(h, slope * change, slope * off, slope * change_off, harmonic)

    def of(self, p: Array) -> Future:
        """Of the pairs p (M,) of these, as often as they are named."""
        fields = ["speed_i", "speed_j", "rate", "climb_i", "climb_j"]
        fields += ["rate_j"] if np.ndim(self.rate_j) else []
        return replace(self, **{name: getattr(self, name)[p] for name in fields})

    def _turn(self, a: Pose, b: Pose) -> tuple[Array, Array, Array, Array, Array | None]:
        """Least safety function [m^2] over a period of the turn, its change, their errors, the harmonic."""
        shape = a.theta.shape
        mean, first = np.zeros(shape), np.zeros(shape, dtype=complex)
        mean_change, first_change = np.zeros((2, 3, *shape)), np.zeros((2, 3, *shape), dtype=complex)
        size = np.zeros(shape)
        for turned, apart, flown in self._around(a, b):
            square = np.sum(apart**2, axis=-1)
            size = np.maximum(size, square)
            rho, slope = self._safety(square, a.theta + turned)
            change = _change(apart, a, b, flown)
            change[0, 1] += slope
            wave = 2.0 / INSTANTS * np.exp(-1j * turned)
            mean, first = mean + rho / INSTANTS, first + wave * rho
            mean_change, first_change = mean_change + change / INSTANTS, first_change + wave * change
        swing = np.hypot(np.abs(first), self.smoothing)
        directed = np.abs(first) > NOISE * size
        along = np.where(directed, first.conj(), 0.0) / np.where(swing > 0.0, swing, 1.0)
        off = NOISE * (1.0 + size)
        # How far the harmonic's direction may be wrong turns its change.
        lost = 1.0 if self.any_kink else 0.0
        astray = np.where(directed, off / np.maximum(swing, off), lost) + NOISE
        change_off = np.abs(first_change) * astray + NOISE * (1.0 + np.abs(mean_change))
        return mean - swing, mean_change - (along * first_change).real, off, change_off, first

    def _around(self, a: Pose, b: Pose) -> Iterator[tuple[Array, Array, list[tuple[Array, Array]]]]:
        """Instants of the turn: the angle turned (P,), the offset, how far i and j have flown."""
        for k in range(INSTANTS):
            turned = 2 * np.pi * k / INSTANTS * np.sign(self.rate)
            apart, flown = a.position - b.position, []
            for sign, speed, pose in ((1.0, self.speed_i, a), (-1.0, self.speed_j, b)):
                after = pose.theta + turned
                east = speed / self.rate * (np.sin(after) - np.sin(pose.theta))
                north = -speed / self.rate * (np.cos(after) - np.cos(pose.theta))
                apart[..., 0] += sign * east
                apart[..., 1] += sign * north
                flown.append((east, north))
            yield turned, apart, flown

    def _safety(self, square: Array, course: Array) -> tuple[Array, Array]:
        """The paper's safety function [m^2], its rounding of the kink included; its slope by i's course."""
        tilt = self.delta * (2.0 + np.cos(course) - np.sin(course))
        return square - tilt, self.delta * (np.sin(course) + np.cos(course))

    def h(self, a: Pose, b: Pose) -> Array:
        """h alone, in the numbers' own precision."""
        if self.kind != "turn":
            return self.fly(a, b).h
        mean = first = np.zeros(())
        for turned, apart, _ in self._around(a, b):
            rho, _ = self._safety(np.sum(apart**2, axis=-1), a.theta + turned)
            mean, first = mean + rho / INSTANTS, first + 2.0 / INSTANTS * np.exp(-1j * turned) * rho
        return self._root(mean - np.hypot(np.abs(first), self.smoothing))[0]

    def _root(self, least: Array) -> tuple[Array, Array]:
        """h and dh/d least of the least safety function [m^2]."""
        if self.form == "squared":
            return least - self.d_safe**2, np.ones_like(least)
        edge = LINEAR_SHARE * self.d_safe
        root = np.sqrt(np.maximum(least, edge**2))
        line = edge + (least - edge**2) / (2.0 * edge)
        return np.where(least >= edge**2, root, line) - self.d_safe, 0.5 / root

    def _rollout(self, a: Pose, b: Pose) -> tuple[Array, Array, Array, Array, Array | None]:
        """Least squared range [m^2] of vehicles on different manoeuvres, its change, their errors."""
        shape, sides = a.theta.shape, []
        of = ((a, self.speed_i, self.rate, self.climb_i), (b, self.speed_j, self.rate_j, self.climb_j))
        for pose, *gamma in of:
            x, y, z = (pose.position[..., k].ravel() for k in range(3))
            told = tuple(np.broadcast_to(g, shape).ravel() for g in gamma)
            sides.append(((x, y, pose.theta.ravel(), z), told))
        when, second = rollouts.least(sides[0], sides[1])
        apart = np.stack(rollouts.offset(sides[0], sides[1], when), axis=-1).reshape(*shape, 3)
        ways = [rollouts.after(side, when) for side in sides]
        flown = [(east.reshape(shape), north.reshape(shape)) for east, north, _ in ways]
        square, change = np.sum(apart**2, axis=-1), _change(apart, a, b, flown)
        off = NOISE * (1.0 + 100.0 * square)
        # Where a second minimum is as low, the gradient may be that of either.
        tied = (second.reshape(shape) <= 1e-6 * (1.0 + square)) * 1.0
        reach = np.sqrt(square) * (np.abs(self.speed_i) + np.abs(self.speed_j)) * (1.0 + when.reshape(shape))
        # Half the digits of the time at which a smooth minimum lies are lost.
        change_off = (1e-7 + tied) * (1.0 + reach) * np.ones((2, 3, *[1] * len(shape)))
        return square, change, off, change_off, None

    def _straight(self, a: Pose, b: Pose) -> tuple[Array, Array, Array, Array, Array | None]:
        """Least squared range [m^2] of vehicles that fly straight on, its change, their errors."""
        velocity = []
        for speed, climb, pose in ((self.speed_i, self.climb_i, a), (self.speed_j, self.climb_j, b)):
            ahead = [speed * np.cos(pose.theta), speed * np.sin(pose.theta)]
            velocity.append(np.stack([*ahead, np.broadcast_to(climb, pose.theta.shape)], axis=-1))
        apart, closing = a.position - b.position, velocity[0] - velocity[1]
        pace = np.sum(closing**2, axis=-1)
        when = -np.sum(apart * closing, axis=-1) / np.where(pace > 0.0, pace, 1.0)
        when = np.maximum(when, 0.0)
        closest = apart + when[..., None] * closing
        flown = [(when * v[..., 0], when * v[..., 1]) for v in velocity]
        change = _change(closest, a, b, flown)
        size = np.sqrt(np.sum(apart**2, axis=-1)) + when * np.sqrt(pace)
        reach = np.stack([np.ones(when.shape), when * (np.abs(self.speed_i) + np.abs(self.speed_j)) + 1.0])
        change_off = NOISE * (1.0 + 2.0 * size * reach[[0, 1, 0]]) * np.ones((2, 1, *[1] * when.ndim))
        return np.sum(closest**2, axis=-1), change, NOISE * (1.0 + size**2), change_off, None


def _change(apart: Array, a: Pose, b: Pose, flown: list[tuple[Array, Array]]) -> Array:
    """Change (2, 3, ...) of |apart|^2 as i or j starts further ahead, turned, higher.

    flown  displacement (east, north) of i and j until then; a turn of the start swings it
    """
    change = np.empty((2, 3, *a.theta.shape))
    for side, (sign, pose, (east, north)) in enumerate(zip((1.0, -1.0), (a, b), flown, strict=True)):
        x, y, z = (2.0 * sign * apart[..., k] for k in range(3))
        change[side, 0] = x * np.cos(pose.theta) + y * np.sin(pose.theta)
        change[side, 1] = y * east - x * north
        change[side, 2] = z
    return change


def future(s: dict[str, Any], i: Array, j: Array) -> Future | None:
    """Of the pairs (i, j), from 0; None for a manoeuvre that is not covered here."""
    b, n = s["barrier"], s["vehicles"]
    kind, zero = b["kind"], np.zeros(n)
    delta = smoothing = 0.0
    if kind == "turn" and b.get("pairs"):  # each pair has its own; all pairs are given, in order
        speed_i = speed_j = np.array([p["v_mps"] for p in b["pairs"]])
        rate = np.radians([p["omega_degps"] for p in b["pairs"]])
        return Future(
            "turn", b["form"], s["d_safe_m"], speed_i, speed_j, rate, zero, zero, b["delta_m2"], 0.0
        )
    v, omega, zeta = (c.copy() for c in manoeuvre(s).T)
    if kind == "turn":
        delta, smoothing = b["delta_m2"], b["smoothing_m2"]
    elif kind == "euclidean":
        v, omega = zero, zero  # nobody moves
    elif kind == "rollout":
        # A climb of all alike changes no distance.
        alike = np.ptp(zeta) == 0.0
        if not (np.ptp(omega) or (omega[0] and not alike)):
            kind = "turn" if omega[0] else "straight"
    flown = v[i], v[j], omega[i], zeta[i], zeta[j]
    more = omega[j], b["kind"] == "rollout"
    return Future(kind, b["form"], s["d_safe_m"], *flown, delta, smoothing, *more)


def manoeuvre(s: dict[str, Any]) -> Array:
    """gamma (N, 3): v, omega, zeta of each vehicle. For the Euclidean barrier it is the fallback."""
    b, n = s["barrier"], s["vehicles"]
    gamma = np.zeros((n, 3))
    if b["kind"] == "rollout":
        listed = [(m["v_mps"], radians(m["omega_degps"]), m["zeta_mps"]) for m in b["manoeuvres"]]
        return np.array([listed[k % len(listed)] for k in range(n)])
    if b.get("pairs"):  # nobody has one for all others
        return gamma
    gamma[:, 0] = b["v_mps"]
    if b["kind"] == "straight":
        gamma[:, 0] *= 1.0 + b["speed_step"] * np.arange(1, n + 1)
        gamma[:, 2] = np.resize(np.asarray(b["zeta_mps"], dtype=float), n)
        return gamma
    gamma[:, 1] = radians(b["omega_degps"])
    if b["kind"] == "turn":
        gamma[:, 0] *= np.resize(np.asarray(b["sigma"], dtype=float), n)
    return gamma


# Pairs times instants flown on at once: what that takes of memory stays below some hundred megabytes.
BLOCK = 100_000


def fly_on(s: dict[str, Any], pose: Pose, i: Array, j: Array) -> Flown | None:
    """From poses (T, N), all pairs: h (T, P) and the rest; None for a manoeuvre of another kind."""
    made = future(s, i, j)
    if made is None:
        return None
    rows = max(1, BLOCK // max(1, i.size))
    parts = []
    for k in range(0, max(1, len(pose.theta)), rows):  # no instants give empty arrays
        some = Pose(pose.position[k : k + rows], pose.theta[k : k + rows])
        parts.append(made.fly(some.of(i), some.of(j)))
    harmonics = [p.harmonic for p in parts if p.harmonic is not None]
    return Flown(
        np.concatenate([p.h for p in parts]),
        np.concatenate([p.lie for p in parts], axis=2),
        np.concatenate([p.off for p in parts]),
        np.concatenate([p.lie_off for p in parts], axis=2),
        np.concatenate(harmonics) if harmonics else None,
    )


def barrier(s: dict[str, Any], position: Array, theta: Array, i: Array, j: Array) -> Array | None:
    """h (T, P) of pairs at positions (T, N, 3) and courses (T, N); None for a manoeuvre of another kind."""
    flown = fly_on(s, Pose(position, theta), i, j)
    return None if flown is None else flown.h
