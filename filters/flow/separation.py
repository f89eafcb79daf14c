"""Compares the vehicles' flows: distances under gamma, and each vehicle's rows to keep them.

With P_i(u) a vehicle's position at one sample of its flow, e the unit vector from j to i under gamma and
s = |P_i - P_j| - (Ds + m), vehicle i keeps e (P_i(u_i) - P_i(gamma)) >= -kappa/2 max(s, 0), and j the same
with -e. Then |P_i(u_i) - P_j(u_j)| >= e (P_i(u_i) - P_j(u_j)) >= Ds + m + s - kappa max(s, 0): neither needs
to know what the other chooses, and u = gamma satisfies every row.

Samples at which no input can break a row are left out, unless a pair may be nearest there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.constraints import Indices
from filters.flow.phases import Phases
from filters.flow.reach import Reach
from filters.flow.rollout import Complex, Paths
from filters.model import Array

# Instants looked at together: one distance and the ways flown bound the others.
_BLOCK = 8
# Of so many instants, circles are kept that begin at one.
_STRIDE = 3
# Numbers differ by rounding from one way of computing them to another [m].
_ROUND_OFF = 1e-6


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of pairs (P,) under gamma: T at instants, B on circles begun there, others on the last circle.

    p, q        (S,) the two vehicles of each sample
    at_p, at_q  (S,) complex m, where they are
    instant     (T + B,) index of the instant
    turn        (S - T,) exp(j phase)
    away, up    (S,) unit vectors from j to i, horizontal as complex numbers, and vertical
    distance    (S,) m
    spare       (S,) m, distance less what is kept
    least       (P,) m, over all instants and the whole circle, whether sampled or not
    """

    i: Indices
    j: Indices
    p: Indices
    q: Indices
    at_p: Complex
    at_q: Complex
    instant: Indices
    turn: Complex
    away: Complex
    up: Array
    distance: Array
    spare: Array
    least: Array


@dataclass(frozen=True, eq=False)
class Kept:
    """What rows keep, and where.

    level   m, Ds + m
    kappa   share of the slack that one period may use up
    phases  of the circles
    turned  rad, from where their grid stands to where the arms are
    circle  m, what circles that begin at instants keep, Ds + m of the paper's h; None: it is not kept
    step    periods flown, by which the instants are chosen at which circles begin
    """

    level: float
    kappa: float
    phases: Phases
    turned: float
    circle: float | None = None
    step: int = 0


def samples(gamma: Paths, i: Indices, j: Indices, kept: Kept, reach: Reach) -> Samples:
    """The samples of pairs when all fly gamma; `gamma` without leading axes."""
    between, swing = gamma.centre[i] - gamma.centre[j], gamma.arm[i] - gamma.arm[j]
    apart, arms = np.abs(between), np.abs(swing)
    last = gamma.z[i, -1] - gamma.z[j, -1]
    whole = np.hypot(apart - arms, last)
    # At larger distances than these no input can break a row.
    near = kept.level + 2 / kept.kappa * reach.at
    near_late = kept.level + 2 / kept.kappa * reach.circle
    pair, instant = _looked_at(gamma, i, j, near, whole)
    late = np.flatnonzero(whole < np.maximum(near_late[i], near_late[j]))
    p, q = i[late], j[late]
    then = (apart[late] + reach.centre[p] + reach.centre[q]) * (arms[late] + reach.arm[p] + reach.arm[q])
    parallel = then > kept.phases.limit * (1 - kept.kappa) ** 2 * apart[late] * arms[late]
    nearest = np.angle(-between[late] * np.conj(swing[late]))
    which, turn = kept.phases.chosen(nearest, kept.turned, parallel)
    which = late[which]
    early = pair.size
    begun, from_, turn_begun = _begun(gamma, i, j, kept, reach)
    instant, turn = np.concatenate([instant, from_]), np.concatenate([turn_begun, turn])
    p, q = (np.concatenate([x.take(pair), x.take(begun), x.take(which)]) for x in (i, j))
    at_p, at_q = (_positions(gamma, x, instant, turn) for x in (p, q))
    z, split = gamma.z.ravel(), instant.size
    level, height = at_p - at_q, np.empty(p.size)
    height[:split] = z.take(_flat(gamma, p[:split], instant)) - z.take(_flat(gamma, q[:split], instant))
    height[split:] = last.take(which)
    distance = np.sqrt(level.real**2 + level.imag**2 + height**2)
    least = whole.copy()
    if early:  # samples of one pair stand together
        first = np.flatnonzero(np.diff(pair, prepend=-1))
        found = pair[first]
        least[found] = np.minimum(least[found], np.minimum.reduceat(distance[:early], first))
    spare = distance - kept.level
    if kept.circle is not None:
        spare[early:split] += kept.level - kept.circle
    scale = 1.0 / np.maximum(distance, 1e-9)
    away, up = level * scale, height * scale
    return Samples(i, j, p, q, at_p, at_q, instant, turn, away, up, distance, spare, least)


