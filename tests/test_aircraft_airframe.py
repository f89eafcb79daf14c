"""Airframe folders: loading, gains, and one clear line for every mistake; trim; light imports."""

import math
import subprocess
import sys

import pytest

from aircraft.airframe import load
from aircraft.airframes.schema import names
from aircraft.jsbsim.trim import trim, trim_map


def test_the_x8_comes_with_the_package():
    assert "x8" in names()
    assert load("x8").gains["turn"]["servo_lead_s"] == 0.05


def test_an_airframe_that_does_not_exist_is_named():
    with pytest.raises(FileNotFoundError, match=r"no airframe albatross.*x8"):
        load("albatross")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("start_mps = 20.0", "start_mps = -20.0", "speeds.start_mps"),
        ("damping = 1.145", "damping = nan", "gains.turn.damping"),
        ("[speeds]", "[speeds", "airframe.toml"),
        ('title = "', 'titel = "', "titel|title"),
    ],
)
def test_a_mistake_in_the_file_names_the_file_and_the_field(tmp_path, old, new, message):
    text = (load("x8").folder / "airframe.toml").read_text()
    assert old in text
    (tmp_path / "airframe.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        load(tmp_path)


def test_gains_change_in_a_copy_and_misspelt_ones_are_refused():
    x8 = load("x8")
    assert x8.with_gains({"turn.damping": 0.7}).gain_values()["turn_damping"] == 0.7
    assert x8.gain_values()["turn_damping"] != 0.7
    with pytest.raises(KeyError, match=r"turn\.dampin.*turn\.damping"):
        x8.with_gains({"turn.dampin": 0.7})


@pytest.mark.parametrize(("v", "alpha_deg"), [(15, 3.5), (20, 1.2), (25, 0.1)])
def test_level_trim(v, alpha_deg):
    t = trim(load("x8"), v)
    assert math.degrees(t.alpha) == pytest.approx(alpha_deg, abs=0.1)
    assert abs(t.roll) < 1e-3 and abs(t.beta) < 1e-6 and t.airspeed == pytest.approx(v)


@pytest.mark.parametrize(("v", "bank_deg"), [(15, -20.3), (20, -26.2), (25, -31.6)])
def test_a_steady_left_turn_banks_left(v, bank_deg):
    # atan(v omega / g) and a degree more: without a rudder the wing slips and its side force pushes outwards
    t = trim(load("x8"), v, omega=math.radians(13))
    assert math.degrees(t.roll) == pytest.approx(bank_deg, abs=0.1)


def test_the_trim_map_says_where_the_aircraft_cannot_fly():
    found = trim_map(load("x8"), [16.0, 40.0], climbs=[0.0, -3.9])
    assert found[16.0, 0.0, 0.0] is not None
    assert found[16.0, -3.9, 0.0] is None  # idle sink is 2.3 m/s
    assert found[40.0, 0.0, 0.0] is None


def test_importing_aircraft_brings_neither_jsbsim_nor_control():
    code = (
        "import sys, aircraft, aircraft.plant, aircraft.kinematic; "
        "print('jsbsim' in sys.modules, 'control' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["False", "False"]
