"""Computes clearances from fences and their h by formulas of its own: angles seen, circles flown on.

A point is inside a polygon if the corners go once round it. The circle of a turn is found from the positions
that it leads through; a fence's h is that of the circle, edge by edge or corner by corner.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from testbed.verification.future import Pose
from testbed.verification.recorded import Array, fenced_vehicles

# Instants of a turn that its circle is found from.
INSTANTS = 8
# h and clearance [m] of a vehicle that has left: larger than any, so that they are never the least.
FAR = 1e9


@dataclass(frozen=True)
class Fence:
    """One [[fence]] table for the vehicles (V,) from 0; `wider` metres are added to its margin."""

    table: dict[str, Any]
    vehicles: Array
    wider: float = 0.0

    @property
    def margin(self) -> float:
        return float(self.table["margin_m"]) + self.wider

    @property
    def corners(self) -> Array | None:
        """(M, 2) m of a polygon; None of other shapes."""
        listed = self.table.get("polygon_m")
        return None if listed is None else np.asarray(listed, dtype=float)

    @property
    def count(self) -> int:
        """Rows that a filter has for it and one vehicle."""
        if (corners := self.corners) is not None:
            return len(corners)
        if self.table["kind"] == "heights":
            return sum(self.table[end] is not None for end in ("floor_m", "ceiling_m"))
        return 1

    def clearance(self, place: Array) -> Array:
        """Signed distance (...) of places (..., 3) less the margin."""
        kind, corners = self.table["kind"], self.corners
        if kind == "heights":
            low, high = (self.table[end] for end in ("floor_m", "ceiling_m"))
            z = place[..., 2]
            above = z - (-inf if low is None else low)
            return np.asarray(np.minimum(above, (inf if high is None else high) - z) - self.margin)
        if corners is None:
            away = place[..., :2] - np.asarray(self.table["centre_m"], dtype=float)
            return np.asarray(np.linalg.norm(away, axis=-1) - self.table["radius_m"] - self.margin)
        distance = np.linalg.norm(_to_edges(place[..., :2], corners), axis=-1).min(axis=-1)
        right = surrounded(place[..., :2], corners) == (kind == "keep-in")
        return np.asarray(np.where(right, distance, -distance) - self.margin)

    def along_chords(self, first: Array, last: Array) -> Array:
        """The least clearance (...) on straight lines between places (..., 3) a short way apart."""
        ends = np.minimum(self.clearance(first), self.clearance(last))
        corners = self.corners
        if self.table["kind"] == "heights":
            return ends
        if corners is None:
            corners = np.asarray([self.table["centre_m"]], dtype=float)
        move = (last - first)[..., None, :2]
        to = corners - first[..., None, :2]
        length = np.maximum((move**2).sum(axis=-1), 1e-300)
        share = np.clip((to * move).sum(axis=-1) / length, 0.0, 1.0)
        passed = np.linalg.norm(to - share[..., None] * move, axis=-1).min(axis=-1)
        inner = self.table["radius_m"] if self.corners is None else 0.0
        return np.asarray(np.minimum(ends, passed - inner - self.margin))

    def flown(self, centre: Array, radius: Array, height: Array) -> tuple[Array, Array]:
        """h of every row (..., M) on circles about `centre` (..., 2), and its gradient (..., M, 3) over both.

        The gradient is over the circle's centre and the height.
        """
        kind, corners = self.table["kind"], self.corners
        if kind == "heights":
            rows = [(1.0, self.table["floor_m"]), (-1.0, self.table["ceiling_m"])]
            said = [(sign, end) for sign, end in rows if end is not None]
            h = np.stack([sign * (height - end) - self.margin for sign, end in said], axis=-1)
            slope = np.zeros((*h.shape, 3))
            slope[..., 2] = [sign for sign, _ in said]
            return h, slope
        if corners is None:
            away = centre - np.asarray(self.table["centre_m"], dtype=float)
            apart = np.linalg.norm(away, axis=-1)
            around = np.where(apart < radius, -1.0, 1.0)
            h = around * (apart - radius) - self.table["radius_m"] - self.margin
            return h[..., None], _level(around[..., None] * away / np.maximum(apart, 1e-9)[..., None])[
                ..., None, :
            ]
        to = -_to_edges(centre, corners)
        distance = np.linalg.norm(to, axis=-1)
        slope = to / np.maximum(distance, 1e-300)[..., None]
        wrong = surrounded(centre, corners) != (kind == "keep-in")
        nearest = distance.argmin(axis=-1)[..., None]
        h = np.where(wrong[..., None], -np.take_along_axis(distance, nearest, -1), distance)
        slope = np.where(wrong[..., None, None], -np.take_along_axis(slope, nearest[..., None], -2), slope)
        h = h - radius[..., None]
        if kind == "keep-out":
            away = centre[..., None, :] - corners
            far = np.linalg.norm(away, axis=-1)
            holds = radius[..., None] - far
            inward = holds.min(axis=-1) > h.min(axis=-1)
            h = np.where(inward[..., None], holds, h)
            slope = np.where(inward[..., None, None], -away / np.maximum(far, 1e-9)[..., None], slope)
        return h - self.margin, _level(slope)


def _level(slope: Array) -> Array:
    """A gradient over the plane with none over the height."""
    return np.concatenate([slope, np.zeros((*slope.shape[:-1], 1))], axis=-1)


def _to_edges(place: Array, corners: Array) -> Array:
    """The shortest vectors (..., M, 2) from places (..., 2) to each edge."""
    edge = np.roll(corners, -1, axis=0) - corners
    to = corners - place[..., None, :]
    share = np.clip(-(to * edge).sum(axis=-1) / (edge**2).sum(axis=-1), 0.0, 1.0)
    return np.asarray(to + share[..., None] * edge)


def surrounded(place: Array, corners: Array) -> Array:
    """Whether the corners go round places (..., 2): the angles at which edges are seen add up to a turn."""
    first = corners - place[..., None, :]
    then = np.roll(first, -1, axis=-2)
    seen = np.arctan2(
        first[..., 0] * then[..., 1] - first[..., 1] * then[..., 0], (first * then).sum(axis=-1)
    )
    return np.asarray(np.abs(seen.sum(axis=-1)) > np.pi)


def circle(pose: Pose, speed: float, rate: float) -> tuple[Array, Array]:
    """Centre (..., 2) and radius of the circles flown from poses at `speed` and turn rate `rate`."""
    places = []
    for k in range(INSTANTS):
        after = pose.theta + 2.0 * np.pi * k / INSTANTS * np.sign(rate)
        east = speed / rate * (np.sin(after) - np.sin(pose.theta))
        north = speed / rate * (np.cos(pose.theta) - np.cos(after))
        places.append(pose.position[..., :2] + np.stack([east, north], axis=-1))
    opposite = np.linalg.norm(places[0] - places[INSTANTS // 2], axis=-1)
    return np.mean(places, axis=0), 0.5 * opposite


@dataclass(frozen=True)
class FenceRows:
    """h of every row of every fence at poses (T, N), and its response to inputs.

    h         (T, R) m;  off, lie_off  what round-off may have done
    lie       (3, T, R) change of h as the row's vehicle moves ahead, turns, climbs
    vehicle, fence  (R,) from 0
    """

    h: Array
    lie: Array
    vehicle: Array
    fence: Array
    off: float = 1e-9
    lie_off: float = 1e-7

    def hdot(self, u: Array) -> Array:
        """L_g h u (T, R) under inputs (T, N, 3)."""
        return np.asarray(np.einsum("ktr,trk->tr", self.lie, u[:, self.vehicle]))

    def without(self, gone: Array) -> FenceRows:
        """The rows in which those of vehicles that have left, gone (T, N), are far away and bind nobody."""
        apart = gone[:, self.vehicle]
        return replace(self, h=np.where(apart, FAR, self.h), lie=np.where(apart, 0.0, self.lie))

    def least(self, who: Array) -> Array:
        """The least h (T, K) of each fence and vehicle, `who` (K, 2)."""
        of = [(self.fence == fence) & (self.vehicle == vehicle) for fence, vehicle in who]
        return np.stack([self.h[:, rows].min(axis=1) for rows in of], axis=1)


def fences(s: dict[str, Any], wider: float = 0.0) -> list[Fence]:
    """The fences of a scenario, for the vehicles that are under the filter."""
    return [
        Fence(table, np.array(fenced_vehicles(s, table), dtype=int) - 1, wider)
        for table in s.get("fence", [])
    ]


def combinations(s: dict[str, Any]) -> Array:
    """(K, 2) fence and vehicle, from 0, in the order of the table."""
    of = [(k, int(v)) for k, fence in enumerate(fences(s)) for v in fence.vehicles]
    return np.array(of, dtype=int).reshape(-1, 2)


def fence_rows(s: dict[str, Any], pose: Pose, gamma: Array, wider: float = 0.0) -> FenceRows:
    """The rows at poses (T, N) of vehicles whose manoeuvres are gamma (N, 3)."""
    h, lie, vehicle, of = [], [], [], []
    for k, fence in enumerate(fences(s, wider)):
        for v in fence.vehicles:
            here = Pose(pose.position[:, v], pose.theta[:, v])
            ahead = np.stack([np.cos(here.theta), np.sin(here.theta)], axis=-1)
            speed, rate = (float(x) for x in gamma[v, :2])
            if rate or fence.table["kind"] == "heights":
                # Climb alone counts in a height band: any circle will do.
                speed, rate = (speed, rate) if rate else (1.0, 1.0)
                centre, radius = circle(here, speed, rate)
                value, slope = fence.flown(centre, radius, here.position[:, 2])
                along = (slope[..., :2] * ahead[:, None]).sum(axis=-1)
                response = [along, -speed / rate * along, slope[..., 2]]
            else:
                value, response = _straight(fence, here, ahead)
            h.append(value)
            lie.append(np.stack(response))
            vehicle += [int(v)] * value.shape[1]
            of += [k] * value.shape[1]
    return FenceRows(np.concatenate(h, axis=1), np.concatenate(lie, axis=2), np.array(vehicle), np.array(of))


def _straight(fence: Fence, here: Pose, ahead: Array) -> tuple[Array, list[Array]]:
    """h (T, 1) of half-lines past a circle, and its response."""
    to = np.asarray(fence.table["centre_m"], dtype=float) - here.position[:, :2]
    far = np.maximum((to * ahead).sum(axis=-1), 0.0)
    away = far[:, None] * ahead - to
    apart = np.linalg.norm(away, axis=-1)
    normal = away / np.maximum(apart, 1e-9)[:, None]
    turn = far * (normal[:, 1] * ahead[:, 0] - normal[:, 0] * ahead[:, 1])
    h = apart - fence.table["radius_m"] - fence.margin
    along = (normal * ahead).sum(axis=-1)
    return h[:, None], [along[:, None], turn[:, None], np.zeros((len(h), 1))]
