"""Generated encounters: their geometry is what their name says, and each start is in the safe set."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from math import degrees, pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from testbed.components import catalogue
from testbed.components.initial_conditions import generators, places
from testbed.encounters.encounter import Aircraft
from testbed.encounters.generating import KINDS, Settings, generate
from testbed.encounters.scenarios import Choices, made
from testbed.scenario.scenario import load

PLAIN = Choices("filter", "goal", matched=False)


def missed(one: Aircraft, other: Aircraft) -> tuple[float, float]:
    """When two that keep their courses are closest [s], and how close [m]."""
    t = np.arange(0.0, 40.0, 0.01)
    apart = (other.start - one.start)[:, None] + (other.velocity - one.velocity)[:, None] * t
    distance = np.linalg.norm(apart, axis=0)
    return float(t[distance.argmin()]), float(distance.min())


@pytest.mark.parametrize("kind", KINDS)
def test_every_start_is_in_the_safe_set_of_its_scenario(kind: str) -> None:
    for e in generate(kind, 5, 3):
        one = made(e, PLAIN)
        s = one.scenario()
        assert not one.tracks and e.aircraft[0].start == pytest.approx([0, 0, 0])
        state, goal = places(s, generators(s.seed)["start"])
        assert catalogue.barrier(s).values(state).h.min() > 0
        assert goal == pytest.approx(np.array([a.goal for a in e.aircraft]), abs=1e-5)


@pytest.mark.parametrize(
    ("kind", "low", "high"), [("head-on", 170, 180), ("crossing", 60, 120), ("converging", 20, 60)]
)
def test_two_that_meet_come_from_their_angle_and_nearly_hit(kind: str, low: float, high: float) -> None:
    for e in generate(kind, 1, 12, Settings(miss_m=8)):
        own, other = e.aircraft
        turned = abs(degrees(np.angle(np.exp(1j * (other.course - own.course)))))
        assert low <= turned <= high
        t, distance = missed(own, other)
        assert 9 < t < 16 and distance <= sqrt(8**2 + 2**2)


def test_who_overtakes_is_faster_and_behind() -> None:
    for e in generate("overtaking", 2, 6):
        own, other = e.aircraft
        assert own.speed > other.speed + 5 and other.start[0] >= 60
        assert abs(other.course) < 0.1


def test_a_circle_faces_its_centre_and_a_wall_the_own_vehicle() -> None:
    (circle,) = generate("circle", 3, 1, Settings(vehicles=12))
    centre = np.mean([a.start for a in circle.aircraft], axis=0)
    for a in circle.aircraft:
        towards = np.arctan2(*(centre - a.start)[[1, 0]])
        assert abs(np.angle(np.exp(1j * (towards - a.course)))) < 0.2
    (wall,) = generate("wall", 3, 1, Settings(vehicles=6))
    across = [a.start[1] for a in wall.aircraft[1:]]
    assert all(abs(a.course - pi) < 1e-9 for a in wall.aircraft[1:])
    assert np.ptp(np.diff(across)) < 1e-9 and 40 <= across[1] - across[0] <= 60
    assert min(across) < 0 < max(across)


def test_random_traffic_has_the_density_asked_for() -> None:
    (e,) = generate("random", 4, 1, Settings(vehicles=40, density=8))
    place = np.array([a.start for a in e.aircraft])
    side = 1000 * sqrt(40 / 8)
    # 40 places drawn evenly span 95 % of a side on the average.
    assert (0.8 * side < np.ptp(place[:, :2], axis=0)).all() and (np.ptp(place[:, :2], axis=0) <= side).all()
    courses = [a.course for a in e.aircraft]
    assert abs(np.mean(np.exp(1j * np.array(courses)))) < 0.4
    assert all(np.linalg.norm(p - q) > 5 for p, q in combinations(place, 2))


def test_a_seed_s_encounters_are_the_same_however_many_are_made() -> None:
    many, few = generate("crossing", 7, 3), generate("crossing", 7, 2)
    assert [made(e, PLAIN).data for e in many[:2]] == [made(e, PLAIN).data for e in few]
    assert made(many[0], PLAIN).data["vehicle"] != made(many[1], PLAIN).data["vehicle"]
    assert made(generate("crossing", 8, 1)[0], PLAIN).data != made(many[0], PLAIN).data


def test_the_command_writes_files_that_run_reads(tmp_path: Path, call: Callable[..., int]) -> None:
    out = tmp_path / "crossing"
    again = ("encounters", "generate", "crossing", "--seed", 1, "--count", 2, "--others", "keep-course")
    assert call(*again, "--out", out) == 0
    s = load(out / "crossing-0002.toml")
    assert [v.filter for v in s.vehicle] == [True, False]
    assert s.description.startswith("From testbed encounters generate crossing --seed 1, number 2")
    assert call(*again, "--out", out) == 2
    assert call(*again, "--out", out, "--overwrite") == 0


def test_what_cannot_be_generated_is_refused(refusal: Callable[..., str]) -> None:
    make = ("encounters", "generate")
    assert "did you mean crossing or converging?" in refusal(*make, "crosing", "--out", "o")
    assert "--count 0: give 1 to 10000" in refusal(*make, "wall", "--count", "0", "--out", "o")
    assert "--vehicles 1: give 2 to 200" in refusal(*make, "wall", "--vehicles", "1", "--out", "o")
    assert "--density 0: give" in refusal(*make, "random", "--density", "0", "--out", "o")
    assert "--miss -1: give" in refusal(*make, "wall", "--miss", "-1", "--out", "o")
    said = refusal(*make, "random", "--density", "10000", "--vehicles", "200", "--out", "o")
    assert "no safe start for vehicle" in said and "give a lower --density" in said
