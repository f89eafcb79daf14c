"""What a person meets at the edges: another encoding, another folder, a package of the same name."""

from __future__ import annotations

import codecs
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import testbed
from testbed.campaigns.bases import bases
from testbed.campaigns.file import load as load_campaign
from testbed.campaigns.plan import expand
from testbed.errors import NoteWarning, UserError
from testbed.scenario.randomness import random_fields
from testbed.scenario.scenario import load

ROOT = Path(__file__).parents[1]
PROGRAM = [sys.executable, "-c", "from testbed.cli.main import main; main()"]
CHINESE = 'name = "Test-\N{CJK UNIFIED IDEOGRAPH-6D4B}"\nvehicles = 2\nduration_s = 0.1\n'
WING = 'name = "w"\nvehicles = 2\nplant = "jsbsim"\nduration_s = 0.1\nairframes = ["my-wing"]\n'
CAMPAIGN = 'name = "c"\nscenario = "own.toml"\nseeds = 2\n[random]\n"wind.speed_mps" = { uniform = [0, 3] }\n'


def program(*words: str, cwd: Path, encoding: str = "utf-8") -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONPATH": str(ROOT), "COLUMNS": "100"}
    return subprocess.run(
        [*PROGRAM, *words], cwd=cwd, env=environment, capture_output=True, encoding=encoding, check=False
    )


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1", "utf-8"])
def test_letters_that_the_terminal_lacks_are_escaped(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "n.toml").write_text(CHINESE, encoding="utf-8")
    ran = program("run", "n.toml", "--out", "r", cwd=tmp_path, encoding=encoding)
    assert (ran.returncode, "Traceback" in ran.stderr) == (0, False)
    assert ("Test-\N{CJK UNIFIED IDEOGRAPH-6D4B}" if encoding == "utf-8" else "Test-\\u6d4b") in ran.stdout
    for command in (["list"], ["compare", "n.toml", "--plants", "unicycle,lagged", "--out", "c"]):
        assert program(*command, cwd=tmp_path, encoding=encoding).returncode == 0


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with a scenario, a campaign and the airframe that they name."""
    from aircraft.airframe import copy

    here = tmp_path / "project"
    here.mkdir()
    copy("x8", here / "my-wing")
    (here / "own.toml").write_text(WING)
    (here / "camp.toml").write_text(CAMPAIGN)
    return here


def test_an_airframe_beside_its_scenario_is_found_from_anywhere(project: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    ran = program("run", "../project/own.toml", "--out", "../r", cwd=elsewhere)
    assert ran.returncode == 0, ran.stderr
    checked = program("verify", "r", "--fly", cwd=tmp_path)
    assert checked.returncode == 0 and "all is the same" in checked.stdout, checked.stdout
    said = json.loads((tmp_path / "r" / "manifest.json").read_text())["scenario"]
    assert (said["airframes"], said["airframes_folder"]) == (["my-wing"], "../project")
    assert program("campaign", "check", "project/camp.toml", cwd=tmp_path).returncode == 0


def test_the_name_of_a_run_does_not_depend_on_where_its_airframe_lies(project: Path, tmp_path: Path) -> None:
    import shutil

    other = tmp_path / "moved"
    shutil.copytree(project, other)
    plans = []
    for here in (project, other):
        campaign, folder = load_campaign(str(here / "camp.toml"))
        plans.append(expand(campaign, bases(campaign, folder)))
    assert plans[0].id == plans[1].id


def test_a_campaign_goes_on_from_another_folder(project: Path, tmp_path: Path) -> None:
    flown = program("campaign", "run", "project/camp.toml", "--out", "c", "--workers", "1", cwd=tmp_path)
    assert flown.returncode == 0, flown.stderr
    again = program("campaign", "resume", "../c", cwd=project)
    assert again.returncode == 0, again.stderr


def test_what_the_command_line_says_starts_from_the_working_directory(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project)
    s = load("paper-2-turn", ["plant=jsbsim", 'airframes=["my-wing"]'])
    assert Path(s.airframes_folder) == project.resolve()
    monkeypatch.chdir(project.parent)
    testbed.run(load("project/own.toml"))


def test_gains_are_found_with_the_airframe_beside_them(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from aircraft.airframe import load as airframe

    monkeypatch.chdir(project.parent)
    (project / "slow.toml").write_text('base = "my-wing"\n[gains.turn]\nbandwidth_radps = 1.0\n')
    assert airframe(project / "slow.toml").name == "my-wing+slow"


@pytest.mark.parametrize("name", ["aircraft", "filters"])
@pytest.mark.parametrize("file", ["{}.py", "{}/__init__.py"])
def test_a_package_of_the_same_name_is_named_in_one_line(name: str, file: str, tmp_path: Path) -> None:
    own = tmp_path / file.format(name)
    own.parent.mkdir(exist_ok=True)
    own.write_text("")
    (tmp_path / "s.py").write_text(
        "import sys\n"
        "sys.meta_path = [f for f in sys.meta_path if 'editable' not in repr(f).lower()]\n"
        f"sys.path.append({str(ROOT)!r})\nimport testbed\n"
    )
    ran = subprocess.run([sys.executable, "s.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.returncode == 1 and len(ran.stderr.splitlines()) == 1, ran.stderr
    assert str(own) in ran.stderr and f"package '{name}'" in ran.stderr and "rename" in ran.stderr


RANDOM = {
    (): [],
    ("start.heading_perturbation_deg=1",): ["start.heading_perturbation_deg"],
    ("plant=lagged", "gusts.intensity=light"): ["gusts"],
    ("plant=lagged", "gusts.sigma_mps=1"): ["gusts"],
    ("gusts.intensity=light",): [],
    ("plant=jsbsim", "gusts.jsbsim_turbulence=light"): ["gusts.jsbsim_turbulence"],
    ("sensing.position_noise_m=1", "sensing.turn_rate_bias_degps=1"): [
        "sensing.position_noise_m",
        "sensing.turn_rate_bias_degps",
    ],
    ("sensing.delay_s=1", "network.latency_s=1"): [],
    ("network.loss=0.5",): ["network.loss"],
    ("network.loss=1",): [],
    ("wind.speed_mps=5",): [],
}


@pytest.mark.parametrize("overrides", RANDOM, ids=str)
def test_what_is_random_is_said_by_the_tables(overrides: tuple[str, ...]) -> None:
    s = load("paper-2-turn", list(overrides))
    assert random_fields(s) == RANDOM[overrides]


def test_an_airframe_that_is_nowhere_says_so(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(WING)
    with pytest.raises(UserError, match="my-wing"):
        testbed.run(load(tmp_path / "own.toml"))


MARKED = codecs.BOM_UTF8.decode("utf-8")


def test_campaigns_gains_and_airframes_with_a_byte_order_mark_are_read(project: Path) -> None:
    from aircraft.airframe import load as airframe

    (project / "own.toml").write_text(MARKED + WING)
    (project / "camp.toml").write_text(CAMPAIGN, encoding="utf-16")
    gains = 'base = "my-wing"\r\n[gains.turn]\r\nbandwidth_radps = 1.0\r\n'
    (project / "slow.toml").write_text(MARKED + gains)
    toml = project / "my-wing" / "airframe.toml"
    toml.write_text(MARKED + toml.read_text())
    campaign, folder = load_campaign(str(project / "camp.toml"))
    assert bases(campaign, folder)[0].scenario.airframes == ["my-wing"]
    assert airframe(project / "slow.toml").gains["turn"]["bandwidth_radps"] == 1.0


def test_files_that_are_no_text_are_named_with_the_line(project: Path) -> None:
    from aircraft.autopilots import gains

    for name, read in (("camp.toml", load_campaign), ("slow.toml", lambda path: gains.read(Path(path)))):
        (project / name).write_bytes(b'name = "c"\nscenario = "caf\xe9"\n')
        with pytest.raises((UserError, ValueError), match=f"{name}: is not UTF-8 text: byte 0xe9 in line 2"):
            read(str(project / name))


def test_a_mistake_in_a_campaign_file_names_its_line(project: Path) -> None:
    (project / "camp.toml").write_text(CAMPAIGN.replace("seeds = 2", "seeds = 0"))
    with pytest.raises(UserError, match=r"camp.toml: seeds: .*greater.* \(line 3\)"):
        load_campaign(str(project / "camp.toml"))


def test_another_plant_leaves_out_the_airframes_with_one_note(project: Path) -> None:
    with pytest.warns(NoteWarning) as notes:
        s = load(project / "own.toml", ["plant=unicycle"])
    assert [str(n.message).split(": ")[1].split()[0] for n in notes] == ["airframes"]
    assert (s.airframes, s.airframes_folder) == (["x8"], "")
