"""Makes the encounters of a set: imported ones perturbed from a seed, or generated; all end soon."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from filters.model import Array
from testbed.components.following.track import Track
from testbed.encounters.encounter import Aircraft, Encounter
from testbed.encounters.generating import Settings, generate, least
from testbed.encounters.importing import read
from testbed.encounters.scenarios import V0_MPS, Choices, made
from testbed.errors import UserError
from testbed.studies.benchmark.file import EncounterSet

# m of h that a start must have, as generated encounters do.
_SPARE_M = 1.0
_TRIES = 300
_SAMPLES = 2001


@dataclass(frozen=True)
class Meeting:
    """One encounter of a set: the plain data of its scenario, tracks included."""

    name: str
    data: dict[str, Any]


def meetings(of: EncounterSet, seed: int, folder: Path, where: str) -> list[Meeting]:
    """The `n` encounters of a set. Number k of a seed is the same whatever n is.

    folder  where the imported file's path starts
    Raises  UserError naming the set
    """
    try:
        found = _imported(of, seed, folder) if of.file else _generated(of, seed)
        choices = Choices(of.others, of.own if of.file else "goal", matched=False)
        each = [made(_ended(e, of), choices) for e in found]
        return [Meeting(m.name, m.scenario().model_dump(mode="json")) for m in each]
    except UserError as error:
        raise UserError(f"{where}: {error}") from None


def _generated(of: EncounterSet, seed: int) -> list[Encounter]:
    settings = Settings(of.vehicles, of.density, of.miss_m)
    each = [generate(kind, seed, -(-of.n // len(of.generate)), settings) for kind in of.generate]
    # One of each kind after the other.
    return [e for together in zip(*each, strict=True) for e in together][: of.n]


def _imported(of: EncounterSet, seed: int, folder: Path) -> list[Encounter]:
    """The file's encounters at the paper's speed, one after the other, each perturbed."""
    file = folder / of.file
    if not file.is_file():
        raise UserError(f"file {of.file} does not exist")
    sources = [e.scaled(V0_MPS / e.aircraft[0].speed) for e in read([file], of.format)]
    found = []
    for number in range(1, of.n + 1):
        e = sources[(number - 1) % len(sources)]
        rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
        for _ in range(_TRIES):
            moved = perturbed(e, rng, of.miss_m, of.height_m, math.radians(of.course_deg))
            if least(moved.aircraft) >= _SPARE_M:
                break
        else:
            raise UserError(f"{e.name}: no start in the safe set found; give a smaller miss_m or course_deg")
        said = f"number {number} of seed {seed}, paths of the others moved by at most {of.miss_m:g} m"
        notes = (*moved.notes, f"{said}, {of.height_m:g} m in height and {of.course_deg:g} deg")
        found.append(replace(moved, name=f"{e.name}-{number:04d}", notes=notes))
    return found


def perturbed(
    e: Encounter, rng: np.random.Generator, metres: float, height: float, angle: float
) -> Encounter:
    """The encounter with the whole path of each other aircraft moved.

    Each is turned by up to `angle` [rad] about where it is at its closest approach to the own aircraft, then
    shifted by up to `metres` east and north and `height` up.
    """
    own, *others = e.aircraft
    moved = [own]
    for a in others:
        t = _meets(own, a)
        pivot = _at(a, np.array([t]))[0]
        turn = rng.uniform(-1.0, 1.0) * angle
        shift = rng.uniform(-1.0, 1.0, 3) * [metres, metres, height]
        moved.append(_moved(a, pivot, turn, shift))
    return replace(e, aircraft=tuple(moved))


def _moved(a: Aircraft, pivot: Array, turn: float, shift: Array) -> Aircraft:
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def placed(points: Array) -> Array:
        return np.asarray((points - pivot) @ rotation.T + pivot + shift)

    rows = np.column_stack([a.rows[:, 0], placed(a.rows[:, 1:])])
    legs = None if a.legs is None else np.column_stack([placed(a.legs[:, :3]), a.legs[:, 3]])
    goal = None if a.goal is None else placed(a.goal)
    return replace(a, rows=rows, course=a.course + turn, legs=legs, goal=goal)


def _ended(e: Encounter, of: EncounterSet) -> Encounter:
    """The encounter that ends soon after the last closest approach.

    Goals lie where vehicles are `reach_s` after it, and the run ends `slack_s` later; who wants its track has
    to be back on it by then. Legs stay as they are. A fleet's run ends `slack_s` after its longest way.
    """
    own, *others = e.aircraft
    if of.generate and len(others) > 1:
        ways = [np.linalg.norm(a.goal - a.start) / a.speed for a in e.aircraft if a.goal is not None]
        return replace(e, end=_half_seconds(float(max(ways)) + of.slack_s))
    reach = max(_meets(own, a) for a in others) + of.reach_s
    end = _half_seconds(reach + of.slack_s)
    to_goals = bool(of.generate) or of.own == "goal"
    return replace(e, aircraft=tuple(_cut(a, reach if to_goals else end) for a in e.aircraft), end=end)


def _half_seconds(t: float) -> float:
    """The next multiple of 0.5 s, which is one of every usual filter period too."""
    return 0.5 * math.ceil(2.0 * t - 1e-9)


def _cut(a: Aircraft, reach: float) -> Aircraft:
    if a.goal is not None:
        return replace(a, goal=a.start + reach * a.velocity)
    if not a.tracked or a.rows[-1, 0] <= reach:
        return a
    before = a.rows[a.rows[:, 0] < reach - 1e-6]
    return replace(a, rows=np.vstack([before, [reach, *_at(a, np.array([reach]))[0]]]))


def _meets(own: Aircraft, other: Aircraft) -> float:
    """s, when two undisturbed aircraft are closest."""
    t = np.linspace(0.0, _lasting([own, other]), _SAMPLES)
    return float(t[np.argmin(np.linalg.norm(_at(own, t) - _at(other, t), axis=1))])


def _lasting(aircraft: Sequence[Aircraft]) -> float:
    """s, for how long all paths are known."""
    return min(_last(a) for a in aircraft)


def _last(a: Aircraft) -> float:
    if a.tracked:
        return float(a.rows[-1, 0])
    if a.legs is not None:
        return float(_times(a)[-1])
    return 120.0 if a.goal is None else float(np.linalg.norm(a.goal - a.start)) / a.speed


def _times(a: Aircraft) -> Array:
    """s, when an aircraft is at the begin and at each end of its legs."""
    assert a.legs is not None
    places = np.vstack([a.start, a.legs[:, :3]])
    lengths = np.linalg.norm(np.diff(places[:, :2], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(lengths / a.legs[:, 3])])


def _at(a: Aircraft, t: Array) -> Array:
    """(T, 3) m, where an undisturbed aircraft is at `t` (T,) s."""
    if a.tracked:
        return np.asarray(Track(a.rows).at(t)[0])
    if a.legs is not None:
        places = np.vstack([a.start, a.legs[:, :3]])
        return np.column_stack([np.interp(t, _times(a), places[:, k]) for k in range(3)])
    return np.asarray(a.start + t[:, None] * a.velocity)
