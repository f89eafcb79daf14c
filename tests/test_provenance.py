"""Derived numbers carry the fingerprint of what they were made from; stale ones are refused."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import testbed
from aircraft.airframe import copy, load
from aircraft.airframes.editing import replace_tables, set_values
from aircraft.airframes.provenance import fitted_fingerprint, identified_fingerprint
from aircraft.airframes.schema import AIRFRAMES, names
from aircraft.autopilots import gains, remaking
from aircraft.autopilots.freshness import stale_feedforward, stale_lags
from aircraft.check.check import check
from testbed.components import catalogue
from testbed.regression.recording import record
from testbed.scenario.scenario import load as load_scenario

Call = Callable[..., int]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return copy("x8", tmp_path / "mine")


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text, f"{old} is not in {file}"
    file.write_text(text.replace(old, new))


@pytest.mark.parametrize("name", names())
def test_our_own_derived_numbers_are_fresh(name: str) -> None:
    airframe = load(name)
    assert airframe.fitted is not None and airframe.identified is not None
    assert stale_lags(airframe) is None and stale_feedforward(airframe) is None


# What does not change how the aircraft flies: file, old, new.
HARMLESS = {
    "a comment in the model": ("x8.xml", "<metrics>", "<!-- looked at -->\n   <metrics>"),
    "layout": ("x8.xml", "</metrics>", "\n\n      </metrics>"),
    "a number written otherwise": ("x8.xml", '"KG*M2"> 0.335 <', '"KG*M2">0.3350<'),
    "the title": ("airframe.toml", "Skywalker X8 flying wing", "My wing"),
    "a comment": ("airframe.toml", "windmill_throttle = 0.1", "windmill_throttle = 0.10 # kept"),
    "a stated number": ("airframe.toml", "span_m = 2.1", "span_m = 2.10"),
    "a default that airframe.toml overwrites": (
        "systems/autopilot.xml",
        '<property value="9.5"> ap/turn-bandwidth-radps',
        '<property value="4.5"> ap/turn-bandwidth-radps',
    ),
    "the lags themselves": ("airframe.toml", "delay_s = 0.083", "delay_s = 0.084"),
}


# What flies as before, though the model is another text.
HARMLESS |= {
    "a light": (
        "x8.xml",
        '<flight_control name="elevons">',
        '<flight_control name="elevons"><channel name="light"><switch name="fcs/light"><default value="0"/>'
        '<test value="1"> simulation/sim-time-sec gt 1 </test></switch></channel>',
    ),
    "a tilted thruster of a microwatt": (
        "x8.xml",
        '<thruster file="direct">',
        '<thruster file="direct"><orient unit="DEG"><roll>0</roll><pitch>2</pitch><yaw>0</yaw></orient>',
    ),
}


@pytest.mark.parametrize("change", HARMLESS)
def test_a_fingerprint_ignores_what_does_not_fly(folder: Path, change: str) -> None:
    file, old, new = HARMLESS[change]
    edit(folder / file, old, new)
    assert stale_lags(load(folder)) is None and stale_feedforward(load(folder)) is None


# What does: file, old, new, whether the lags are stale, whether the feed-forward is.
STALE = {
    # level trims do not feel it, so the fit is as good as before
    "inertia": ("x8.xml", '"KG*M2"> 0.335 <', '"KG*M2"> 0.325 <', True, False),
    "lift": ("x8.xml", "4.020328", "4.120328", True, True),
    "a loop's gain": ("airframe.toml", "bandwidth_radps = 9.5", "bandwidth_radps = 4.5", True, False),
    "the fit's gain": ("airframe.toml", "motor_speed_mps = 45.0", "motor_speed_mps = 44.0", True, True),
    "a fitted gain by hand": ("airframe.toml", "cl_0 = 0.114165", "cl_0 = 0.13", True, True),
    "slower speeds": ("airframe.toml", "v_min_mps = 15.0", "v_min_mps = 16.0", True, False),
    "an equation": (
        "systems/autopilot.xml",
        "<product><v>0.3048</v><p>velocities/h-dot-fps</p></product>",
        "<product><v>0.3</v><p>velocities/h-dot-fps</p></product>",
        True,
        False,
    ),
    "lags without a fingerprint": ("airframe.toml", None, None, True, False),
}


@pytest.mark.parametrize("change", STALE)
def test_a_stale_number_is_found_and_names_its_remedy(folder: Path, change: str) -> None:
    file, old, new, lags, feedforward = STALE[change]
    if old is None:
        fingerprint = load(folder).identified.fingerprint
        old, new = f'fingerprint = "{fingerprint}"\n', ""
    edit(folder / file, old, new)
    airframe = load(folder)
    for why, wanted, verb in (
        (stale_lags(airframe), lags, "identify"),
        (stale_feedforward(airframe), feedforward, "trim"),
    ):
        assert (why is not None) == wanted
        assert why is None or why.endswith(f"run: testbed aircraft {verb} {folder}")


def test_check_flags_lags_of_other_gains(folder: Path) -> None:
    edit(folder / "airframe.toml", "bandwidth_radps = 9.5", "bandwidth_radps = 4.5")
    remaking.remade_autopilot(load(folder)).write()
    (found,) = check(folder)
    line = (folder / "airframe.toml").read_text().splitlines().index("[identified]") + 1
    assert (found.rule, found.file, found.line) == ("stale", "airframe.toml", line)
    assert found.remedy == f"run: testbed aircraft identify {folder}"


@pytest.mark.parametrize("use", [["plant=lagged"], ["plant=jsbsim", "remedy.predict_lags=true"]])
def test_a_run_refuses_stale_lags(folder: Path, use: list[str]) -> None:
    edit(folder / "airframe.toml", "bandwidth_radps = 9.5", "bandwidth_radps = 4.5")
    scenario = load_scenario("paper-2-turn", [*use, "duration_s=0.1", f'airframes=["{folder}"]'])
    with pytest.raises(testbed.UserError, match=f"testbed aircraft identify {folder}"):
        testbed.run(scenario)


def test_a_gains_file_makes_lags_stale_and_may_carry_its_own(tmp_path: Path) -> None:
    file = tmp_path / "slow.toml"
    gains.write(file, "x8", {"turn.bandwidth_radps": 4.5}, {"command": "by hand"})
    s = load_scenario("paper-2-turn", ["plant=lagged", f'airframes=["{file}"]'])
    with pytest.raises(testbed.UserError, match=f"testbed aircraft identify {file}"):
        catalogue.lags(s)
    fresh = identified_fingerprint(load(file))
    lags = (
        (AIRFRAMES / "x8" / "airframe.toml").read_text().partition("[identified]")[2].partition("# What")[0]
    )
    file.write_text(
        file.read_text() + "\n[identified]" + re.sub('"[0-9a-f]{8}-[0-9a-f]{8}"', f'"{fresh}"', lags)
    )
    (found,) = catalogue.lags(s)[:1]
    assert found[1].time_constant_s == load("x8").identified.omega.time_constant_s


def test_a_baseline_refuses_stale_numbers(folder: Path, tmp_path: Path) -> None:
    settings = ["duration_s=0.1", f'airframes=["{folder}"]']
    edit(folder / "airframe.toml", "bandwidth_radps = 9.5", "bandwidth_radps = 4.5")
    with pytest.raises(testbed.UserError, match=f"testbed aircraft identify {folder}"):
        record(tmp_path, "mine", source="paper-2-turn", overrides=settings)
    edit(folder / "airframe.toml", "cl_0 = 0.114165", "cl_0 = 0.13")
    with pytest.raises(testbed.UserError, match=f"testbed aircraft trim {folder}"):
        record(tmp_path, "mine", source="paper-2-turn", overrides=settings)


@pytest.mark.slow
def test_the_commands_remake_what_is_stale(
    folder: Path, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    """The remedies work: a heavier X8 is clean after the three commands; once more, nothing changes."""
    edit(folder / "x8.xml", "3.364", "3.864")
    edit(folder / "airframe.toml", "mass_kg = 3.364", "mass_kg = 3.864")
    before = (folder / "airframe.toml").read_text()
    assert {f.rule for f in check(folder)} == {"stale", "autopilot"}
    assert call("aircraft", "trim", folder, "--dry-run") == 0
    assert "cl_alpha = " in capsys.readouterr().out and (folder / "airframe.toml").read_text() == before
    for command in ("trim", "autopilot", "identify"):
        assert call("aircraft", command, folder) == 0
    assert [str(f) for f in check(folder)] == []
    after = (folder / "airframe.toml").read_text()
    # Comments stay, and so does everything that was not remade.
    assert after.count("#") == before.count("#") and "# (CL_q + CL_de d(de)/d(q)) c / 2" in after
    assert [line for line in before.splitlines() if line.startswith("jx_")] == [
        line for line in after.splitlines() if line.startswith("jx_")
    ]
    assert call("aircraft", "trim", folder) == 0
    assert (folder / "airframe.toml").read_text() == after


@pytest.mark.parametrize("name", names())
def test_remaking_ours_gives_the_same_numbers(name: str) -> None:
    assert not remaking.remade_feedforward(load(name)).changed
    assert not remaking.remade_autopilot(load(name)).changed


def test_a_gains_file_has_no_model_to_fit(
    tmp_path: Path, call: Call, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in ("trim", "autopilot"):
        assert call("aircraft", command, tmp_path / "some.toml") == 2
        assert "give an airframe or its folder" in capsys.readouterr().err


def test_the_fingerprints_differ_from_each_other(folder: Path) -> None:
    airframe = load(folder)
    before = fitted_fingerprint(airframe), identified_fingerprint(airframe)
    assert before[0] != before[1]
    shutil.move(folder, folder.with_name("elsewhere"))
    moved = load(folder.with_name("elsewhere"))
    assert (fitted_fingerprint(moved), identified_fingerprint(moved)) == before


TOML = "a = 1\n\n[one]\nb = 2 # two\nc = 3\n\n# of two\n[two]\nd = 4\n\n[two.more]\ne = 5\n\n[three]\nf = 6\n"


def test_values_are_set_in_their_table_and_keep_their_comments() -> None:
    assert set_values(TOML, "one", {"b": "7"}) == TOML.replace("b = 2", "b = 7")
    assert set_values(TOML, "one", {"d": "7"}) == TOML.replace("c = 3\n", "c = 3\nd = 7\n")
    assert set_values(TOML, "three", {"g": "7"}) == TOML + "g = 7\n"
    with pytest.raises(ValueError, match=r"\[four\]"):
        set_values(TOML, "four", {})


def test_tables_are_replaced_in_their_place() -> None:
    made = replace_tables(TOML, "two", "[two]\nd = 8\n")
    assert made == TOML.replace("d = 4\n\n[two.more]\ne = 5\n", "d = 8\n")
    assert replace_tables(TOML, "four", "[four]\n") == TOML + "\n[four]\n"
