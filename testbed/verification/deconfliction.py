"""Works out what vehicles want that fly in layers or around a ring, by formulas of its own."""

from __future__ import annotations

from math import acos, asin, copysign, gcd, hypot, inf, nan, pi, sin, sqrt
from typing import Any

import numpy as np

from testbed.verification import guidance_laws
from testbed.verification.making_way import Waiting, parking_height

Array = np.ndarray
Table = dict[str, Any]
KINDS = ("layers", "roundabout")
# Vehicles wait with a turn towards a goal inside a circle of so many times the least turn radius.
WAIT = 1.2
# Within this of abeam [rad], round-off decides which turn is long.
ABEAM = 1e-12


def wanted(
    s: Table,
    k: int,
    tables: list[Table],
    t: Array,
    pose: tuple[Array, Array, Array],
    start: Array,
    to: Array,
    gamma: Array,
) -> Array:
    """(T, 3): v, omega, zeta that vehicle k (from 0) wants at all filter steps from the first on.

    nan where round-off decides it.

    tables  of all vehicles;  t  (T,) s;  pose  place as east + 1j north, height and course, (T,) each
    start, to  (N, 3) m, where vehicles begin, and their goals
    gamma   (3,) of the vehicle's evading turn
    """
    if tables[k]["kind"] == "layers":
        return _layered(s, k, tables, t, pose, start, to, gamma)
    return _around(s, k, tables, pose, to, float(np.sign(gamma[1])))


def _level(s: Table, k: int, tables: list[Table], start: Array, to: Array) -> float:
    """The height of vehicle k's layer [m]."""
    law = tables[k]
    if law["height_m"] is not None:
        return float(law["height_m"])
    flying = [v for v, table in enumerate(tables) if table["kind"] == "layers"]
    gap = law["spacing_m"] or s["d_safe_m"] + 3.0
    count = law["layers"]
    if count is None:
        least = inf
        for v in flying:
            half = hypot(to[v, 0] - start[v, 0], to[v, 1] - start[v, 1]) / 2 - s["goal_radius_m"]
            rate = law["climb_mps"] or 0.7 * guidance_laws.limits(s, v)[1]
            least = min(least, half / law["speed_mps"] * rate)
        least = max(least, 0.0) + law["goal_offset_m"]
        count = min(len(flying), max(1, 1 + int(2.0 * least / gap)))
    leap = max(1, round(0.38 * count))
    while gcd(leap, count) > 1:
        leap += 1
    return float(law["middle_m"] + gap * (flying.index(k) * leap % count - (count - 1) / 2.0))


def _layered(
    s: Table,
    k: int,
    tables: list[Table],
    t: Array,
    pose: tuple[Array, Array, Array],
    start: Array,
    to: Array,
    gamma: Array,
) -> Array:
    law, (turn, rise) = tables[k], guidance_laws.limits(s, k)
    layer, goal, radius = _level(s, k, tables, start, to), to[k], s["goal_radius_m"]
    descent = law["climb_mps"] or 0.7 * rise
    slope, gain = descent / law["speed_mps"], law["height_gain_per_s"]
    side, park, waiting = 0.0, 0.0, None
    if law["evading"]:
        all_ = [
            (_level(s, v, tables, start, to), v) for v in range(len(tables)) if tables[v]["kind"] == "layers"
        ]
        side, park = float(np.sign(gamma[1])), parking_height(all_, k, s["d_safe_m"])
        waiting = Waiting(all_, k, layer, gamma[1])
    found, there = np.empty((len(pose[0]), 3)), False
    for row, (when, place, z, theta) in enumerate(zip(t, *pose, strict=True)):
        away = complex(goal[0], goal[1]) - place
        there = there or sqrt(abs(away) ** 2 + (z - goal[2]) ** 2) <= radius
        if waiting is not None:
            layer = waiting.at(when, abs(away), there)
            if there:
                climbs = min(max(gain * (park - z), -rise, -descent), rise, descent)
                found[row] = gamma[0], gamma[1], climbs
                continue
        room = max(abs(away) - radius, 0.0) * slope
        # The goal is passed so far above or below.
        end = goal[2] + copysign(min(abs(layer - goal[2]), law["goal_offset_m"]), layer - goal[2])
        height, climbs = layer, 0.0
        if not there and room < abs(layer - end):
            above = 1.0 if layer > end else -1.0
            height = end + above * room
            nearing = law["speed_mps"] * (away * np.exp(-1j * theta)).real / max(abs(away), 1e-9)
            climbs = -above * slope * nearing if room > 0.0 else 0.0
        zeta = climbs + gain * (height - z)
        omega = _towards(away * np.exp(-1j * theta), law, turn, side)
        found[row] = law["speed_mps"], omega, min(max(zeta, -rise), rise)
    return found


