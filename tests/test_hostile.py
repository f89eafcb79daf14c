"""Files from strangers start no code, reach no other folder, write and listen nowhere, exhaust nothing."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from aircraft import airframe
from aircraft.airframes.schema import AIRFRAMES, names
from aircraft.textfile import LARGEST_BYTES, read_toml
from testbed.errors import UserError
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

MODEL, SYSTEM, TOML = "x8.xml", "systems/autopilot.xml", "airframe.toml"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    copy = tmp_path / "stranger"
    shutil.copytree(AIRFRAMES / "x8", copy)
    return copy


def replace(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


CHANNEL = """<channel name="evil"><pure_gain name="fcs/evil"><input>simulation/dt</input><gain>1</gain>
<output>{}</output></pure_gain></channel>\n </flight_control>"""
BEFORE = "  <propulsion>"
# What to plant in the model, and what the one line that refuses it says.
PLANTED: dict[str, tuple[str, str, str, str]] = {
    "a file written": (MODEL, BEFORE, f'<output name="a.csv" type="CSV" rate="1"/>{BEFORE}', "writes files"),
    "a file named": (MODEL, BEFORE, f'<output file="out.xml"/>{BEFORE}', "writes files"),
    "a socket out": (MODEL, BEFORE, f'<output name="h" type="SOCKET" port="5"/>{BEFORE}', "writes files"),
    "a socket in": (MODEL, BEFORE, f'<input port="5000"/>{BEFORE}', "opens a socket"),
    "a section elsewhere": (MODEL, BEFORE, f'<aerodynamics file="/etc/x"/>{BEFORE}', "put it inline"),
    "a path up": (MODEL, 'file="autopilot"', 'file="../autopilot"', "outside the folder"),
    "an absolute path": (MODEL, 'file="autopilot"', 'file="/etc/hostname"', "outside the folder"),
    "JSBSim's own state file": (
        MODEL, "</flight_control>", CHANNEL.format("simulation/write-state-file"), "controls the simulation",
    ),
    "the same by a detour": (
        MODEL, "</flight_control>", CHANNEL.format("aero/../Simulation[0]/write-state-file"), "controls the",
    ),
    "a model elsewhere": (TOML, 'model = "x8"', 'model = "../../x8"', "model: use letters, digits"),
    "a name that is a path": (TOML, 'name = "x8"', 'name = "/tmp/x8"', "name: use letters, digits"),
    "a folder of its own": (TOML, 'name = "x8"', 'name = "x8"\nfolder = "/etc"', "folder: unknown field"),
    "telemetry over the record": (TOML, "elevon_left_rad =", "theta_rad =", "not what is recorded already"),
    "a gain that is a path": (TOML, "[gains.turn]", '[gains."../a"]\nb = 1\n[gains.turn]', "gains."),
    "entities": (SYSTEM, "<system", '<!DOCTYPE a [<!ENTITY b "c">]>\n<system', "document type or entities"),
    "a file in a place not named": (SYSTEM, "<system", "<system", "document type or entities"),
    "degrees": (TOML, "alpha_max_rad = 0.20", "alpha_max_rad = 11.5", "11.5 degrees are 0.2007"),
}  # fmt: skip


@pytest.mark.parametrize("what", PLANTED)
def test_what_a_stranger_plants_is_refused_before_jsbsim_sees_it(folder: Path, what: str) -> None:
    file, old, new, said = PLANTED[what]
    replace(folder / file, old, new)
    if what == "a file in a place not named":  # where JSBSim looks for a system first
        (folder / "autopilot.xml").write_text('<!DOCTYPE a [<!ENTITY b "c">]><system name="a"/>')
    if what == "a path up":  # a decoy where the file should lie; JSBSim would take the one outside
        shutil.copy(folder / SYSTEM, folder / "autopilot.xml")
    with pytest.raises(ValueError, match=re.escape(said)) as refused:
        airframe.load(folder)
    assert "\n" not in str(refused.value) and str(folder) in str(refused.value)


def _link_out(folder: Path) -> None:
    (folder / SYSTEM).unlink()
    (folder / SYSTEM).symlink_to("/etc/hostname")


def _folder_out(folder: Path) -> None:
    (folder / "more").symlink_to("/etc")


def _pipe(folder: Path) -> None:
    os.mkfifo(folder / "pipe.xml")


def _many(folder: Path) -> None:
    for k in range(1001):
        (folder / f"{k}.txt").touch()


def _large(folder: Path) -> None:
    with (folder / "large.bin").open("wb") as file:
        file.truncate(60_000_000)


def _deep(folder: Path) -> None:
    (folder / MODEL).write_text("<a>" * 300 + "</a>" * 300)


PUT: dict[str, tuple[Callable[[Path], None], str]] = {
    "a link to another's file": (_link_out, "outside the folder"),
    "a link to another's folder": (_folder_out, "outside the folder"),
    "a pipe, that would be waited for": (_pipe, "no ordinary file"),
    "more files than an airframe has": (_many, "more than 1000 files"),
    "more bytes than an airframe has": (_large, "50 MB"),
    "more depth than a model has": (_deep, "nested deeper"),
}


@pytest.mark.parametrize("what", PUT)
def test_a_folder_that_is_more_than_an_airframe_is_refused(folder: Path, what: str) -> None:
    put, said = PUT[what]
    put(folder)
    with pytest.raises(ValueError, match=said):
        airframe.load(folder)


def test_our_own_airframes_are_safe_by_the_same_rules(folder: Path) -> None:
    from aircraft.airframes.safety import dangers

    for name in names():
        assert list(dangers(AIRFRAMES / name)) == []
    assert airframe.load(folder).gains == airframe.load("x8").gains


@pytest.mark.slow
def test_a_model_that_would_end_the_process_is_one_line(folder: Path, tmp_path: Path) -> None:
    """A property that nobody makes: JSBSim aborts when the model is deleted."""
    replace(folder / MODEL, "aero/alpha-rad", "aero/alfa-rad")
    program = [sys.executable, "-c", "from testbed.cli.main import main; main()"]
    words = ["run", "paper-2-turn", "--plant=jsbsim", f"--set=airframes=['{folder}']", "--out=r"]
    done = subprocess.run([*program, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].endswith("no property aero/alfa-rad; did you mean aero/alpha-rad?")
    assert [p.name for p in tmp_path.iterdir()] == ["stranger"]


def test_a_gains_file_that_names_itself_ends(tmp_path: Path) -> None:
    file = tmp_path / "gains.toml"
    file.write_text(f'base = "{file}"\n[gains.turn]\ndamping = 1.0\n')
    with pytest.raises(ValueError, match="name an airframe, not another gains file"):
        airframe.load(file)


@pytest.mark.parametrize("name", ["../x", "/x", "a/b", ".hidden", "a\nb", "\x1b[2J", "[red]", "", " ", "$x$"])
def test_a_scenarios_name_leads_nowhere_and_means_nothing_to_a_terminal(name: str) -> None:
    with pytest.raises(UserError, match="name: ") as refused:
        load("paper-2-turn", [f"name={name!r}".replace("'", '"')])
    assert refused.value.args[0].isprintable()


TOO_LARGE = {
    "vehicles=1000000": "vehicles: input should be less than or equal to 1000",
    "vehicles=1000": "rates.record_dt_s: 2.0e+09 rows to record",
    "duration_s=1e9": "duration_s: input should be less than or equal to 86400",
    "fdm_dt_s=1e-9": "rates.fdm_dt_s: input should be greater than or equal to 0.0001",
}


@pytest.mark.parametrize("override", TOO_LARGE)
def test_a_scenario_that_no_machine_holds_is_refused_at_once(override: str) -> None:
    with pytest.raises(UserError) as refused:
        load("paper-2-turn", [override])
    assert TOO_LARGE[override] in str(refused.value)


def test_memory_is_estimated_before_it_is_taken() -> None:
    fine = ["rates.fdm_dt_s=1e-4", "rates.filter_dt_s=1e-4", "rates.record_dt_s=1", "duration_s=86400"]
    with pytest.raises(UserError, match=r"remembering 864000000 filter steps .* would take 601 GB"):
        load("paper-2-turn", fine)
    assert load("paper-2-turn", [*fine, "checks.manoeuvre_instants=0"]).filter_steps == 864_000_000
    many = ["vehicles=1000", "rates.fdm_dt_s=1e-4", "rates.filter_dt_s=1", "rates.record_dt_s=1"]
    with pytest.raises(UserError, match="10000 FDM periods of 1000 vehicles would take 480 GB"):
        load("paper-2-turn", many)
    late = ["vehicles=200", "network.latency_s=60", "sensing.source=sensors", "rates.record_dt_s=1"]
    with pytest.raises(UserError, match="what 200 vehicles measured in 12000 filter steps would take 27 GB"):
        load("paper-2-turn", late)


def test_a_run_kept_in_memory_is_refused_where_only_a_disk_would_hold_it() -> None:
    s = load("paper-2-turn", ["duration_s=86400", "checks.manoeuvre_instants=0"])
    with pytest.raises(UserError, match=r"5\.2e\+07 rows are too many for memory; give a folder"):
        run(s)


def test_a_scenario_file_is_an_ordinary_file_of_bounded_size(tmp_path: Path) -> None:
    pipe, large = tmp_path / "pipe.toml", tmp_path / "large.toml"
    os.mkfifo(pipe)
    with large.open("wb") as file:
        file.truncate(LARGEST_BYTES + 1)
    endless = tmp_path / "zero.toml"
    endless.symlink_to("/dev/zero")
    for path, said in ((pipe, "ordinary file"), (endless, "ordinary file"), (large, "larger than 2 MB")):
        with pytest.raises(ValueError, match=said):
            read_toml(path)
        with pytest.raises(UserError, match=said):
            load(path)
