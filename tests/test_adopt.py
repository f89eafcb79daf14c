"""Adoption of JSBSim aircraft: from a model alone to a folder that flies."""

import json
import math
import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aircraft.adopt.adopting import examine
from aircraft.adopt.command import adopted, default_folder
from aircraft.adopt.copying import safe_copy
from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.source import find, stock, wheel
from aircraft.adopt.verdict import GOOD, REFUSED
from aircraft.airframe import load
from aircraft.airframes.schema import AIRFRAMES
from aircraft.autopilots.freshness import stale_lags
from aircraft.autopilots.tuning import fly
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start
from testbed.cli.main import app
from testbed.errors import UserError


def quiet(what):
    pass


@pytest.fixture(scope="module")
def a4(tmp_path_factory):
    """One jet of JSBSim's, adopted as a user does."""
    folder = tmp_path_factory.mktemp("fleet") / "a4"
    return folder, adopted("A4", folder)


@pytest.mark.slow
def test_a_jet_is_adopted_without_a_hand_on_it(a4):
    folder, verdict = a4
    assert verdict.kind == GOOD, verdict
    assert verdict.worst["overshoot"] <= 0.12
    assert verdict.worst["disk_margin"] >= 0.5
    assert verdict.worst["final_error"] <= 0.05
    airframe = load(folder)
    assert airframe.identified is not None and stale_lags(airframe) is None
    said = (folder / "README.md").read_text()
    assert "Verdict: **good**" in said and "stall at" in said


@pytest.mark.slow
def test_an_adopted_aircraft_holds_level_flight_calm_and_in_a_crosswind(a4):
    airframe = load(a4[0])
    v = airframe.speeds.start_mps
    for wind in ((0.0, 0.0, 0.0), (0.0, v / 10, 0.0)):
        f = fly(airframe, v, (v, 0.0, 0.0), 20.0, wind=wind)
        assert abs(f.v - v).max() < 0.1
        assert abs(f.zeta).max() < 0.05
        assert abs(f.omega).max() < math.radians(0.1)


@pytest.mark.slow
def test_tanks_keep_their_contents_in_flight(a4):
    """JSBSim reads propulsion/fuel_freeze as 0 whatever was written to it."""
    airframe = load(a4[0])
    assert airframe.setup.fuel_freeze
    fdm = Fdm(airframe, 0.005, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, airframe.speeds.start_mps))
    before = fdm.read("propulsion/total-fuel-lbs")
    fdm.run((0.0, 0.0, 0.0), 200)
    assert fdm.read("propulsion/total-fuel-lbs") == before


@pytest.mark.slow
def test_two_adopted_aircraft_fly_a_scaled_scenario(a4, tmp_path, monkeypatch):
    monkeypatch.chdir(a4[0].parent)
    command = ["run", "paper-2-turn", "--plant", "jsbsim", "--set", "airframes=['a4']", "--scale-to-airframe"]
    done = CliRunner().invoke(
        app, [*command, "--set", "duration_s=2", "--out", str(tmp_path / "run"), "--json"]
    )
    assert done.exit_code == 0, done.output
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert "scaled to a4: speeds x" in manifest["scenario"]["description"]
    assert manifest["scenario"]["d_safe_m"] > 100


@pytest.mark.parametrize("name", ["x8", "rascal"])
def test_derivatives_of_a_bare_model_are_ours(name, tmp_path):
    """x8 and rascal without their autopilot and airframe.toml: within a fifth of what was worked out by hand.

    elevator_per_alpha2 and cd_0 to cd_2 are fitted together there, and stand for other splits here.
    """
    bare = tmp_path / "bare"
    shutil.copytree(AIRFRAMES / name, bare)
    (bare / "airframe.toml").unlink()
    model = examine(str(bare / f"{name}.xml"), tmp_path / name, quiet)
    found, ours = model.airframe.gains["airframe"], load(name).gains["airframe"]
    slopes = ["cl_alpha", "elevator_per_alpha", "elevator_per_q_m", "elevator_per_qdot_m", "roll_lag_m"]
    slopes += ["aileron_per_p_m", "aileron_per_r_m", "aileron_per_beta", "mass_kg", "elevator_norm_rad"]
    slopes += ["aileron_norm_rad", "rudder_per_r_m", "rudder_per_rdot_m", "rudder_per_aileron"]
    for gain in slopes:
        if gain in ours:
            assert found[gain] == pytest.approx(ours[gain], rel=0.2), gain
    assert model.controls.shared == (name == "x8")
    assert (model.controls.rudder is None) == (name == "x8")


def model_folder(tmp_path, change=lambda text: text):
    """The bare rascal as a user's own model, its text changed."""
    folder = tmp_path / "mine"
    shutil.copytree(AIRFRAMES / "rascal", folder)
    (folder / "airframe.toml").unlink()
    (folder / "systems" / "autopilot.xml").unlink()
    path = folder / "rascal.xml"
    path.write_text(change(path.read_text().replace('<system file="autopilot"/>', "")))
    return folder


def refusal(folder, tmp_path):
    with pytest.raises(AdoptionError) as refused:
        examine(str(folder), tmp_path / "made", quiet)
    return refused.value


