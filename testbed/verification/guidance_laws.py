"""Works out what each vehicle's guidance wants at recorded poses, by formulas of its own."""

from __future__ import annotations

import hashlib
from math import hypot, radians
from typing import Any

import numpy as np

Array = np.ndarray
Table = dict[str, Any]

COMMON = {"course_gain_per_s": 0.5, "height_gain_per_s": 0.3, "position_gain_per_s": 0.5}
DEFAULTS: Table = {
    "near-identity": {"lookahead_m": 1.0, "gain_per_s": 0.1},
    "waypoints": COMMON | {"speed_mps": 20.0, "closed": False, "approach_m": None},
    "loiter": COMMON | {"speed_mps": 20.0, "sense": "left", "height_m": 0.0, "approach_m": None},
    "hold": COMMON | {"speed_mps": 20.0, "height_m": 0.0},
    "track": COMMON,
    "layers": COMMON
    | {
        "speed_mps": 20.0,
        "layers": None,
        "spacing_m": None,
        "middle_m": 0.0,
        "height_m": None,
        "climb_mps": None,
        "goal_offset_m": 0.0,
        "evading": False,
    },
    "roundabout": COMMON
    | {"speed_mps": 20.0, "radius_m": None, "room_m": 8.0, "centre_m": None, "approach_m": None},
}


def tables(s: Table) -> list[Table]:
    """Each vehicle's [guidance]: its own, completed by the scenario's of that kind and by defaults."""
    common, made = s["guidance"], []
    for vehicle in s.get("vehicle") or [{}] * s["vehicles"]:
        own = vehicle.get("guidance")
        if own is None:
            own = common
        else:
            kind = own.get("kind", "near-identity")
            own = (common if common["kind"] == kind else {}) | own | {"kind": kind}
        made.append(DEFAULTS.get(own["kind"], {}) | own)
    return made


def seeks_goal(table: Table) -> bool:
    """Whether guidance by the table flies to a goal."""
    legs = table["kind"] == "waypoints" and not table["closed"]
    return legs or table["kind"] in ("near-identity", "manoeuvre", "layers", "roundabout")


def limits(s: Table, k: int) -> tuple[float, float]:
    """Largest turn rate [rad/s] and climb rate [m/s] of vehicle k, from 0."""
    listed = s.get("vehicle") or []
    own = (listed[k].get("limits") or {}) if listed else {}
    said = s["limits"] | {name: value for name, value in own.items() if value is not None}
    return radians(said["omega_max_degps"]), float(said["zeta_max_mps"])


def wanted(s: Table, k: int, table: Table, t: Array, pose: tuple[Array, Array, Array], goal: Array) -> Array:
    """(T, 3): v, omega, zeta that vehicle k (from 0) wants at times t (T,), by a table that is no manoeuvre.

    pose  place as east + 1j north, height and course, (T,) each, at every filter step one after another
    """
    place, height, course = pose
    turn, rise = limits(s, k)
    match table["kind"]:
        case "near-identity":
            ahead = table["gain_per_s"] * (complex(goal[0], goal[1]) - place) * np.exp(-1j * course)
            up = table["gain_per_s"] * (goal[2] - height)
            return np.stack([ahead.real, ahead.imag / table["lookahead_m"], up], axis=-1)
        case "hold":
            speed = np.full(len(t), table["speed_mps"])
            towards, swings = np.exp(1j * radians(table["course_deg"])) + 0 * place, 0.0 * speed
            level, climbs = table["height_m"], 0.0
        case "loiter":
            speed = np.full(len(t), table["speed_mps"])
            towards, swings = _around(table, place, course, turn)
            level, climbs = table["height_m"], 0.0
        case "waypoints":
            return _along_legs(table, place, height, course, turn, rise)
        case _:
            return _along_track(table, t, place, height, course, turn, rise)
    omega = swings + table["course_gain_per_s"] * _aside(towards, course)
    zeta = climbs + table["height_gain_per_s"] * (level - height)
    return np.stack([speed, np.clip(omega, -turn, turn), np.clip(zeta, -rise, rise)], axis=-1)


