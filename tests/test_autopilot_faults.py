"""Bad autopilots: unstable, saturated, and with another aircraft's parameters; check and tune name each."""

from __future__ import annotations

from pathlib import Path

import pytest

from aircraft.airframe import copy, load
from aircraft.autopilots.faults import Fault, faults, in_short, mis_scaled, roll_feedforward, saturated
from aircraft.check.check import check
from testbed.studies.tuning.tuning import specification

# At 50 Hz the roll loop takes a gain of 3, not of 10.
# What an aircraft with three times the mass flies at 30 m/s, where the X8 flies 15 to 25 m/s.
LARGER = {"AIRSPEED_MIN": 22.0, "AIRSPEED_MAX": 45.0, "SCALING_SPEED": 30.0, "RLL_RATE_FF": 0.9}
BAD = {
    "unstable": (
        "x8@arduplane",
        {"RLL_RATE_P": 10.0},
        "the aileron loop oscillates at ",
        "lower RLL_RATE_P,",
    ),
    "saturated": (
        "x8@px4",
        {"FW_R_LIM": 8.0},
        "a turn of 11.7 deg/s at 20 m/s is limited 100% of the time and ends at 3.",
        "widen FW_R_LIM",
    ),
    "mis-scaled": (
        "x8@arduplane",
        LARGER,
        "RLL_RATE_FF is 0.9, its ailerons need 0.176",
        "take this aircraft's parameter file",
    ),
}
RULES = {"unstable": "stability", "saturated": "limits", "mis-scaled": "scale"}


@pytest.mark.parametrize("kind", BAD)
def test_check_and_tune_name_a_bad_autopilot(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, parameters, said, remedy = BAD[kind]
    folder = copy(name, tmp_path / "bad", parameters)
    toml = folder / "airframe.toml"
    toml.write_text(toml.read_text().replace("[15.0, 18.0, 20.0, 22.0, 25.0]", "[20.0]"))
    found = [f for f in check(folder) if f.rule != "stale"]
    assert {f.rule for f in found} == {RULES[kind]}
    assert found[0].message.startswith(kind) and said in found[0].message and remedy in found[0].remedy
    lines = toml.read_text().splitlines()
    assert lines[found[0].line - 1].partition(" = ")[0] in {*parameters, "[parameters]"}
    # The specification's own flights are not what is tested.
    monkeypatch.setattr("aircraft.autopilots.specification.evaluate", lambda airframe: [])
    tuned = specification(load(folder))
    (line,) = tuned.lines[:-1]
    assert line.startswith(kind) and said in line and remedy in line
    assert not tuned.met and tuned.data["faults"] == [line]


@pytest.mark.parametrize("name", ["x8", "rascal", "x8@arduplane", "rascal@px4", "x8@px4@poor"])
def test_the_package_s_autopilots_are_scaled_and_reach_what_is_asked(name: str) -> None:
    assert [*mis_scaled(load(name)), *saturated(load(name))] == []


@pytest.mark.parametrize(
    ("name", "parameters", "said"),
    [
        ("x8@arduplane", {"TECS_CLMB_MAX": 0.5}, "a climb of 2 m/s at 20 m/s is limited 100% of the time"),
        ("x8@px4", {"FW_AIRSPD_MAX": 20.0}, "24 m/s from 20 m/s is limited 100% of the time and ends at 20"),
        ("x8@arduplane", {"THR_MAX": 34.0}, "is limited"),
    ],
)
def test_a_limit_that_keeps_a_command_from_being_reached_is_saturation(
    name: str, parameters: dict[str, float], said: str
) -> None:
    found = list(saturated(load(name).with_gains(parameters)))
    assert found and said in found[0].what and found[0].kind == "saturated"


def test_the_feed_forward_of_roll_is_what_the_sources_say() -> None:
    """For ArduPlane 0.346 at a scaling speed of 15 m/s, by the roll damping and ailerons of the X8."""
    needed = roll_feedforward(load("x8@arduplane"), 18.0) / 1.2732395 * 18.0 / 15.0
    assert needed == pytest.approx(0.346, rel=0.03)
    for own in ("x8@px4", "rascal@px4", "rascal@arduplane"):
        assert mis_scaled(load(own)) == []


def test_parameters_of_a_similar_aircraft_are_no_other_scale() -> None:
    assert mis_scaled(load("x8@arduplane").with_gains(load("rascal@arduplane").parameters)) == []


def test_an_autopilot_of_the_user_s_own_is_named_by_its_file(tmp_path: Path) -> None:
    folder = copy("x8", tmp_path / "wing")
    text = (Path(__file__).parents[1] / "docs/guide/examples/pid.eq").read_text()
    (folder / "pid.eq").write_text(text.replace("BANK_MAX = 0.7", "BANK_MAX = 0.1"))
    (fault,) = faults(load(f"{folder}@pid.eq"))
    assert "a turn of 11.7 deg/s" in str(fault) and "widen the limits of pid.eq" in str(fault)


def test_faults_of_one_remedy_are_one_line() -> None:
    found = [Fault("unstable", f"unstable at {v} m/s", "lower P", "") for v in (15, 18, 20)]
    assert in_short(found) == ["unstable at 15 m/s (and 2 times more); lower P"]
    assert in_short(found[:2]) == ["unstable at 15 m/s (and once more); lower P"]
    assert in_short(found[:1]) == ["unstable at 15 m/s; lower P"]
