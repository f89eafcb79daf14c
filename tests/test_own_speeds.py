"""An airframe is tuned, identified and fitted at the speeds that its own [speeds] states, not at the X8's."""

from __future__ import annotations

from pathlib import Path

import pytest

from aircraft.airframe import copy, load
from aircraft.airframes.schema import Airframe, Speeds
from aircraft.autopilots import identification, specification
from aircraft.autopilots.feedforward import feedforward
from aircraft.autopilots.freshness import flown

HEAVY = (
    ("x8.xml", '<emptywt unit="KG"> 3.364', '<emptywt unit="KG"> 12'),
    ("airframe.toml", "mass_kg = 3.364\nwing", "mass_kg = 12.0\nwing"),
    ("airframe.toml", "v_min_mps = 15.0", "v_min_mps = 19.0"),
    ("airframe.toml", "start_mps = 20.0", "start_mps = 22.0"),
    ("airframe.toml", "[15.0, 18.0, 20.0, 22.0, 25.0]", "[19.0, 22.0, 25.0]"),
    ("airframe.toml", "airspeed_min_mps = 12.5", "airspeed_min_mps = 18.5"),
)


@pytest.fixture
def heavy(tmp_path: Path) -> Airframe:
    """An X8 of 12 kg, which cannot fly level at the speeds of the X8's steps."""
    folder = copy("x8", tmp_path / "heavy")
    for file, old, new in HEAVY:
        text = (folder / file).read_text()
        assert old in text, old
        (folder / file).write_text(text.replace(old, new, 1))
    return load(folder)


def test_the_x8s_steps_are_at_the_speeds_of_the_specification() -> None:
    speeds = load("x8").speeds
    assert {s.start for s in specification.steps(speeds)} == {16.0, 18.0, 20.0, 25.0}
    assert {s.command[0] for s in specification.steps(speeds)} == {16.0, 20.0, 22.0, 24.0, 25.0}
    starts = {v for listed in identification.steps(speeds).values() for v, _, _ in listed}
    assert starts == {16.0, 20.0, 24.0, 25.0}


@pytest.mark.parametrize(("low", "high"), [(19.0, 25.0), (8.0, 14.0), (15.0, 40.0)])
def test_all_steps_stay_within_the_airframes_speeds(low: float, high: float) -> None:
    speeds = Speeds(v_min_mps=low, v_max_mps=high, start_mps=low, trim_mps=[low])
    for step in specification.steps(speeds):
        assert low <= step.start <= high and low <= step.command[0] <= high, step.title
    for listed in identification.steps(speeds).values():
        for start, _, command in listed:
            assert low <= start <= high and low <= command[0] <= high


def test_an_airframe_too_heavy_for_the_x8s_speeds_is_fitted_and_flown(heavy: Airframe) -> None:
    fitted = feedforward(heavy)
    assert 0.5 < fitted["cl_alpha"] / load("x8").gains["airframe"]["cl_alpha"] < 1.5
    rows = flown(heavy)
    assert all(19.0 <= v <= 25.5 for v in rows[::3])
    (turn, *_) = specification.steps(heavy.speeds)
    flight, _ = specification.flown(heavy, turn)
    assert turn.start == 19.6 and abs(flight.v - 19.6).max() < 2.0
