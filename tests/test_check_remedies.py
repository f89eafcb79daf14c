"""`aircraft check`: each remedy, done as it is written, makes its finding go; sound models are clean."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from xml.parsers import expat

import jsbsim
import pytest

from aircraft.airframe import copy, load
from aircraft.airframes.files import Finding
from aircraft.autopilots.freshness import stale_feedforward, stale_lags
from aircraft.check.check import check
from aircraft.check.spelling import ENGINE, MODEL
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin

X8, RASCAL, SYSTEM, TOML = "x8.xml", "rascal.xml", "systems/autopilot.xml", "airframe.toml"
Call = Callable[..., int]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return copy("x8", tmp_path / "mine")


def plant(folder: Path, file: str, old: str, new: str) -> int:
    """Replace `old`, which must occur, once; returns the line it begins on."""
    text = (folder / file).read_text()
    assert old in text, f"{old} is not in {file}"
    (folder / file).write_text(text.replace(old, new, 1))
    return text[: text.index(old)].count("\n") + 1


LIGHT = """<flight_control name="elevons">
<channel name="light"><switch name="fcs/light"><default value="0"/><test logic="AND" value="1">
simulation/sim-time-sec gt 1.0
position/h-agl-ft gt 3.0
</test></switch>
<fcs_function name="fcs/clock"><function><sum><property>simulation/sim-time-sec</property>
<p>simulation/dt</p></sum></function></fcs_function></channel>"""
# Sound models: file, old, new.
SOUND = {
    "the time in a condition": (X8, '<flight_control name="elevons">', LIGHT),
    "a thruster that is turned": (
        X8,
        '<thruster file="direct">',
        '<thruster file="direct"><orient unit="DEG"><roll>0</roll><pitch>2</pitch><yaw>0</yaw></orient>',
    ),
}


@pytest.mark.parametrize("what", SOUND)
def test_a_sound_model_is_clean(folder: Path, what: str) -> None:
    plant(folder, *SOUND[what])
    assert [str(f) for f in check(folder)] == []


def stock_words() -> dict[str, set[str]]:
    """Every element of JSBSim's own aircraft, systems and engines, by the list it should be in."""
    root = Path(jsbsim.__file__).parent
    words: dict[str, set[str]] = {"model": set(), "engine": set()}
    for file in root.rglob("*.xml"):
        names: list[str] = []
        parser = expat.ParserCreate()
        parser.StartElementHandler = lambda name, _, names=names: names.append(name)
        parser.Parse(file.read_bytes(), True)
        # Scripts and initial conditions are no models; old files in capitals are read no more.
        if names[0] in ("fdm_config", "system", "autopilot", "flight_control"):
            words["model"] |= set(names)
        elif re.fullmatch(r"\w+_(engine|motor)|propeller|nozzle|rotor|direct", names[0]):
            words["engine"] |= set(names)
    return words


def test_every_word_of_jsbsims_own_aircraft_is_known() -> None:
    words = stock_words()
    assert len(words["model"]) > 150 and len(words["engine"]) > 100
    assert words["model"] <= MODEL, sorted(words["model"] - MODEL)
    assert words["engine"] <= ENGINE, sorted(words["engine"] - ENGINE)


def test_a_model_too_heavy_to_fly_has_no_level_flight(folder: Path) -> None:
    plant(folder, X8, '<emptywt unit="KG"> 3.364', '<emptywt unit="KG"> 40')
    plant(folder, TOML, "mass_kg = 3.364", "mass_kg = 40.0")
    line = (folder / TOML).read_text().splitlines().index("trim_mps = [15.0, 18.0, 20.0, 22.0, 25.0]") + 1
    found = [f for f in check(folder) if f.rule == "trim"]
    assert {f.line for f in found} <= {line, line - 1, line - 2, line - 3} and len(found) == 5
    assert all("no level flight at" in f.message for f in found)
    assert not any("process" in f.message for f in check(folder))


def test_a_model_without_an_autopilot_line_has_one_finding(folder: Path) -> None:
    plant(folder, X8, '<system file="autopilot"/>', "")
    (found,) = check(folder)
    assert found.file == X8 and found.line and 'add <system file="autopilot"/>' in found.remedy


def test_a_surface_that_is_not_there_is_found_in_airframe_toml(tmp_path: Path) -> None:
    mine = copy("rascal", tmp_path / "mine")
    line = plant(mine, TOML, '"fcs/aileron-pos-rad"', '"fcs/aileron-left-rad"')
    (found,) = check(mine)
    assert (found.file, found.line) == (TOML, line) and "surfaces.aileron_rad" in found.message
    with pytest.raises(FdmError, match=r"airframe\.toml: surfaces\.aileron_rad: .*fcs/aileron-left-rad"):
        Fdm(load(mine), 0.005, Origin())


