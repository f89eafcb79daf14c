"""Autopilots as equations: the language, an autopilot of the user's own, airframe x autopilot by name."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aircraft.airframe import copy, load
from aircraft.airframes.naming import split
from aircraft.autopilots.parameter_files import read_parameters
from aircraft.autopilots.tuning import fly
from aircraft.equations.catalogue import equations_of
from aircraft.equations.compiler import system_xml
from aircraft.equations.language import parse
from aircraft.jsbsim.errors import FdmError

PID = Path(__file__).parent.parent / "docs" / "guide" / "examples" / "pid.eq"


@pytest.fixture
def wing(tmp_path: Path) -> Path:
    folder = copy("x8", tmp_path / "wing")
    shutil.copy(PID, folder)
    return folder


def test_indented_lines_continue_an_equation() -> None:
    found = parse("== c ==\na = 1\n  + 2\nb = a\n")
    assert [(e.name, e.formula, e.line) for e in found.channels[0].equations] == [
        ("a", "1 + 2", 2),
        ("b", "a", 4),
    ]


def test_a_parameter_says_default_unit_range_and_meaning() -> None:
    p = parse("parameter RLL_P = 0.5 [1/s] 0.1 to 2: roll per error").parameters["RLL_P"]
    assert (p.default, p.unit, p.low, p.high, p.meaning) == (0.5, "1/s", 0.1, 2.0, "roll per error")


@pytest.mark.parametrize(("dt", "every"), [(0.005, 4), (0.01, 2), (0.002, 10)])
def test_a_rate_in_hz_is_kept_at_any_period_of_jsbsim(dt: float, every: int) -> None:
    text = system_xml(parse("input on = 0\n== c if on at 50 Hz ==\na = a + period"), {}, dt)
    assert f'execrate="{every}"' in text
    assert f"<product><v>{every}</v><p>simulation/dt</p></product>" in text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = 1", "line 1: a is before the first channel"),
        ("== c ==\na = __import__('os').system('true')", "line 2: an equation may not hold"),
        ("== c ==\na = x ** 2", "line 2: an equation may not hold"),
        ("== c ==\na = 1 +", "line 2: not a formula"),
        ("== c ==\na = clip(1, 2)", r"line 2: clip\(\) takes 3"),
        ("== c ==\na = 1 -> simulation/terminate", "line 2: simulation/terminate: an equation drives"),
        ("== c at 0 Hz ==", "line 1: a channel is evaluated at least"),
        ("\n\nlet a = 1", "line 3: not a use"),
    ],
)
def test_wrong_equations_are_one_line_that_names_the_place(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        parse(text)


def test_an_autopilot_of_the_users_own_flies_and_begins_without_a_jump(wing: Path) -> None:
    airframe = load(f"{wing}@pid.eq")
    assert (airframe.name, airframe.argument) == ("wing@pid", f"{wing}@pid.eq")
    level = fly(airframe, 18.0, (18.0, 0.0, 0.0), 3.0)
    # healthy 3e-6 m/s, without tracking 0.6 m/s
    assert np.abs(level.v - 18.0).max() < 1e-4 and np.abs(level.zeta).max() < 1e-3
    turn = fly(airframe, 18.0, (18.0, math.radians(10.0), 0.0), 6.0)
    assert turn.omega[-1] == pytest.approx(math.radians(10.0), rel=0.1)


def test_a_copy_has_the_autopilot_as_its_own_and_is_clean(wing: Path, tmp_path: Path) -> None:
    made = copy(f"{wing}@pid.eq", tmp_path / "mine", {"ROLL_P": 0.8})
    airframe = load(made)
    assert (airframe.name, airframe.autopilot, airframe.parameters["ROLL_P"]) == ("mine@pid", "pid.eq", 0.8)
    assert airframe.identified is None  # those were of the inverting autopilot
    assert 'value="0.8"> ap/ROLL-P' in (made / "systems" / "autopilot.xml").read_text()
    changed = airframe.with_gains({"ROLL_P": 0.5})
    assert changed.fingerprint() != airframe.fingerprint()
    with pytest.raises(KeyError, match=r"no gain ROLL_Q; near: ROLL_"):
        airframe.with_gains({"ROLL_Q": 1.0})


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("x8@fast", "there is no autopilot fast; there are .*inverting"),
        ("x8@none.eq", "none.eq does not exist"),
        ("x8@inverting@pid.eq", "name one autopilot"),
    ],
)
def test_an_autopilot_that_there_is_not_is_named(name: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        load(name)


def test_asking_for_its_own_autopilot_is_the_airframe_itself() -> None:
    assert load("x8@inverting") == load("x8")
    assert load("x8@inverting").fingerprint() == load("x8").fingerprint()


def test_a_name_is_split_at_the_first_at_of_its_last_part(tmp_path: Path) -> None:
    assert split("a@b/c@px4") == ("a@b/c", ("px4",))
    assert split("x8") == ("x8", ())
    (tmp_path / "d@e").mkdir()
    assert split(tmp_path / "d@e") == (str(tmp_path / "d@e"), ())


def test_a_property_that_jsbsim_has_not_is_named(wing: Path) -> None:
    text = (wing / "pid.eq").read_text().replace("attitude/phi-rad", "attitude/fi-rad")
    (wing / "typo.eq").write_text(text)
    with pytest.raises(FdmError, match="roll_rad of the autopilot: JSBSim has no property attitude/fi-rad"):
        fly(load(f"{wing}@typo.eq"), 18.0, (18.0, 0.0, 0.0), 0.1)


def test_a_run_names_airframe_and_autopilot(wing: Path, tmp_path: Path, call: Callable[..., int]) -> None:
    out = tmp_path / "run"
    wanted = f'airframes=["{wing}@pid.eq"]'
    flags = ["--set", wanted, "--set", "duration_s=0.5", "--out", str(out)]
    call("run", "paper-2-turn", "--plant", "jsbsim", *flags)
    assert '"wing@pid"' in (out / "manifest.json").read_text()
    assert call("verify", str(out)) == 0


def test_ardupilots_parameter_file_of_900_lines_is_read(tmp_path: Path, call: Callable[..., int]) -> None:
    rows = [f"OTHER{k}_VALUE,{k}" for k in range(880)]
    rows += ["# old names", "RLL2SRV_P 1.466", "RLL2SRV_I\t0.2125", "RLL2SRV_D,0.01246", "RLL2SRV_TCONST,0.3"]
    rows += [
        "LIM_ROLL_CD,3500",
        "TECS_CLMB_MAX,3",
        "TECS_TIME_CONS,4",
        *(f"SERVO{k}_TRIM 1500" for k in range(16)),
    ]
    file = tmp_path / "my.param"
    file.write_text("\n".join(rows))
    found = read_parameters(file, equations_of(load("x8@arduplane")).parameters)
    assert found.values["RLL_RATE_FF"] == pytest.approx(0.408, abs=1e-3)
    assert found.values["RLL_RATE_P"] == pytest.approx(0.0125, abs=1e-4)
    assert found.values["RLL_RATE_I"] == pytest.approx(0.064, abs=1e-3)
    assert found.values["ROLL_LIMIT_DEG"] == 35.0 and found.near == {"TECS_TIME_CONS": "TECS_TIME_CONST"}
    assert len(found.unused) == 896
    made = tmp_path / "mine"
    assert (
        call("aircraft", "copy", "x8", str(made), "--autopilot", "arduplane", "--param-file", str(file)) == 0
    )
    airframe = load(made)
    assert airframe.name == "mine@arduplane"
    assert airframe.parameters["TECS_CLMB_MAX"] == 3.0 and airframe.parameters["AIRSPEED_MAX"] == 22.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("TECS_CLMB_MAX", "line 1: not a parameter and its value"),
        ("A,1\nTECS_CLMB_MAX,fast", "line 2: TECS_CLMB_MAX: not a number: fast"),
        ("FW_R_TC,0.4", "none of its 1 parameters is one of this autopilot's"),
    ],
)
def test_a_wrong_parameter_file_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "my.param").write_text(text)
    with pytest.raises(ValueError, match=said):
        read_parameters(tmp_path / "my.param", equations_of(load("x8@arduplane")).parameters)


def test_qgroundcontrols_parameter_file_is_read(tmp_path: Path) -> None:
    file = tmp_path / "my.params"
    file.write_text(
        "# Onboard parameters for Vehicle 1\n1\t1\tFW_R_TC\t0.300000011920928955\t9\n1\t1\tSYS_ID\t4\t6\n"
    )
    found = read_parameters(file, equations_of(load("x8@px4")).parameters)
    assert found.values == {"FW_R_TC": pytest.approx(0.3)} and found.unused == ["SYS_ID"]


def test_a_run_that_predicts_poses_says_by_which_lags(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    flags = ["--set", "remedy.predict_lags=true", "--set", 'airframes=["x8@px4@typical", "x8"]']
    flags += ["--set", "duration_s=0.1", "--plant", "jsbsim", "--out", str(tmp_path / "run")]
    call("run", "paper-2-turn", *flags)
    said = " ".join(capsys.readouterr().out.split())
    for name in ("x8@px4@typical", "x8"):
        known = load(name).identified
        assert known is not None
        v = f"v {known.v.time_constant_s:.2f} + {known.v.delay_s:.2f} s"
        assert f"poses of {name} predicted by time constant + delay: {v}, omega" in said
    assert said.count("too slowly") == 1  # PX4's speed channel, not the inverting autopilot's
