"""`aircraft check`: every fault that circulates and every mistake of a person, planted in a copy of ours."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from aircraft.airframes.schema import AIRFRAMES, names
from aircraft.check.check import Finding, check

MODEL, SYSTEM, TOML = "x8.xml", "systems/autopilot.xml", "airframe.toml"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(AIRFRAMES / "x8", tmp_path / "x8"))


def plant(folder: Path, file: str, old: str, new: str) -> int:
    """Replace `old`, which must occur, once; returns the line it begins on."""
    text = (folder / file).read_text()
    assert old in text, f"{old} is not in {file}"
    (folder / file).write_text(text.replace(old, new, 1))
    return text[: text.index(old)].count("\n") + 1


def only(findings: list[Finding], rule: str) -> Finding:
    found = [f for f in findings if f.rule == rule]
    assert found, [str(f) for f in findings]
    assert all(f.remedy and f.message for f in findings)
    return found[0]


@pytest.mark.parametrize("name", names())
def test_our_own_airframes_are_clean(name: str) -> None:
    assert [str(f) for f in check(AIRFRAMES / name)] == []


def test_a_folder_that_does_not_exist_is_named() -> None:
    with pytest.raises(NotADirectoryError, match="nowhere"):
        check(Path("nowhere"))


YAW = """<product> <value> -0.00339 </value> <property> fcs/aileron-pos-rad </property> </product>"""
ELEVATOR = "<property> fcs/elevator-pos-rad </property>"
DRAG = f"<value> 0.0633474 </value> {ELEVATOR} {ELEVATOR}"
ACTUATOR = "<clipto> <min> -0.5235987755982988 </min> <max> 0.5235987755982988 </max> </clipto>"


def constant_thrust(text: str) -> str:
    """An "8 W" motor's: in proportion to the throttle, whatever the speed."""
    a = text.index('<function name="propulsion/propeller-force-lbs">')
    b = text.index("</function>", a)
    body = "<product><value> 4 </value><property> fcs/throttle-pos-norm </property></product>"
    return text[:a] + '<function name="propulsion/propeller-force-lbs">' + body + text[b:]


# The faults of X8 models in circulation: rule, severity, and how to plant them in a copy of ours.
CIRCULATING: dict[str, tuple[str, Callable[[str], str]]] = {
    "Cn_da copied from Cl_da": (
        "yaw-from-aileron",
        lambda t: t.replace(YAW, YAW.replace("-0.00339", "0.1201881")),
    ),
    "|de| for de^2": (
        "elevator-drag",
        lambda t: t.replace(
            DRAG, "<value> 0.0633474 </value> <abs> <property> fcs/elevator-pos-rad </property> </abs>"
        ),
    ),
    "signed de in the drag": (
        "elevator-drag",
        lambda t: t.replace(DRAG, "<value> 0.0633474 </value> <property> fcs/elevator-pos-rad </property>"),
    ),
    "no pitch-trim input": (
        "pitch-trim",
        lambda t: t.replace("fcs/pitch-trim-cmd-norm", "fcs/flap-cmd-norm"),
    ),
    "constant thrust": ("thrust", constant_thrust),
    "no stall": ("stall", lambda t: t.replace("0.267", "26.7")),
    "no elevon saturation": ("saturation", lambda t: t.replace(ACTUATOR, "")),
    "reversed Jxz sign": (
        "stated",
        lambda t: t.replace('negated_crossproduct_inertia="false"', 'negated_crossproduct_inertia="true"'),
    ),
    "reversed pitch control": ("sign", lambda t: t.replace("-0.2292", "0.2292")),
}


@pytest.mark.parametrize("fault", CIRCULATING)
def test_a_fault_that_circulates_is_caught(folder: Path, fault: str) -> None:
    rule, change = CIRCULATING[fault]
    text = (folder / MODEL).read_text()
    assert change(text) != text
    (folder / MODEL).write_text(change(text))
    found = only(check(folder), rule)
    assert found.file == MODEL and found.line


def test_a_reversed_jxz_is_called_reversed(folder: Path) -> None:
    plant(folder, MODEL, 'inertia="false"', 'inertia="true"')
    assert "reversed" in only(check(folder), "stated").remedy


def test_the_published_inertia_of_the_x8_is_that_of_no_body(folder: Path) -> None:
    for old, new in (("0.335", "1.229"), ("0.140", "0.1702"), ("0.400", "0.8808"), ("-0.029", "0.9343")):
        line = plant(folder, MODEL, f'"KG*M2"> {old} <', f'"KG*M2"> {new} <')
    found = only(check(folder), "inertia")
    assert found.severity == "error" and abs((found.line or 0) - line) < 6