@pytest.mark.parametrize(
    ("old", "new"),
    [('wingarea unit="M2"', 'wingarea unit="M3"'), ('<wingspan unit="M"> 2.1', '<wingspan unit="M"> 2.1m')],
)
def test_what_jsbsim_does_not_load_has_the_line_of_what_it_names(folder: Path, old: str, new: str) -> None:
    line = plant(folder, X8, old, new)
    (found,) = check(folder)
    assert (found.rule, found.file, found.line) == ("load", X8, line), str(found)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<emptywt unit="KG"> 3.364', '<emptywt unit="KG"> -3', "<emptywt> is -3"),
        ('<emptywt unit="KG"> 3.364', '<emptywt unit="KG"> 0', "<emptywt> is 0"),
        ('<wingarea unit="M2"> 0.75', '<wingarea unit="M2"> 0', "<wingarea> is 0"),
        ('<wingspan unit="M"> 2.1', '<wingspan unit="M"> -2.1', "<wingspan> is -2.1"),
        (
            '<system file="autopilot"/>',
            '<system file="autopilot"/> <system file="autopilot.xml"/>',
            "already loaded",
        ),
    ],
)
def test_a_size_that_no_aircraft_has_is_one_finding_at_its_line(
    folder: Path, old: str, new: str, message: str
) -> None:
    line = plant(folder, X8, old, new)
    (found,) = check(folder)
    assert (found.file, found.line) == (X8, line) and message in found.message


@pytest.mark.parametrize("wrong", ["simulation/nothing gt 1", "position/h-agl-ft ge sim-time-sec"])
def test_a_property_missing_from_a_condition_is_found_at_its_switch(folder: Path, wrong: str) -> None:
    line = plant(
        folder, X8, '<flight_control name="elevons">', LIGHT.replace("position/h-agl-ft gt 3.0", wrong)
    )
    (found,) = check(folder)
    assert (found.rule, found.file, found.line) == ("property", X8, line + 1)


@pytest.mark.parametrize(
    ("path", "said", "remedy"),
    [
        (
            "fcs/throttle-pos-norm",
            "no angle in rad, by its last word norm",
            "name the property of its position",
        ),
        ("velocities/vc-kts", "no surface: JSBSim keeps the state", "name the property of its position"),
        ("attitude/phi-rad", "no surface: JSBSim keeps the state", "leave it out"),
        (
            "fcs/elevon-left-pos-deg",
            "no angle in rad, by its last word deg",
            'write "fcs/elevon-left-pos-rad"',
        ),
    ],
)
def test_a_surface_that_is_no_angle_is_found(folder: Path, path: str, said: str, remedy: str) -> None:
    if path == "fcs/elevon-left-pos-deg":  # its own gain makes degrees of it
        gain = '<pure_gain name="fcs/elevon-left-pos-deg"> <input>fcs/elevon-left-pos-rad</input>'
        gain += "<gain>57.3</gain> </pure_gain>"
        plant(
            folder,
            X8,
            '<flight_control name="elevons">',
            f'<flight_control name="elevons"><channel name="d">{gain}</channel>',
        )
    line = plant(folder, TOML, '"fcs/elevon-left-pos-rad"', f'"{path}"')
    (found,) = [f for f in check(folder) if f.rule == "surface"]
    assert (found.file, found.line) == (TOML, line), str(found)
    assert f"surfaces.elevon_left_rad: {path} is {said}" in found.message and remedy in found.remedy


def test_a_surface_that_stands_under_two_names_is_found(folder: Path) -> None:
    line = plant(folder, TOML, '"fcs/elevon-right-pos-rad"', '"fcs/elevon-left-pos-rad"')
    (found,) = check(folder)
    assert (found.file, found.line) == (TOML, line) and "surfaces.elevon_left_rad" in found.message


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<emptywt unit="KG"> 3.364', '<emptywt unit="KG"> -3', "its mass is -"),
        ('<wingarea unit="M2"> 0.75', '<wingarea unit="M2"> 0', "its <wingarea> is 0"),
    ],
)
def test_a_model_without_mass_or_wing_is_refused_when_it_is_loaded(
    folder: Path, old: str, new: str, message: str
) -> None:
    plant(folder, X8, old, new)
    with pytest.raises(FdmError, match=message):
        Fdm(load(folder), 0.005, Origin())


@pytest.mark.parametrize("path", ["fcs/elevon left", "", "fcs//left", "fcs/left[x]"])
def test_a_surface_at_which_jsbsim_would_abort_is_refused(folder: Path, path: str) -> None:
    plant(folder, TOML, '"fcs/elevon-left-pos-rad"', f'"{path}"')
    with pytest.raises(ValueError, match=r"surfaces\.elevon_left_rad: .* cannot name a property"):
        load(folder)