def _towards(seen: complex, law: Table, turn: float, side: float = 0.0) -> float:
    """The turn rate towards a goal that is at `seen` ahead + 1j to the left; nan if round-off decides it.

    side  +1 if turns of more than 90 deg are to the left, -1 to the right, 0 the shorter way
    """
    angle = float(np.angle(seen))
    angle = angle - 2 * pi if angle >= pi - 1e-9 else angle
    rate = min(max(law["course_gain_per_s"] * angle, -turn), turn)
    if side and abs(abs(angle) - pi / 2) < ABEAM:
        rate = rate if rate * side == turn else nan
    elif side and abs(angle) > pi / 2:
        rate = side * turn
    circle = 2.0 * WAIT * law["speed_mps"] / max(turn, 1e-6) * abs(seen.imag)
    return rate if abs(seen) ** 2 >= circle else 0.0


def _ring(s: Table, law: Table, tables: list[Table], to: Array) -> tuple[complex, float]:
    """Centre and radius [m] of the ring."""
    flying = [v for v, table in enumerate(tables) if table["kind"] == "roundabout"]
    middle = law["centre_m"] if law["centre_m"] is not None else to[flying, :2].mean(axis=0)
    if law["radius_m"] is not None:
        return complex(*middle), float(law["radius_m"])
    slowest = min(max(guidance_laws.limits(s, v)[0], 1e-6) for v in flying)
    apart = s["d_safe_m"] + law["room_m"]
    spread = apart / (2.0 * sin(pi / len(flying))) if len(flying) > 1 else 0.0
    return complex(*middle), max(law["speed_mps"] / (0.6 * slowest), spread)


def _around(
    s: Table, k: int, tables: list[Table], pose: tuple[Array, Array, Array], to: Array, side: float
) -> Array:
    law, turn = tables[k], guidance_laws.limits(s, k)[0]
    centre, radius = _ring(s, law, tables, to)
    place, _, course = pose
    # The ring is flown against the evading turn.
    circle = law | {"centre_m": [centre.real, centre.imag], "radius_m": radius}
    circle |= {"sense": "left" if side < 0 else "right", "kind": "loiter", "height_m": to[k, 2]}
    found = guidance_laws.wanted(s, k, circle, np.zeros(len(place)), pose, to[k])
    goal = complex(to[k, 0], to[k, 1])
    lead, gone = _exit(abs(goal - centre), radius, WAIT * law["speed_mps"] / max(turn, 1e-6)), False
    for row, here in enumerate(place):
        ahead = np.angle((goal - centre) / (here - centre)) if here != centre and goal != centre else 0.0
        ahead = (-side * float(ahead)) % (2 * pi)
        outside = pi / 2 - asin(radius / max(abs(here - centre), radius))
        gone = gone or ahead <= lead + outside + 0.05
        if gone:
            found[row, 1] = _towards((goal - here) * np.exp(-1j * course[row]), law, turn)
    return found


def _exit(away: float, radius: float, turn: float) -> float:
    """Angle along the ring from the exit to the goal, `away` from the centre, with turns of radius `turn`."""
    if away >= radius:
        return pi / 2 - asin(radius / away)
    gap = radius - turn
    gap = gap if abs(gap) > 1e-9 else 1e-9
    # Where the goal is on the circle of the inward turn, whose centre is `gap` from the ring's.
    share = (away**2 + gap**2 - turn**2) / (2 * max(away, 1e-9) * gap)
    return 2 * pi if share <= -1.0 else acos(min(share, 1.0))