# What a person can mistake: rule, file and (old, new) to plant; the finding names that line.
MISTAKES: dict[str, tuple[str, str, str, str]] = {
    "Jxz sign not stated": ("jxz-sign", MODEL, ' negated_crossproduct_inertia="false"', ""),
    "missing system": ("files", MODEL, '<system file="autopilot"/>', '<system file="autopilo"/>'),
    "missing engine file": ("files", MODEL, '<engine file="motor">', '<engine file="motr">'),
    "misspelt element": ("misspelt", MODEL, "<wingspan unit", "<wingspann unit"),
    "not well-formed": ("xml", MODEL, "</metrics>", "</metric>"),
    "output": ("output", MODEL, "  <propulsion>", '  <output name="a.csv" type="CSV"/>\n  <propulsion>'),
    "socket": ("output", MODEL, "  <propulsion>", '  <input port="5000"/>\n  <propulsion>'),
    "property typo in the aerodynamics": ("property", MODEL, "aero/alpha-rad", "aero/alfa-rad"),
    "property typo in the autopilot": ("property", SYSTEM, "<p>attitude/phi-rad", "<p>attitude/phy-rad"),
    "autopilot state renamed": ("autopilot", SYSTEM, "ap/limited-zeta", "ap/limited-climb"),
    "unknown unit": ("load", MODEL, 'wingarea unit="M2"', 'wingarea unit="M3"'),
    "duplicate name": ("duplicate", MODEL, '"fcs/elevon-right-cmd-rad"', '"fcs/elevon-left-cmd-rad"'),
    "a speed it cannot fly": ("trim", TOML, "trim_mps = [15.0", "trim_mps = [6.0"),
    "a gain that is no number": ("airframe.toml", TOML, "damping = 1.145", "damping = nan"),
    "a negative gain": ("gains", TOML, "damping = 1.145", "damping = -1.145"),
    "a missing gain": ("gains", TOML, "damping = 1.145\n", "\n"),
    "a misspelt gain": ("gains", TOML, "damping = 1.145", "dampin = 1.145"),
    "not TOML": ("airframe.toml", TOML, "[speeds]", "[speeds"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_found_with_its_file_and_line(folder: Path, mistake: str) -> None:
    rule, file, old, new = MISTAKES[mistake]
    line = plant(folder, file, old, new)
    text = (folder / file).read_text()
    if rule == "misspelt":
        (folder / file).write_text(text.replace("</wingspan>", "</wingspann>"))
    found = [f for f in check(folder) if f.rule == rule]
    assert found, [str(f) for f in check(folder)]
    assert file in {f.file for f in found}
    # a whole missing thing has the line it is missing from
    exact = rule not in ("autopilot", "trim", "gains", "pitch-trim", "load", "xml")
    if exact:
        assert any(f.line in (line, line + 1) for f in found), ([str(f) for f in found], line)


def test_no_engine_is_said_before_jsbsim_aborts(folder: Path) -> None:
    text = (folder / MODEL).read_text()
    (folder / MODEL).write_text(re.sub(r"<propulsion>.*?</propulsion>", "", text, flags=re.S))
    assert "throttle" in only(check(folder), "engine").message


BOMB = """<?xml version="1.0"?>
<!DOCTYPE lolz [ <!ENTITY a "ha"> <!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"> ]>
<system name="autopilot"><property value="1"> &b; </property></system>
"""


def test_an_entity_bomb_is_refused_unread(folder: Path) -> None:
    (folder / SYSTEM).write_text(BOMB)
    found = only(check(folder), "refused")
    assert (found.file, found.line) == (SYSTEM, 2)


@pytest.mark.parametrize("path", ["../../../outside", "/etc/hostname"])
def test_a_path_out_of_the_folder_is_refused(folder: Path, path: str) -> None:
    (folder.parent.parent / "outside.xml").write_text("<system/>")
    line = plant(folder, MODEL, '<system file="autopilot"/>', f'<system file="{path}"/>')
    assert only(check(folder), "refused").line == line


def test_a_link_out_of_the_folder_is_refused(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "real.xml").write_text((folder / SYSTEM).read_text())
    (folder / SYSTEM).unlink()
    (folder / SYSTEM).symlink_to(tmp_path / "real.xml")
    assert "outside" in only(check(folder), "refused").message


def test_a_folder_without_airframe_toml_says_so(folder: Path) -> None:
    (folder / TOML).unlink()
    assert [f.rule for f in check(folder)] == ["files"]


def test_what_a_model_writes_does_not_land_here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    empty = folder.parent / "here"
    empty.mkdir()
    monkeypatch.chdir(empty)
    check(folder)
    assert not list(empty.iterdir())