def test_numbers_without_a_fingerprint_are_stale_and_name_what_remakes_them(folder: Path) -> None:
    text = (folder / TOML).read_text()
    (folder / TOML).write_text(re.sub(r"^(fingerprint|command) = .*\n", "", text, flags=re.M))
    mine = load(folder)
    for stale, remedy in ((stale_feedforward(mine), "trim"), (stale_lags(mine), "identify")):
        assert stale is not None and "does not say from which model and gains" in stale
        assert f"testbed aircraft {remedy} " in stale


def test_a_tilde_is_the_home_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scenario file is read by no shell, which would have replaced it."""
    monkeypatch.setenv("HOME", str(folder.parent))
    assert load("~/mine").folder == folder.resolve()


def test_a_key_is_found_in_its_own_table(folder: Path) -> None:
    """model_lag_s stands in three tables; the finding is at the one it is about."""
    text = (folder / TOML).read_text()
    at = text.index("model_lag_s", text.index("[gains.speed]"))
    (folder / TOML).write_text(text[:at] + text[at:].replace("model_lag_s = 0.03", "model_lag_s = -0.03", 1))
    found = next(f for f in check(folder) if f.rule == "gains")
    assert found.line == text[:at].count("\n") + 1 and "speed.model_lag_s" in found.message


def act(folder: Path, finding: Finding, call: Call) -> None:
    """Do what a remedy says."""
    file, remedy = folder / finding.file, finding.remedy
    lines = file.read_text().splitlines()
    at = (finding.line or 1) - 1
    if m := re.fullmatch(r"run: testbed (.*)", remedy):
        assert call(*shlex.split(m[1])) == 0
        return
    if m := re.fullmatch(r"write <(\w+)>", remedy):
        wrong = re.match(r"<(\w+)>", finding.message)
        assert wrong
        file.write_text(re.sub(rf"(</?){wrong[1]}\b", rf"\1{m[1]}", file.read_text()))
        return
    if m := re.fullmatch(r"did you mean (\S+)\?", remedy):
        wrong = re.search(r"no property (\S+)", finding.message)
        assert wrong and wrong[1] in lines[at]
        lines[at] = lines[at].replace(wrong[1], m[1])
    elif m := re.fullmatch(r"rename it to (\w+)", remedy):
        lines[at] = re.sub(r"^\w+", m[1], lines[at])
    elif m := re.fullmatch(r"write (\S+)", remedy):
        lines[at] = re.sub(r"= \S+", f"= {m[1]}", lines[at])
    elif m := re.fullmatch(r"add (<.*>) to <fdm_config>", remedy):
        lines.insert(at, m[1])
    elif m := re.fullmatch(r"add (negated_\S+) to <mass_balance> if it is the integral of x z dm", remedy):
        lines[at] = lines[at].replace("<mass_balance", f"<mass_balance {m[1]}")
    elif remedy == "remove it":
        del lines[at]
    else:
        raise AssertionError(f"nobody knows how to do: {finding}")
    file.write_text("\n".join([*lines, ""]))


# What is wrong: airframe, file, old, new.
WRONG = {
    "no autopilot line": ("x8", X8, '<system file="autopilot"/>', ""),
    "misspelt element": (
        "x8",
        X8,
        '<wingspan unit="M"> 2.1 </wingspan>',
        '<wingspann unit="M"> 2.1 </wingspann>',
    ),
    "property typo": ("x8", SYSTEM, "<p>attitude/phi-rad", "<p>attitude/phy-rad"),
    "surface": ("rascal", TOML, '"fcs/aileron-pos-rad"', '"fcs/aileron-left-rad"'),
    "misspelt gain": ("x8", TOML, "damping = 1.145", "dampin = 1.145"),
    "negative gain": ("x8", TOML, "damping = 1.145", "damping = -1.145"),
    "unknown gain": ("x8", TOML, "damping = 1.145", "damping = 1.145\nyaw_rate_gain = 2.0"),
    "sign not stated": ("x8", X8, ' negated_crossproduct_inertia="false"', ""),
    "output": ("x8", X8, "  <propulsion>", '  <output name="a.csv" type="CSV"/>\n  <propulsion>'),
    "renamed state": ("x8", SYSTEM, "ap/limited-zeta", "ap/limited-climb"),
    "stale lags and autopilot": ("x8", TOML, "bandwidth_radps = 9.5", "bandwidth_radps = 9.0"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", WRONG)
def test_each_remedy_works(tmp_path: Path, call: Call, what: str) -> None:
    airframe, file, old, new = WRONG[what]
    mine = copy(airframe, tmp_path / "mine")
    plant(mine, file, old, new)
    assert check(mine)
    for _ in range(4):  # one finding may hide another
        found = check(mine)
        if not found:
            return
        for finding in found:
            assert finding.file and finding.line and finding.remedy, str(finding)
        act(mine, found[0], call)
    raise AssertionError([str(f) for f in check(mine)])