def _begun(
    gamma: Paths, i: Indices, j: Indices, kept: Kept, reach: Reach
) -> tuple[Indices, Indices, Complex]:
    """Pair, instant and exp(j phase) (B,) of circles that gamma, followed at once, would fly from there on.

    Of `_STRIDE` instants they begin at one, which stands still as the vehicles fly on.
    """
    if kept.circle is None or reach.begun is None:
        none = np.zeros(0, dtype=np.intp)
        return none, none, np.zeros(0, dtype=complex)
    n, instants = gamma.at.shape
    k = np.arange((-1 - kept.step) % _STRIDE, instants, _STRIDE)
    arm, z = gamma.arms(np.arange(n)[:, None] * instants + k), gamma.z[:, k]
    centre, far = gamma.at[:, k] - arm, reach.begun[:, k]
    between, swing = centre[i] - centre[j], arm[i] - arm[j]
    near = kept.circle + 2 / kept.kappa * np.maximum(far[i], far[j])
    pair, at = np.nonzero((np.abs(between) - np.abs(swing)) ** 2 + (z[i] - z[j]) ** 2 < near**2)
    nearest = np.angle(-between[pair, at] * np.conj(swing[pair, at]))
    which, turn = kept.phases.chosen(nearest, 0.0, np.zeros(pair.size, dtype=bool))
    return pair[which], k[at[which]], turn


def _flat(paths: Paths, vehicle: Indices, instant: Indices) -> Indices:
    """Places in an array (N, M) laid out row by row."""
    return np.asarray(vehicle * paths.z.shape[-1] + instant)


def _positions(gamma: Paths, vehicle: Indices, instant: Indices, turn: Complex) -> Complex:
    """Where vehicles (S,) are: T at instants, B on circles begun there, the others on the last circle."""
    split, early = instant.size, vehicle.size - turn.size
    found = np.empty(vehicle.size, dtype=complex)
    flat = _flat(gamma, vehicle[:split], instant)
    found[:split] = gamma.at.ravel().take(flat)
    if split > early:
        found[early:split] += gamma.arms(flat[early:]) * (turn[: split - early] - 1.0)
    circle, late = found[split:], vehicle[split:]
    np.multiply(gamma.arm.take(late), turn[split - early :], out=circle)
    circle += gamma.centre.take(late)
    return found


