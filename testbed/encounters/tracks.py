"""Makes encounters of tables of states: rows of each aircraft, in metres about the own one's start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, pi

import numpy as np
from numpy.typing import NDArray

from aircraft.jsbsim.geodesy import Origin, ecef
from filters.model import Array
from testbed.encounters.encounter import Aircraft, Encounter
from testbed.encounters.state_table import StateTable
from testbed.errors import Mistake, UserError

# Recorded speeds and those of the positions may differ so much, in the middle of their rows: a wrong unit
# differs by more (m/s and knots by 1.94, feet and metres by 3.28).
MOST_SPEED_RATIO = 1.5
MOST_TRACK_ERROR = pi / 6
# Below this a direction means nothing [m/s].
STANDING = 0.5


@dataclass(frozen=True)
class _Rows:
    """Rows of one aircraft in a table, by time."""

    name: str
    table: StateTable
    index: NDArray[np.intp]

    def of(self, column: str) -> Array | None:
        found = self.table.numbers.get(column)
        return None if found is None else found[self.index]

    def mistake(self, what: str, remedy: str, row: int = 0) -> UserError:
        line = self.table.lines[self.index[row]]
        return UserError(Mistake(f"{self.name}: {what}", line=line, remedy=remedy), file=self.table.file)


def encounters(tables: Sequence[tuple[str, StateTable]]) -> list[Encounter]:
    """The encounters of files: (name, table) each.

    Tables without a column of aircraft have one aircraft each, and make one encounter together.
    Raises  UserError with the file and the line
    """
    nameless = [(name, t) for name, t in tables if "aircraft" not in t.words]
    found = []
    if nameless:
        if "encounter" in nameless[0][1].words or len(nameless) < len(tables):
            raise UserError("has no column aircraft", file=nameless[0][1].file)
        own = [_Rows(name, t, np.arange(len(t.lines))) for name, t in nameless]
        found.append(_encounter(nameless[0][0], own))
        return found
    for name, table in tables:
        grouped = _grouped(table)
        for key, members in grouped.items():
            found.append(_encounter(f"{name}-{key}" if key else name, members))
        if not grouped:
            raise UserError("has no rows", file=table.file)
    return found


def _grouped(table: StateTable) -> dict[str, list[_Rows]]:
    """Encounter -> its aircraft, both in the order in which they first appear."""
    names = table.words["aircraft"]
    keys = table.words.get("encounter", [""] * len(names))
    where: dict[str, dict[str, list[int]]] = {}
    last = ""
    for k, (key, name) in enumerate(zip(keys, names, strict=True)):
        last = last if name == '"' and last else name  # a quotation mark repeats the name above
        where.setdefault(key, {}).setdefault(last, []).append(k)
    return {
        key: [_Rows(name, table, np.array(own)) for name, own in members.items()]
        for key, members in where.items()
    }


def _encounter(name: str, members: Sequence[_Rows]) -> Encounter:
    if len(members) < 2:
        said = f"encounter {name} has one aircraft, {members[0].name}" if members else "there is no aircraft"
        where = members[0].table if members else None
        line = where.lines[members[0].index[0]] if where is not None and len(members[0].index) else None
        remedy = "an encounter needs two or more"
        raise UserError(Mistake(said, line=line, remedy=remedy), file=where.file if where else "")
    times = []
    for m in members:
        t = m.of("t")
        assert t is not None
        if not len(t):
            raise UserError(f"{m.name} has no rows", file=m.table.file)
        back = np.flatnonzero(np.diff(t) <= 0)
        if back.size:
            k = int(back[0]) + 1
            raise m.mistake(f"the time goes from {t[k - 1]:g} s to {t[k]:g} s", "times must grow", k)
        times.append(t)
    begin = max(float(t[0]) for t in times)
    for m, t in zip(members, times, strict=True):
        if t[-1] < begin:
            raise m.mistake(
                f"its last row is at {t[-1]:g} s, and another aircraft's first at {begin:g} s",
                "all aircraft of an encounter must be there at one time; leave it out",
                len(t) - 1,
            )
    origin = _origin(members[0], times[0], begin)
    made, late = [], []
    for m, t in zip(members, times, strict=True):
        aircraft = _aircraft(m, t, begin, origin)
        made.append(aircraft)
        if t[0] < begin:
            late.append(m.name)
    own = made[0].start
    moved = [
        Aircraft(a.name, a.rows - np.concatenate([[0.0], own]), a.course, a.speed, a.climb) for a in made
    ]
    first = min(float(t[0]) for t in times)
    notes = (
        (f"rows before {begin:g} s are left out: until then some aircraft are not there",)
        if begin > first
        else ()
    )
    return Encounter(name, tuple(moved), members[0].table.file, notes)


def _origin(own: _Rows, t: Array, begin: float) -> Origin | None:
    """Where latitudes and longitudes are measured from: the own aircraft's place at the begin."""
    latitude, longitude, z = own.of("latitude"), own.of("longitude"), own.of("z")
    if latitude is None or longitude is None:
        return None
    assert z is not None
    k = int(np.searchsorted(t, begin, side="right")) - 1
    _check_globe(own, latitude, longitude)
    return Origin(degrees(latitude[k]), degrees(longitude[k]), float(z[k]))


