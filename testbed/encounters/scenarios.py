"""Makes scenarios of encounters: speeds matched to the filter's, limits widened where a track needs it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from filters.model import Array
from testbed.components.following.track import Track
from testbed.encounters.encounter import Aircraft, Encounter
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario, parse
from testbed.scenario.track_file import MOST_ROWS

OTHERS = ("track", "keep-course", "filter")
OWN = ("track", "goal")
# The settings of the paper that an encounter is matched to: [limits], the turn of [barrier], Ds and alpha.
V0_MPS = 20.0
_LIMITS = {"v_min_mps": 15.0, "v_max_mps": 25.0, "omega_max_degps": 13.0, "zeta_max_mps": 3.9}
_TURN = {"v_mps": 16.0, "omega_degps": 11.7, "smoothing_m2": 30.0}
# A linear alpha begins early, which is what keeps clear of an intruder (docs/guide/vehicles.md).
_ALPHA = 0.1
# How much more than its track a vehicle may fly, to come back to it.
_SPARE = 0.15
_DIGITS = 6
_PERIOD_S = 0.05


@dataclass(frozen=True)
class Choices:
    """How an encounter becomes a scenario.

    others    what the other vehicles fly: their track or legs or course as intruders ("track"), the course
              and speed they start with as intruders ("keep-course"), or their track under the filter too
    own       what the own vehicle wants: its track ("track"), or the end of it ("goal")
    speed     m/s that the own vehicle's speed is scaled to; None keeps the encounter, and scales limits,
              manoeuvre, Ds and alpha to it instead
    duration  s, of the encounter as the file has it; None: as long as it is
    matched   False: the encounter was made for the paper's speeds, and nothing is scaled
    """

    others: str = "track"
    own: str = "track"
    speed: float | None = V0_MPS
    duration: float | None = None
    matched: bool = True

    def __post_init__(self) -> None:
        for name, said, known in (("others", self.others, OTHERS), ("own", self.own, OWN)):
            if said not in known:
                raise UserError(f"--{name} {said}: give one of {', '.join(known)}")
        if self.speed is not None and not 0.1 <= self.speed <= 900:
            raise UserError(f"--speed {self.speed:g}: give 0.1 to 900 m/s")
        if self.duration is not None and not 0 < self.duration <= 86400:
            raise UserError(f"--duration {self.duration:g}: give more than 0 and at most 86400 s")


@dataclass(frozen=True, eq=False)
class Made:
    """A scenario of an encounter.

    data    as a scenario file says it; tracks are named by files
    tracks  file name -> its rows, t [s], x, y, z [m]
    """

    name: str
    data: dict[str, Any]
    tracks: dict[str, Array] = field(default_factory=dict)

    def scenario(self) -> Scenario:
        """Checked as `testbed run` checks it. Raises UserError."""
        vehicles = []
        for table in self.data["vehicle"]:
            guidance = table.get("guidance", {})
            if "file" in guidance:
                guidance = guidance | {"rows": self.tracks[guidance["file"]].tolist()}
            vehicles.append(table | ({"guidance": guidance} if guidance else {}))
        return parse(self.data | {"vehicle": vehicles}, self.name)


def made(e: Encounter, choices: Choices) -> Made:
    """The scenario of an encounter. Raises UserError where no scenario can say it."""
    speed = e.aircraft[0].speed
    if speed < 0.1:
        raise UserError(
            f"{e.source}: {e.aircraft[0].name} starts at {speed:g} m/s; the first aircraft has to fly"
        )
    k = choices.speed / speed if choices.matched and choices.speed is not None else 1.0
    own = speed * k
    lasting = e.duration if choices.duration is None else choices.duration
    flown = e.scaled(k)
    grown = own / V0_MPS if choices.matched else 1.0
    limits = _scaled(_LIMITS, grown)
    # A track is not flown beyond its last row; whatever else is, for a whole number of periods.
    whole = math.floor if e.aircraft[0].tracked and choices.duration is None else math.ceil
    seconds = _PERIOD_S * max(1, whole(lasting * k / _PERIOD_S + (1e-6 if whole is math.floor else -1e-6)))
    tracks: dict[str, Array] = {}
    tables, widened = [], []
    for number, a in enumerate(flown.aircraft, 1):
        table = _vehicle(e.name, number, a, choices, seconds, tracks)
        wider = _wider(a, table, limits)
        if wider:
            table["limits"] = wider
            widened.append(number)
        tables.append(table)
    data = {
        "name": e.name,
        "description": _said(e, choices, k, grown, widened),
        "duration_s": round(seconds, 9),
        "d_safe_m": _rounded(5.0 * grown**2),
        "goal_radius_m": _rounded(20.0 * grown**2),
        "checks": {"manoeuvre_instants": 0},
        "rates": {"filter_dt_s": _PERIOD_S, "record_dt_s": _PERIOD_S},
        "limits": limits,
        "alpha": {"kind": "linear", "coefficient": _rounded(_ALPHA / grown)},
        "barrier": {"delta_m2": 0.0, **_scaled(_TURN, grown)},
        "vehicle": tables,
    }
    if any("guidance" not in table for table in tables):
        data["guidance"] = {"lookahead_m": _rounded(10.0 * grown**2)}
    return Made(e.name, data, tracks)


def _scaled(settings: Mapping[str, float], k: float) -> dict[str, float]:
    """Speeds by k, turn rates by 1/k, m^2 by k^4."""
    powers = {"_mps": 1, "_degps": -1, "_m2": 4}
    return {
        name: _rounded(x * k ** next(p for unit, p in powers.items() if name.endswith(unit)))
        for name, x in settings.items()
    }


def _vehicle(
    name: str, number: int, a: Aircraft, choices: Choices, seconds: float, tracks: dict[str, Array]
) -> dict[str, Any]:
    """The [[vehicle]] table of one aircraft."""
    intruder = number > 1 and choices.others != "filter"
    course = math.degrees(math.remainder(a.course, 2 * math.pi))
    x, y, z = (_rounded(c) for c in a.start)
    table: dict[str, Any] = {"filter": False} if intruder else {}
    table |= {"x_m": x, "y_m": y, "z_m": z, "course_deg": _rounded(course)}
    table["speed_mps"] = _rounded(max(a.speed, 0.01))
    keeps = intruder and choices.others == "keep-course"
    end = _end(a, seconds)
    if not intruder:
        table |= dict(zip(("goal_x_m", "goal_y_m", "goal_z_m"), map(_rounded, end), strict=True))
        if choices.own == "goal" or a.goal is not None:
            return table
    table["guidance"] = _straight(a, seconds) if keeps else _guidance(name, number, a, seconds, tracks)
    return table


def _end(a: Aircraft, seconds: float) -> Array:
    """Where an aircraft comes to: the end of its track or legs, or of its course."""
    if a.goal is not None:
        return a.goal
    if a.legs is not None:
        return np.asarray(a.legs[-1, :3])
    return np.asarray(a.rows[-1, 1:] if a.tracked else a.start + seconds * a.velocity)


def _guidance(
    name: str, number: int, a: Aircraft, seconds: float, tracks: dict[str, Array]
) -> dict[str, Any]:
    if a.legs is not None:
        places = [[*a.start, a.speed], *a.legs.tolist()]
        return {
            "kind": "waypoints",
            "speed_mps": _rounded(a.speed),
            "waypoints_m": [[_rounded(c) for c in place] for place in places],
        }
    if not a.tracked:
        return _straight(a, seconds)
    if len(a.rows) > MOST_ROWS:
        raise UserError(f"{name}: {a.name} has {len(a.rows)} rows, more than {MOST_ROWS}; thin it out")
    file = f"tracks/{name}-{number}.csv"
    tracks[file] = np.round(a.rows, _DIGITS)
    return {"kind": "track", "file": file}


def _straight(a: Aircraft, seconds: float) -> dict[str, Any]:
    """The course, speed and climb rate of the start, for as long as the run."""
    if abs(a.climb) < 1e-3:
        course = math.degrees(math.remainder(a.course, 2 * math.pi))
        speed = _rounded(max(a.speed, 0.01))
        return {
            "kind": "hold",
            "course_deg": _rounded(course),
            "speed_mps": speed,
            "height_m": _rounded(a.start[2]),
        }
    ends = [[t, *(a.start + t * a.velocity)] for t in (0.0, seconds)]
    return {"kind": "track", "rows": [[_rounded(c) for c in row] for row in ends]}


def _wider(a: Aircraft, table: Mapping[str, Any], limits: Mapping[str, float]) -> dict[str, float]:
    """Limits of its own for a vehicle that flies what [limits] do not allow."""
    kind = table.get("guidance", {}).get("kind")
    slow = fast = a.speed
    turn, climb = 0.0, abs(a.climb)
    if kind == "track" and a.tracked:
        slow, fast, turn, climb = extremes(a.rows)
    elif kind == "waypoints" and a.legs is not None:
        slow, fast = min(slow, a.legs[:, 3].min()), max(fast, a.legs[:, 3].max())
    asked = {
        "v_min_mps": max(0.01, slow * (1 - _SPARE)) if slow < limits["v_min_mps"] else limits["v_min_mps"],
        "v_max_mps": fast * (1 + _SPARE) if fast > limits["v_max_mps"] else limits["v_max_mps"],
        "omega_max_degps": max(limits["omega_max_degps"], math.degrees(turn) * (1 + _SPARE)),
        "zeta_max_mps": max(limits["zeta_max_mps"], climb * (1 + _SPARE)),
    }
    wider = {name: _rounded(x) for name, x in asked.items() if abs(x - limits[name]) > 1e-9}
    if wider.get("omega_max_degps", 0.0) > 360.0:
        wider["omega_max_degps"] = 360.0
    return wider


def extremes(rows: Array) -> tuple[float, float, float, float]:
    """Least and largest ground speed [m/s], turn rate [rad/s] and climb rate [m/s] of a track (R, 4)."""
    track = Track(rows)
    t = rows[:, 0] - rows[0, 0]
    middle = [t[:-1] + share * np.diff(t) for share in (0.25, 0.5, 0.75)]
    _, velocity, acceleration = track.at(np.concatenate([t, *middle]))
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    across = np.abs(velocity[:, 0] * acceleration[:, 1] - velocity[:, 1] * acceleration[:, 0])
    turn = across / np.maximum(speed, 0.5) ** 2
    return float(speed.min()), float(speed.max()), float(turn.max()), float(np.abs(velocity[:, 2]).max())


def _said(e: Encounter, choices: Choices, k: float, grown: float, widened: list[int]) -> str:
    names = ", ".join(f"{n} {a.name}" for n, a in enumerate(e.aircraft[:20], 1))
    said = [f"From {Path(e.source).name}: {names}" + (" and others" if len(e.aircraft) > 20 else "")]
    if abs(k - 1.0) > 1e-9:
        said.append(
            f"scaled by v/v0 = {1 / k:.6g} to {choices.speed:g} m/s: speeds and times x {k:.6g},"
            f" lengths x {k * k:.6g}, turn rates x {1 / k:.6g}"
        )
    if abs(grown - 1.0) > 1e-9:
        said.append(
            f"limits, manoeuvre, Ds and alpha scaled by v/v0 = {grown:.6g}: speeds and times"
            f" x {grown:.6g}, lengths x {grown**2:.6g}, turn rates x {1 / grown:.6g}"
        )
    if widened:
        said.append(f"limits widened for what vehicle {', '.join(map(str, widened[:20]))} flies")
    return "; ".join([*said, *e.notes])[:2000]


def _rounded(value: float) -> float:
    return round(float(value), _DIGITS) + 0.0