def _looked_at(gamma: Paths, i: Indices, j: Indices, near: Array, whole: Array) -> tuple[Indices, Indices]:
    """Pairs and instants (T,) at which there may be a row, or a pair's least distance.

    whole  (P,) m, the least distance on the circle
    """
    instants = gamma.at.shape[-1]
    start = np.arange(0, instants, _BLOCK)
    middle = np.minimum(start + _BLOCK // 2, instants - 1)
    flown = np.zeros(gamma.z.shape)
    step, climb = gamma.at[:, 1:] - gamma.at[:, :-1], gamma.z[:, 1:] - gamma.z[:, :-1]
    flown[:, 1:] = np.cumsum(np.sqrt(step.real**2 + step.imag**2 + climb**2), axis=-1)
    end = np.minimum(start + _BLOCK, instants) - 1
    # No instant of the block is more than this way from the middle one.
    way = np.maximum(flown[:, middle] - flown[:, start], flown[:, end] - flown[:, middle])
    at, z = gamma.at[:, middle], gamma.z[:, middle]
    level = at[i] - at[j]
    distance = np.sqrt(level.real**2 + level.imag**2 + (z[i] - z[j]) ** 2)
    no_less = distance - (way[i] + way[j]) - _ROUND_OFF
    row = np.maximum.reduceat(near, start, axis=-1)
    upper = np.minimum(distance.min(axis=1), whole)
    p, b = np.nonzero(no_less < np.maximum(np.maximum(row[i], row[j]), upper[:, None]))
    k = start[b][:, None] + np.arange(_BLOCK)
    inside = k < instants
    return np.broadcast_to(p[:, None], k.shape)[inside], k[inside]


@dataclass(frozen=True, eq=False)
class Rows:
    """R rows of single vehicles: the displacement of `vehicle` along its unit vector is at least `least`.

    vehicle    (R,)
    other      (R,) the vehicle of which it keeps clear
    along, up  (R,) unit vector: horizontal as a complex number, and vertical
    least      (R,) m, at most 0
    back       (R,) m, what is aimed at beyond that where the slack is negative
    instant    (T + B,) index of the instant: T rows are about the transient, B about circles begun there
    turn       (R - T,) complex, exp(j phase) of the B, and of the others, which are about the last circle
    """

    vehicle: Indices
    other: Indices
    along: Complex
    up: Array
    least: Array
    back: Array
    instant: Indices
    turn: Complex

    def displacement(self, moved: Paths, gamma: Paths) -> Array:
        """Displacements (..., R) m along the unit vectors, of paths (..., N, M) against gamma's (N, M)."""
        split, lead = self.instant.size, moved.at.shape[:-2]
        early, late = self.vehicle.size - self.turn.size, self.vehicle[split:]
        flat = self.vehicle[:split] * moved.at.shape[-1] + self.instant
        level = np.empty((*lead, self.vehicle.size), dtype=complex)
        up = np.empty(level.shape)
        level[..., :split] = (moved.at - gamma.at).reshape(*lead, -1).take(flat, axis=-1)
        if split > early:
            some, onwards = flat[early:], self.turn[: split - early] - 1.0
            level[..., early:split] += (moved.arms(some) - gamma.arms(some)) * onwards
        swung = (moved.arm - gamma.arm).take(late, axis=-1) * self.turn[split - early :]
        level[..., split:] = (moved.centre - gamma.centre).take(late, axis=-1) + swung
        height = moved.z - gamma.z
        up[..., :split] = height.reshape(*lead, -1).take(flat, axis=-1)
        up[..., split:] = height[..., -1].take(late, axis=-1)  # the circle is as high as the last instant
        return np.asarray(level.real * self.along.real + level.imag * self.along.imag + up * self.up)

    def of(self, vehicles: Indices) -> Rows:
        """The rows of some vehicles (increasing), numbered anew from 0; `other` keeps its number."""
        place = np.full(int(max(self.vehicle.max(initial=0), vehicles.max(initial=0))) + 1, -1)
        place[vehicles] = np.arange(vehicles.size)
        here = place[self.vehicle] >= 0
        split, early = self.instant.size, self.vehicle.size - self.turn.size
        return Rows(
            place[self.vehicle[here]],
            self.other[here],
            self.along[here],
            self.up[here],
            self.least[here],
            self.back[here],
            self.instant[here[:split]],
            self.turn[here[early:]],
        )


def rows(found: Samples, kept: Kept, reach: Reach) -> Rows:
    """The rows that some input may break, of both vehicles of each pair."""
    split, places = found.instant.size, reach.rest.shape[-1]
    first = found.p.size - found.turn.size
    share = 0.5 * kept.kappa * found.spare
    allowed = np.maximum(share, 0.0)
    place = np.empty(found.p.size, dtype=np.intp)
    place[:split] = found.instant
    place[first:split] += reach.at.shape[-1] + 1
    place[split:] = reach.at.shape[-1]
    parts: list[list[Indices]] = [[], [], []]
    for vehicle, at, sign in ((found.p, found.at_p, 1.0), (found.q, found.at_q, -1.0)):
        out = at - reach.start.take(vehicle)
        across = found.away.imag * out.real - found.away.real * out.imag
        far = reach.along(vehicle * places + place, sign * across, sign * found.up)
        some = np.flatnonzero(allowed < far)
        a, b = np.searchsorted(some, (first, split)).tolist()
        for part, own in zip(parts, (some[:a], some[a:b], some[b:]), strict=True):
            part.append(own)
    # The transient's rows of both sides, then those of the circles that begin there, then the last circle's.
    sample = np.concatenate([own for part in parts for own in part])
    early, begun = (sum(own.size for own in part) for part in parts[:2])
    ofp = np.repeat([True, False] * 3, [own.size for part in parts for own in part])
    sign_of = np.where(ofp, 1.0, -1.0)
    p, q = found.p.take(sample), found.q.take(sample)
    return Rows(
        np.where(ofp, p, q),
        np.where(ofp, q, p),
        sign_of * found.away.take(sample),
        sign_of * found.up.take(sample),
        -allowed.take(sample),
        np.maximum(-share.take(sample), 0.0),
        found.instant.take(sample[: early + begun]),
        found.turn.take(sample[early:] - first),
    )