def _check_globe(m: _Rows, latitude: Array, longitude: Array) -> None:
    for what, values, most in (("latitude", latitude, pi / 2), ("longitude", longitude, 2 * pi)):
        beyond = np.flatnonzero(np.abs(values) > most * (1 + 1e-12))
        if beyond.size:
            k = int(beyond[0])
            raise m.mistake(
                f"{what} {degrees(values[k]):g} deg",
                f"give at most {degrees(most):g} deg, or check its unit",
                k,
            )


def _positions(m: _Rows, origin: Origin | None) -> Array:
    """(R, 3) east, north, up [m]."""
    x, y, z = m.of("x"), m.of("y"), m.of("z")
    if origin is None:
        if x is None or y is None:
            raise m.mistake("has no x and y, and other aircraft have", "give all aircraft the same columns")
        return np.stack([x, y, np.zeros(len(x)) if z is None else z], axis=-1)
    latitude, longitude = m.of("latitude"), m.of("longitude")
    if latitude is None or longitude is None or z is None:
        raise m.mistake("has no latitude, and other aircraft have", "give all aircraft the same columns")
    _check_globe(m, latitude, longitude)
    places = [ecef(*at) for at in zip(latitude.tolist(), longitude.tolist(), z.tolist(), strict=True)]
    return origin.enu(np.array(places), z)


def _aircraft(m: _Rows, t: Array, begin: float, origin: Origin | None) -> Aircraft:
    place = _positions(m, origin)
    velocity = _velocity(m)
    if velocity is not None:
        _check_units(m, t, place, velocity)
    after = t >= begin
    rows = np.column_stack([t[after] - begin, place[after]])
    moving = None if velocity is None else velocity[after]
    if t[after][0] > begin:  # between two rows
        at = np.array([np.interp(begin, t, c) for c in place.T])
        rows = np.vstack([np.concatenate([[0.0], at]), rows])
        if velocity is not None and moving is not None:
            first = np.array([np.interp(begin, t, c) for c in velocity.T])
            moving = np.vstack([first, moving])
    if moving is not None:
        now = moving[0]
    elif len(rows) > 1:
        now = _slope(rows)
    else:
        raise m.mistake("one row, and no speed", "give more rows, or columns of track and ground speed")
    return Aircraft(
        m.name, rows, float(np.arctan2(now[1], now[0])), float(np.hypot(now[0], now[1])), float(now[2])
    )


def _slope(rows: Array) -> Array:
    """Velocity at the first row, of the parabola through the first three."""
    few = rows[:3]
    order = 2 if len(few) > 2 else 1
    return np.asarray(np.gradient(few[:, 1:], few[:, 0], axis=0, edge_order=order)[0])  # type: ignore[call-overload]


def _velocity(m: _Rows) -> Array | None:
    """(R, 3) east, north, up [m/s] as recorded; None where the file has no ground speed."""
    climb = m.of("climb")
    east, north = m.of("east_speed"), m.of("north_speed")
    if east is None or north is None:
        speed, track, course = m.of("speed"), m.of("track"), m.of("course")
        # A track is clockwise from north, a course counter-clockwise from east.
        course = pi / 2 - track if track is not None else course
        if speed is None or course is None:
            return None
        below = np.flatnonzero(speed < 0)
        if below.size:
            raise m.mistake(f"ground speed {speed[below[0]]:g} m/s", "give one of 0 or more", int(below[0]))
        east, north = speed * np.cos(course), speed * np.sin(course)
    return np.stack([east, north, np.zeros(len(east)) if climb is None else climb], axis=-1)


def _check_units(m: _Rows, t: Array, place: Array, velocity: Array) -> None:
    """UserError where recorded speeds or directions are not those of the positions."""
    if len(t) < 2:
        return
    moved = np.diff(place[:, :2], axis=0) / np.diff(t)[:, None]
    said = (velocity[1:, :2] + velocity[:-1, :2]) / 2.0
    fast, slow = np.linalg.norm(moved, axis=1), np.linalg.norm(said, axis=1)
    clear = (fast > STANDING) & (slow > STANDING)
    if not clear.any():
        return
    ratio = float(np.median(fast[clear] / slow[clear]))
    if not 1 / MOST_SPEED_RATIO < ratio < MOST_SPEED_RATIO:
        raise m.mistake(
            f"its positions move {ratio:.3g} times as fast as its ground speed says",
            "check the units of positions, time and speed",
        )
    turned = np.angle((moved[clear, 0] + 1j * moved[clear, 1]) * (said[clear, 0] - 1j * said[clear, 1]))
    off = float(np.median(np.abs(turned)))
    if off > MOST_TRACK_ERROR:
        raise m.mistake(
            f"its positions move {degrees(off):.0f} deg off the direction that it states",
            "check the unit; a track is clockwise from north, a course counter-clockwise from east",
        )