def test_a_glider_is_refused_for_want_of_an_engine(tmp_path):
    folder = model_folder(tmp_path, lambda t: re.sub(r"<propulsion>.*?</propulsion>", "", t, flags=re.S))
    error = refusal(folder, tmp_path)
    assert error.stage == "engines" and "no engine" in error.reason


def test_a_missing_engine_file_is_named(tmp_path):
    folder = model_folder(tmp_path, lambda t: t.replace('engine file="motor"', 'engine file="nosuch"'))
    error = refusal(folder, tmp_path)
    assert error.stage == "files" and "nosuch" in error.reason and "rascal.xml:" in error.reason


def test_an_engine_without_thrust_is_said(tmp_path):
    folder = model_folder(
        tmp_path, lambda t: re.sub(r"<external_reactions>.*?</external_reactions>", "", t, flags=re.S)
    )
    error = refusal(folder, tmp_path)
    assert error.stage == "speeds" and "thrust is short" in error.reason


def test_a_wing_that_cannot_roll_is_refused_at_controls(tmp_path):
    rolls = "<product> <value> 0.13 </value> <property> fcs/aileron-pos-rad </property> </product>"
    folder = model_folder(tmp_path, lambda t: t.replace(rolls, ""))
    assert rolls in (AIRFRAMES / "rascal" / "rascal.xml").read_text()
    error = refusal(folder, tmp_path)
    assert error.stage == "controls" and "nothing rolls it" in error.reason


def test_controls_of_the_other_sign_are_found_not_asked(tmp_path):
    """An elevator that goes up for a positive command, and its travel."""

    def turned(text):
        return text.replace("<value> -0.5 </value> <property> fcs/elevator-pos-rad </property>",
                            "<value> 0.5 </value> <property> fcs/elevator-pos-rad </property>")  # fmt: skip

    folder = model_folder(tmp_path, turned)
    model = examine(str(folder), tmp_path / "made", quiet)
    gains = model.airframe.gains["airframe"]
    assert gains["elevator_norm_rad"] == pytest.approx(-math.radians(30), rel=0.01)
    assert gains["elevator_per_alpha"] < 0


def test_what_is_unsafe_is_left_out_and_said(tmp_path):
    def unsafe(text):
        text = text.replace(
            "<metrics>", '<output name="a.csv" type="CSV" rate="10"><rates> ON </rates></output>\n<metrics>'
        )
        return text.replace('<?xml version="1.0"?>', '<?xml version="1.0"?>\n<!DOCTYPE fdm_config>', 1)

    copy = safe_copy(find(str(model_folder(tmp_path, unsafe))), "mine")
    assert copy.model.first("output") is None or copy.model.first("output").parent.name != "fdm_config"
    assert any("output" in note and "writes files" in note for note in copy.notes)


def test_properties_of_a_flight_simulator_are_declared(tmp_path):
    def foreign(text):
        lift = "<property> aero/CL </property> </product>\n      </function>\n    </axis>"
        assert lift in text
        return text.replace(
            lift,
            lift.replace("</product>", "<sum><value>1</value><property> sim/ice </property></sum></product>"),
        )

    folder = model_folder(tmp_path, foreign)
    model = examine(str(folder), tmp_path / "made", quiet)
    assert any("sim/ice" in note for note in model.notes)


def test_a_mistyped_name_is_one_line_with_the_names_there_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["aircraft", "adopt", "c127p"])
    assert isinstance(done.exception, UserError)
    assert "did you mean" in str(done.exception) and "c172p" in str(done.exception)


def test_an_existing_folder_is_left_alone(tmp_path):
    (tmp_path / "a4").mkdir()
    with pytest.raises(FileExistsError, match="--out"):
        adopted("A4", tmp_path / "a4")
    assert list((tmp_path / "a4").iterdir()) == []


def test_a_refusal_leaves_no_folder(tmp_path):
    verdict = adopted("ball", tmp_path / "ball")
    assert verdict.kind == REFUSED and verdict.stage == "engines"
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_a_model_is_pointed_to_adopt(tmp_path):
    with pytest.raises(FileNotFoundError, match="testbed aircraft adopt"):
        load(model_folder(tmp_path))


def test_every_stock_aircraft_can_be_copied_or_says_why():
    """Parsing alone: all sixty, their systems and engines."""
    refused = {}
    for name in stock():
        try:
            safe_copy(find(name), "copy")
        except AdoptionError as error:
            refused[name] = error.reason
    assert len(stock()) >= 55
    assert len(refused) <= 6, refused
    assert all(reason for reason in refused.values())


def test_default_folders_are_plain_names():
    assert default_folder("737") == Path("737")
    assert default_folder(str(wheel() / "aircraft" / "787-8")) == Path("787-8")


def test_a_system_that_commands_the_aircraft_itself_is_left_out(tmp_path):
    autothrottle = (
        '<system name="autothrottle"><channel name="speed"><pure_gain name="at/throttle">'
        "<input> velocities/vt-fps </input><gain> 0.001 </gain>"
        "<output> fcs/throttle-cmd-norm </output></pure_gain></channel></system>"
    )
    folder = model_folder(tmp_path, lambda t: t.replace("<aerodynamics>", autothrottle + "<aerodynamics>"))
    copy = safe_copy(find(str(folder)), "mine")
    assert any("commands fcs/throttle-cmd-norm itself" in note for note in copy.notes)
    assert "at/throttle" not in {e.attributes.get("name") for e in copy.model.walk()}
