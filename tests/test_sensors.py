"""Sensors and servos between JSBSim and the autopilots, and ArduPlane's and PX4's loops on the X8."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import testbed
from aircraft.airframe import load
from aircraft.airframes.provenance import identified_fingerprint
from aircraft.airframes.sensors import PRESETS, Sensors, label, sensors_of
from aircraft.autopilots.linear_model import linear_model
from aircraft.autopilots.margins import model_response, response, waits_of
from aircraft.autopilots.tuning import Score, fly, score
from aircraft.equations.catalogue import equations_of, of_airframe
from aircraft.equations.language import parse
from aircraft.equations.sensing import sensed
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.fleet import JsbsimFleet
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start
from filters.model import Command, State
from testbed.studies.answer import answer as answers
from testbed.studies.ladder import ladder as ladders
from testbed.verification import recorded
from testbed.verification.wording import wording

TURN = math.radians(11.7)


def test_perfect_sensors_leave_the_equations_alone() -> None:
    x8 = equations_of(load("x8"))
    assert sensed(x8, Sensors()) is x8
    assert load("x8@perfect") == load("x8")


@pytest.mark.parametrize("name", ["x8", "rascal", "x8@arduplane", "x8@px4", "rascal@px4"])
def test_nothing_true_is_left_to_the_autopilot_of_what_a_sensor_gives(name: str) -> None:
    plain, typical = of_airframe(load(name)), of_airframe(load(f"{name}@typical"))
    own = {n for n, path in plain.uses.items() if not path.startswith(("attitude/", "simulation/", "fcs/"))}
    read = {e.name for c in plain.channels for e in c.equations}
    for channel in typical.channels:
        for e in channel.equations:
            if e.name in read:
                assert not own & set(e.formula.replace("(", " ").replace(")", " ").split()), e
    assert not own & typical.uses.keys()


def test_a_property_that_no_sensor_gives_is_refused() -> None:
    text = "use energy = velocities/eci-velocity-mag-fps\ninput on = 0\n== c ==\na = energy"
    with pytest.raises(ValueError, match="use energy = velocities/eci-velocity-mag-fps: no sensor gives it"):
        sensed(parse(text), PRESETS["typical"])


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"preset": "good"}, "sensors.preset: 'good' is none of perfect, typical, poor"),
        ({"gps_rate": 5.0}, "sensors.gps_rate: unknown field; near: gps_rate_hz"),
        ({"gyro_lag_s": -1.0}, "sensors.gyro_lag_s: must be a number from 0"),
        ({"preset": "typical", "gps_latency_s": 0.3}, "longer than the 0.2 s between two measurements"),
    ],
)
def test_a_wrong_table_is_one_line(table: dict[str, float | str], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        sensors_of(table)


def test_sensors_have_a_label() -> None:
    assert label({}) == label({"preset": "perfect"}) == ""
    assert label({"preset": "poor"}) == "@poor"
    assert label({"preset": "poor", "gyro_lag_s": 0.1}) == "@sensors"


def flown(name: str, seed: int) -> float:
    fleet = JsbsimFleet([load(name)])
    zero = np.zeros(1)
    fleet.reset(State(zero, zero, zero, zero), np.random.default_rng(seed), speed=18.0)
    for _ in range(20):
        fleet.step(Command(np.array([18.0]), np.array([0.1]), zero), np.zeros((1, 3)), 10)
    return float(fleet.state().y[0])


def test_noise_is_of_the_seed() -> None:
    first = flown("x8@typical", 1)
    assert flown("x8@typical", 1) == first
    assert flown("x8@typical", 2) != first
    assert flown("x8", 1) == flown("x8", 2)


def test_a_command_arrives_late() -> None:
    fdm = Fdm(load("x8@typical"), 0.005, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, 18.0))
    fdm.command(18.0, 0.2, 0.0)
    heard = fdm.node("ap/sent-omega-radps-3")
    late = 0
    while heard.get_double_value() == 0.0 and late < 100:
        fdm.run((0.0, 0.0, 0.0), 1)
        late += 1
    # 60 ms on the way, and up to 50 ms until it is sent
    assert 0.055 <= late * 0.005 <= 0.115


def test_the_estimated_course_lags_in_a_turn_by_what_gps_is_older_than_known() -> None:
    fdm = Fdm(load("x8@typical"), 0.005, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, 18.0))
    fdm.seed(3)
    fdm.command(18.0, 0.2, 0.0)
    off = []
    for _ in range(4000):
        fdm.run((0.0, 0.0, 0.0), 1)
        e, n = fdm.read("velocities/v-east-fps"), fdm.read("velocities/v-north-fps")
        se, sn = fdm.read("ap/seen-east-fps"), fdm.read("ap/seen-north-fps")
        off.append(math.asin((e * sn - n * se) / math.hypot(e, n) / math.hypot(se, sn)))
    # 50 ms of a turn of 0.19 rad/s; the noise leaves 0.001 rad of a mean over 10 s
    assert np.mean(off[2000:]) == pytest.approx(-0.05 * 0.19, abs=0.003)


def step(name: str, command: tuple[float, float, float], duration: float) -> Score:
    f = fly(load(name), 18.0, command, duration, telemetry=["roll_rad"])
    if command[1]:
        # The bank: without feedback of the course rate these autopilots leave it some percent short.
        return score(f.t, -f.telemetry["roll_rad"], 0.0, math.atan(18.0 * command[1] / 9.80665))
    y, before, after = (f.v, 18.0, command[0]) if command[0] != 18.0 else (f.zeta, 0.0, command[2])
    return score(f.t, y, before, after)


# t63 of these loops on the X8's drag and thrust, computed apart from this code (a point mass in pitch)
@pytest.mark.parametrize(
    ("name", "command", "expected"),
    [
        ("x8@arduplane", (18.0, TURN, 0.0), 0.38),
        ("x8@arduplane", (20.0, 0.0, 0.0), 1.7),
        ("x8@arduplane", (18.0, 0.0, 2.0), 3.0),
        ("x8@px4", (18.0, TURN, 0.0), 0.57),
        ("x8@px4", (20.0, 0.0, 0.0), 3.4),
        ("x8@px4", (18.0, 0.0, 2.0), 0.7),
    ],
)
def test_steps_take_as_long_as_expected(
    name: str, command: tuple[float, float, float], expected: float
) -> None:
    assert step(name, command, 3.0 if command[1] else 12.0).t63 == pytest.approx(expected, rel=0.3)


@pytest.mark.parametrize(
    ("name", "command", "limit"),
    [
        ("x8@arduplane", (18.0, 0.6, 0.0), "limited_omega"),  # 35 deg of bank: 22 deg/s
        ("x8@px4", (18.0, 0.8, 0.0), "limited_omega"),  # 50 deg: 37 deg/s
        ("x8@arduplane", (10.0, 0.0, 0.0), "limited_v"),  # below AIRSPEED_MIN
        ("x8@px4", (31.0, 0.0, 0.0), "limited_v"),  # above FW_AIRSPD_MAX
        ("x8@arduplane", (18.0, 0.0, 4.0), "limited_zeta"),  # TECS_CLMB_MAX is 3
        ("x8@px4", (18.0, 0.0, -6.0), "limited_zeta"),  # FW_T_SINK_MAX is 5
    ],
)
def test_limits_are_reported(name: str, command: tuple[float, float, float], limit: str) -> None:
    f = fly(
        load(name), 18.0, command, 1.5, telemetry=["limited_v", "limited_omega", "limited_zeta", "roll_rad"]
    )
    assert f.telemetry[limit][-1] == 1.0
    most = math.radians(35.0 if "arduplane" in name else 50.0)
    assert np.abs(f.telemetry["roll_rad"]).max() < 1.1 * most


def test_a_scenario_says_what_the_autopilots_sense_and_the_run_is_verified(
    tmp_path: Path, call: Callable[..., int]
) -> None:
    out = tmp_path / "run"
    flags = ["--set", "sensors=typical", "--set", 'airframes=["x8@px4", "x8"]', "--set", "duration_s=1"]
    call("run", "paper-2-turn", "--plant", "jsbsim", *flags, "--out", str(out))
    named = json.loads((out / "manifest.json").read_text())["airframes"]
    assert named.keys() == {"x8@px4@typical", "x8@typical"}
    assert call("verify", str(out)) == 0
    run = recorded.read(out)
    renamed = {"x8@px4": named["x8@px4@typical"], "x8": named["x8@typical"]}
    forged = replace(run, manifest=run.manifest | {"airframes": renamed})
    assert {f.what for f in wording(forged) if not f.agrees} == {"manifest"}


def test_a_scenario_without_sensors_says_nothing_of_them() -> None:
    s = testbed.load_scenario("paper-2-turn")
    assert "sensors" not in s.model_dump(mode="json")
    assert ladders.autopilot_rungs(s)[2].fields == (("airframes", ["x8@arduplane"]),)


def test_the_guides_table_of_autopilots_follows_from_every_run_flown() -> None:
    guide = Path(__file__).parent.parent / "docs" / "guide"
    kept = pd.read_csv(guide / "data" / "autopilots" / "ladder" / "rungs.csv")
    assert ladders.markdown(kept) in (guide / "autopilots.md").read_text()
    runs = pd.read_csv(guide / "data" / "autopilots" / "ladder" / "runs.csv")
    made = ladders.summary(runs, ladders.autopilot_rungs(testbed.load_scenario("paper-2-turn")))
    pd.testing.assert_frame_equal(made[["rung", "lost", "distance_m"]], kept[["rung", "lost", "distance_m"]])


@pytest.mark.parametrize("name", ["answer-2", "answer-20", "ahead-2"])
def test_the_guides_tables_of_remedies_under_autopilots_follow_from_every_run_flown(name: str) -> None:
    guide = Path(__file__).parent.parent / "docs" / "guide"
    folder = guide / "data" / "autopilots" / name
    made = answers.table(pd.read_csv(folder / "runs.csv"))
    pd.testing.assert_frame_equal(made, pd.read_csv(folder / "answer.csv"))
    assert answers.markdown(made) in (guide / "autopilots.md").read_text()
    if name == "ahead-2":
        x8s = made[made.vehicle.str.startswith("x8")]
        assert (x8s.lost.sum(), x8s.runs.sum(), round(x8s.least_distance_m.min(), 2)) == (0, 80, 5.32)
        assert (made.lost.sum(), made.runs.sum()) == (21, 160)
        for page in (guide / "answer.md", guide.parent.parent / "README.md"):
            words = " ".join(page.read_text().split())
            assert "0 of 80" in words and "least distance 5.32 m" in words and "21 of 80" in words


@pytest.mark.parametrize("name", ["x8@arduplane", "x8@px4", "x8@typical", "rascal@arduplane", "rascal@px4"])
def test_identified_lags_are_of_the_files_as_they_are(name: str) -> None:
    airframe = load(name)
    assert airframe.identified is not None
    assert airframe.identified.fingerprint == identified_fingerprint(airframe)


@pytest.mark.parametrize(
    ("name", "loop"),
    [
        ("x8@px4", "elevator"),
        ("x8@px4", "aileron"),
        ("x8@arduplane", "elevator"),
        ("x8@arduplane", "aileron"),
        ("x8@arduplane", "throttle"),
        ("rascal@arduplane", "elevator"),
    ],
)
def test_loops_agree_with_the_linear_model(name: str, loop: str) -> None:
    """ArduPlane's elevator and throttle go through channels at 10 Hz and a loop of height."""
    airframe = load(name)
    linear = linear_model(airframe, 18.0)
    measured = response(airframe, 18.0, loop, waits=waits_of(linear, 10 if loop == "throttle" else 4))
    # Below, the record of 30 s is too short.
    band = (
        (measured.frequency > 0.5) & (measured.frequency < 60.0) & (np.abs(measured.loop) > 10 ** (-30 / 20))
    )
    model = model_response(linear, loop, measured.frequency[band]).loop
    ratio = measured.loop[band] / model
    # largest 0.59 dB, 3.0 deg
    assert np.abs(20 * np.log10(np.abs(ratio))).max() < 1.0
    assert np.abs(np.degrees(np.angle(ratio))).max() < 5.0