def _aside(towards: Array | complex, course: Array | float) -> Array:
    """By how much the direction wanted is to the left of the course [rad]; a half turn is to the right."""
    angle = np.angle(towards * np.exp(-1j * course))
    return np.where(angle >= np.pi - 1e-9, angle - 2.0 * np.pi, angle)


def _reach(table: Table, speed: Array | float, turn: float) -> Array | float:
    """Distance from a path at which the course is 45 deg towards it: half the turn rate can follow that."""
    if table["approach_m"] is not None:
        return float(table["approach_m"])
    return speed * 4.0 / (27.0**0.5 * max(turn, 1e-6))


def _around(table: Table, place: Array, course: Array, turn: float) -> tuple[Array, Array]:
    """The direction wanted around a circle, and how fast it turns."""
    side, v = (1.0 if table["sense"] == "left" else -1.0), table["speed_mps"]
    out = place - complex(*table["centre_m"])
    distance, reach = np.abs(out), _reach(table, v, turn)
    off = (distance - table["radius_m"]) / reach
    outwards = np.where(distance > 0, out / np.where(distance > 0, distance, 1.0), 1.0)
    # Across the direction from the centre, turned inwards where outside.
    towards = outwards * np.exp(1j * side * (np.pi / 2 + np.arctan(off)))
    motion = v * np.exp(1j * course) * np.conj(outwards)
    swings = motion.imag / np.maximum(distance, 0.1 * table["radius_m"])
    return towards, swings + side * motion.real / (reach * (1.0 + off * off))


def _along_legs(table: Table, place: Array, height: Array, course: Array, turn: float, rise: float) -> Array:
    """As `wanted`, along waypoints: which leg is flown follows from all places before."""
    listed = table["waypoints_m"] + (table["waypoints_m"][:1] if table["closed"] else [])
    ends = [complex(w[0], w[1]) for w in listed]
    speeds = [w[3] if len(w) == 4 else table["speed_mps"] for w in listed][1:]
    heights = [w[2] for w in listed]
    legs = len(ends) - 1
    way = [(ends[m + 1] - ends[m]) / abs(ends[m + 1] - ends[m]) for m in range(legs)]
    found, m = np.empty((len(place), 3)), 0
    for row, (here, z, theta) in enumerate(zip(place, height, course, strict=True)):
        for _ in range(legs):
            length = abs(ends[m + 1] - ends[m])
            if m == legs - 1 and not table["closed"]:
                break
            corner = min(abs(float(np.angle(way[(m + 1) % legs] / way[m]))), radians(120.0))
            lead = min(speeds[m] / (0.8 * max(turn, 1e-6)) * np.tan(corner / 2), length / 2)
            if length - ((here - ends[m]) * np.conj(way[m])).real > lead:
                break
            m = (m + 1) % legs
        v, length = speeds[m], abs(ends[m + 1] - ends[m])
        at = (here - ends[m]) * np.conj(way[m])
        reach = _reach(table, v, turn)
        across = v * (np.exp(1j * theta) * np.conj(way[m])).imag  # how fast it leaves the leg to the left
        towards = way[m] * complex(reach, -at.imag)
        swings = -across * reach / (reach**2 + at.imag**2)
        omega = swings + table["course_gain_per_s"] * _aside(towards, theta)
        slope = (heights[m + 1] - heights[m]) / length
        along = min(max(at.real, 0.0), length)
        climbs = slope * v if 0.0 < along < length else 0.0
        zeta = climbs + table["height_gain_per_s"] * (heights[m] + slope * along - z)
        found[row] = v, min(max(omega, -turn), turn), min(max(zeta, -rise), rise)
    return found


