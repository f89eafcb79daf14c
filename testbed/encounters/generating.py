"""Generates encounters: head-on, crossing, overtaking, converging, circle, wall, random traffic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, pi, radians, sin, sqrt

import numpy as np

from filters.barriers.closed_form import TurnBarrier
from filters.model import Array, State
from testbed.encounters.encounter import Aircraft, Encounter
from testbed.errors import UserError, nearest

V_MPS = 20.0
# What `scenarios` writes: the turn and Ds by which a start is in the safe set.
_BARRIER = TurnBarrier(16.0, radians(11.7), 5.0, 0.0, 1.0, "root", 30.0)
# Metres of h beyond which a start may be perturbed by rounding and still be safe.
_SPARE_M = 1.0
_TRIES = 300


@dataclass(frozen=True)
class Settings:
    """What is common to the encounters of a folder.

    vehicles  of circle, wall and random traffic
    density   of random traffic, vehicles per square kilometre
    miss_m    largest miss distance of two that meet, if nobody evades, to the side and in height
    """

    vehicles: int = 8
    density: float = 10.0
    miss_m: float = 20.0

    def __post_init__(self) -> None:
        if not 2 <= self.vehicles <= 200:
            raise UserError(f"--vehicles {self.vehicles}: give 2 to 200")
        if not 0.01 <= self.density <= 10_000:
            raise UserError(f"--density {self.density:g}: give 0.01 to 10000 vehicles per square kilometre")
        if not 0 <= self.miss_m <= 500:
            raise UserError(f"--miss {self.miss_m:g}: give 0 to 500 m")


Kind = Callable[[np.random.Generator, Settings], list[Aircraft]]


def generate(kind: str, seed: int, count: int, settings: Settings | None = None) -> list[Encounter]:
    """`count` encounters of a kind. Number k of a seed is the same whatever `count` is.

    Every start is in the safe set of the paper's turn with Ds = 5 m.
    Raises  UserError for an unknown kind, or traffic so dense that no such start is found
    """
    settings = settings or Settings()
    if kind not in KINDS:
        raise UserError(f"unknown kind of encounter {kind!r}; {nearest(kind, KINDS)}")
    if not 1 <= count <= 10_000:
        raise UserError(f"--count {count}: give 1 to 10000")
    if not 0 <= seed < 2**63:
        raise UserError(f"--seed {seed}: give 0 to 2^63 - 1")
    found = []
    for number in range(1, count + 1):
        rng = np.random.default_rng(np.random.SeedSequence([seed, number, list(KINDS).index(kind)]))
        aircraft = _safe(kind, rng, settings)
        own = np.concatenate([[0.0], aircraft[0].start])
        moved = [
            Aircraft(
                a.name, a.rows - own, a.course, a.speed, goal=None if a.goal is None else a.goal - own[1:]
            )
            for a in aircraft
        ]
        source = f"testbed encounters generate {kind} --seed {seed}, number {number}"
        found.append(Encounter(f"{kind}-{number:04d}", tuple(moved), source))
    return found


def _safe(kind: str, rng: np.random.Generator, settings: Settings) -> list[Aircraft]:
    """Drawn again until every pair starts in the safe set."""
    for _ in range(_TRIES if kind != "random" else 1):
        aircraft = KINDS[kind](rng, settings)
        if least(aircraft) >= _SPARE_M:
            return aircraft
    raise UserError(
        f"no safe start found for {kind} with {settings.vehicles} vehicles; give fewer --vehicles"
    )


def least(aircraft: Sequence[Aircraft]) -> float:
    """m, the least h of any pair at the start."""
    return float(_BARRIER.values(_state(aircraft)).h.min())


def _state(aircraft: Sequence[Aircraft]) -> State:
    x, y, z = np.array([a.start for a in aircraft]).T
    return State(x, y, np.array([a.course for a in aircraft]), z)


def _one(name: str, place: Array, course: float, speed: float, metres: float) -> Aircraft:
    """An aircraft whose goal is `metres` ahead."""
    goal = place + metres * np.array([cos(course), sin(course), 0.0])
    return Aircraft(name, np.array([[0.0, *place]]), course, speed, goal=goal)


def _two(
    rng: np.random.Generator, settings: Settings, angle: float, speeds: tuple[float, float]
) -> list[Aircraft]:
    """Two that meet, if nobody evades, after 10 to 15 s: the second comes from `angle` to the first's course.

    They miss each other by at most `miss_m` to the side, and by at most a quarter of it in height.
    """
    t = rng.uniform(10.0, 15.0)
    side, height = rng.uniform(-1.0, 1.0, 2) * [settings.miss_m, settings.miss_m / 4]
    first, second = speeds
    meeting = np.array([first * t, 0.0, 0.0])
    across = np.array([-sin(angle), cos(angle), 0.0])
    start = (
        meeting - second * t * np.array([cos(angle), sin(angle), 0.0]) + side * across + [0.0, 0.0, height]
    )
    return [
        _one("own", np.zeros(3), 0.0, first, 2 * first * t),
        _one("other", start, angle, second, 2 * second * t),
    ]


def _head_on(rng: np.random.Generator, settings: Settings) -> list[Aircraft]:
    return _two(rng, settings, pi + radians(rng.uniform(-10, 10)), (V_MPS, rng.uniform(18, 22)))


def _crossing(rng: np.random.Generator, settings: Settings) -> list[Aircraft]:
    return _two(
        rng, settings, rng.choice([-1, 1]) * radians(rng.uniform(60, 120)), (V_MPS, rng.uniform(18, 22))
    )


def _converging(rng: np.random.Generator, settings: Settings) -> list[Aircraft]:
    return _two(
        rng, settings, rng.choice([-1, 1]) * radians(rng.uniform(20, 60)), (V_MPS, rng.uniform(18, 22))
    )


def _overtaking(rng: np.random.Generator, settings: Settings) -> list[Aircraft]:
    """The own vehicle comes from behind."""
    slow = rng.uniform(15.5, 17.0)
    behind = rng.uniform(60.0, 120.0)
    side, height = rng.uniform(-1.0, 1.0, 2) * [settings.miss_m / 2, settings.miss_m / 4]
    course = radians(rng.uniform(-5, 5))
    metres = 2 * 24.0 * behind / (24.0 - slow)
    return [
        _one("own", np.zeros(3), 0.0, 24.0, metres),
        _one("other", np.array([behind, side, height]), course, slow, metres * slow / 24.0),
    ]


def _circle(rng: np.random.Generator, settings: Settings) -> list[Aircraft]:
    """All face the centre of a circle, each a little off; its radius grows with their number."""
    n = settings.vehicles
    radius = max(200.0, 20.0 * n)
    angles = 2 * pi * np.arange(n) / n + rng.uniform(-0.2, 0.2, n) * 2 * pi / n
    found = []
    for k, angle in enumerate(angles):
        place = radius * np.array([cos(angle), sin(angle), 0.0]) + [0.0, 0.0, rng.uniform(-1, 1)]
        course = angle + pi + radians(rng.uniform(-5, 5))
        found.append(_one(f"{k + 1}", place, course, V_MPS, 2 * radius))
    return found


def _wall(rng: np.random.Generator, settings: Settings) -> list[Aircraft]:
    """The own vehicle meets the others head-on, who fly abreast 40 to 60 m apart."""
    n, t, apart = settings.vehicles - 1, rng.uniform(10.0, 15.0), rng.uniform(40.0, 60.0)
    metres = 4 * V_MPS * t
    found = [_one("own", np.zeros(3), 0.0, V_MPS, metres)]
    shift = rng.uniform(-0.5, 0.5) * apart
    for k in range(n):
        y = (k - (n - 1) / 2) * apart + shift
        found.append(_one(f"{k + 1}", np.array([2 * V_MPS * t, y, 0.0]), pi, V_MPS, metres))
    return found


def _random(rng: np.random.Generator, settings: Settings) -> list[Aircraft]:
    """Vehicles over a square of the area vehicles / density, on courses drawn evenly."""
    side = 1000.0 * sqrt(settings.vehicles / settings.density)
    found: list[Aircraft] = []
    for k in range(settings.vehicles):
        for _ in range(_TRIES):
            x, y = rng.uniform(-side / 2, side / 2, 2)
            course, speed = rng.uniform(-pi, pi), rng.uniform(18.0, 22.0)
            drawn = _one(f"{k + 1}", np.array([x, y, rng.uniform(-2, 2)]), course, speed, side)
            if not found or _clear(found, drawn):
                found.append(drawn)
                break
        else:
            raise UserError(
                f"random traffic: no safe start for vehicle {k + 1} of {settings.vehicles} in {_TRIES} tries"
                f" at {settings.density:g} vehicles per square kilometre; give a lower --density"
            )
    return found


def _clear(found: Sequence[Aircraft], drawn: Aircraft) -> bool:
    n = len(found)
    h = _BARRIER.values(_state([*found, drawn]), np.arange(n), np.full(n, n)).h
    return bool(h.min() >= _SPARE_M)


KINDS: dict[str, Kind] = {
    "head-on": _head_on,
    "crossing": _crossing,
    "overtaking": _overtaking,
    "converging": _converging,
    "circle": _circle,
    "wall": _wall,
    "random": _random,
}