def track_at(rows: Array, t: Array) -> tuple[Array, Array, Array]:
    """Place, velocity and acceleration (T, 2 or 3) of a track at times t (T,): cubics between rows.

    Their slopes at a row are those of the parabola through it and its neighbours; after the last row the
    track goes straight on, level.
    """
    when, place = rows[:, 0] - rows[0, 0], rows[:, 1:]
    chord = np.diff(place, axis=0) / np.diff(when)[:, None]
    slope = np.empty_like(place)
    if len(rows) == 2:
        slope[:] = chord[0]
    else:
        gap = np.diff(when)
        bend = np.diff(chord, axis=0) / (gap[:-1] + gap[1:])[:, None]  # half the second derivative
        slope[1:-1] = chord[:-1] + gap[:-1, None] * bend
        slope[0], slope[-1] = chord[0] - gap[0] * bend[0], chord[-1] + gap[-1] * bend[-1]
    m = np.minimum(np.searchsorted(when, np.minimum(t, when[-1]), side="right") - 1, len(when) - 2)
    gap = (when[m + 1] - when[m])[:, None]
    past = (np.minimum(t, when[-1]) - when[m])[:, None]
    # p(x) = a + b x + c x^2 + d x^3 with the values and slopes of both rows.
    a, b = place[m], slope[m]
    c = (3.0 * chord[m] - 2.0 * slope[m] - slope[m + 1]) / gap
    d = (slope[m] + slope[m + 1] - 2.0 * chord[m]) / gap**2
    found = a + past * (b + past * (c + past * d))
    speed, change = b + past * (2.0 * c + 3.0 * past * d), 2.0 * c + 6.0 * past * d
    after = (t > when[-1])[:, None]
    level = speed * np.array([1.0, 1.0, 0.0])[: speed.shape[1]]
    speed, change = np.where(after, level, speed), np.where(after, 0.0, change)
    return found + np.maximum(t - when[-1], 0.0)[:, None] * level * after, speed, change


def _along_track(
    table: Table, t: Array, place: Array, height: Array, course: Array, turn: float, rise: float
) -> Array:
    """As `wanted`, by a track's times."""
    rows = np.array(table["rows"])
    at, moves, change = track_at(rows, t)
    where, goes = at[:, 0] + 1j * at[:, 1], moves[:, 0] + 1j * moves[:, 1]
    after = t > rows[-1, 0] - rows[0, 0]
    towards = np.where(after, goes, goes + table["position_gain_per_s"] * (where - place))
    speed = np.abs(towards)
    bends = (np.conj(goes) * (change[:, 0] + 1j * change[:, 1])).imag / np.maximum(np.abs(goes), 0.1) ** 2
    going = speed > 0.1
    swings = np.where(after | ~going, 0.0, bends)
    aside = np.where(going | after, _aside(towards, course), 0.0)
    omega = swings + table["course_gain_per_s"] * aside
    zeta = np.zeros(len(t))
    if rows.shape[1] == 4:
        zeta = moves[:, 2] + table["position_gain_per_s"] * (at[:, 2] - height)
    return np.stack([speed, np.clip(omega, -turn, turn), np.clip(zeta, -rise, rise)], axis=-1)


def farthest_from_track(table: Table, t: Array, position: Array) -> tuple[float, float]:
    """Largest and root-mean-square distance [m] of positions (T, 3) from a track at its times, to its end."""
    rows = np.array(table["rows"])
    during = t <= rows[-1, 0] - rows[0, 0] + 1e-9
    at = track_at(rows, t[during])[0]
    off = [hypot(*(row[: at.shape[1]] - here)) for row, here in zip(position[during], at, strict=True)]
    return float(np.max(off)), float(np.sqrt(np.mean(np.square(off))))


def checksum(rows: list[list[float]]) -> str:
    """SHA-256 of a track's rows as JSON without blanks."""
    lines = ",".join("[" + ",".join(map(repr, map(float, row))) + "]" for row in rows)
    return hashlib.sha256(f"[{lines}]".encode()).hexdigest()
