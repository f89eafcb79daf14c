"""Adoption of models as users have them: what is read otherwise, what is refused and why."""

import json
import shutil
from pathlib import Path

import pytest

from aircraft.adopt.adopting import examine
from aircraft.adopt.copying import safe_copy
from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.fleet import table
from aircraft.adopt.kinds import only_winged
from aircraft.adopt.scoring import Case, Scored
from aircraft.adopt.source import find
from aircraft.adopt.verdict import GOOD, REFUSED, judge
from aircraft.airframes.files import read_folder
from aircraft.airframes.references import unresolved
from aircraft.airframes.schema import AIRFRAMES
from tests.adopted_models import MODELS

GUIDE = Path(__file__).parents[1] / "docs" / "guide"


def quiet(what):
    pass


def examined(name, tmp_path):
    return examine(str(MODELS[name](tmp_path / name)), tmp_path / "made", quiet)


def reason(name, tmp_path):
    with pytest.raises(AdoptionError) as refused:
        examine(str(name), tmp_path / "made", quiet)
    return refused.value.stage, refused.value.reason


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("ah1s", "a rotor carries it"),
        ("ZLT-NT", "gas carries it"),
        ("X15", "a rocket drives it"),
        ("sgs126", "the model has no engine"),
    ],
)
def test_what_no_throttle_holds_on_a_wing_is_refused_by_its_files(name, said):
    with pytest.raises(AdoptionError, match=said) as refused:
        only_winged(safe_copy(find(name), "copy"))
    assert refused.value.stage == "engines"


def test_a_motor_whose_shaft_coasts_is_steady(tmp_path):
    """At idle the propeller slows down as 1/t for minutes, and nothing pulls any more."""
    model = examined("electric", tmp_path)
    assert model.airframe.gains["thrust"]["max1_mps2"] > 1.0
    assert model.found.lowest < 14.0


def test_an_engines_template_stands_for_the_engines_number(tmp_path):
    """JSBSim ends the process where it is asked for a property with # in its name."""
    folder = MODELS["elevons"](tmp_path / "mine")
    text = "<function><property> propulsion/engine[#]/{} </property></function>"
    shutil.copyfile(AIRFRAMES / "x8" / "airframe.toml", folder / "airframe.toml")
    for name, missing in (("thrust-lbs", 0), ("thurst-lbs", 1)):
        (folder / "engine" / "motor.xml").write_text(
            f"<electric_engine name='motor'>{text.format(name)}</electric_engine>"
        )
        files, _ = read_folder(folder)
        asked = []
        found = list(unresolved(files, lambda path: asked.append(path) or path.endswith("/thrust-lbs")))  # noqa: B023
        assert len([f for f in found if "thurst" in f.message]) == missing
        assert f"propulsion/engine[0]/{name}" in asked and not any("#" in path for path in asked)


def test_a_v_tail_has_a_rudder_and_nominal_signs(tmp_path):
    model = examined("v-tail", tmp_path)
    assert model.controls.rudder is not None
    assert set(model.controls.elevator.surfaces) == {
        "fcs/elevator-pos-rad", "fcs/ruddervator-left-pos-rad", "fcs/ruddervator-right-pos-rad",
    }  # fmt: skip


def test_feet_inches_and_pounds_are_the_same_aircraft(tmp_path):
    model = examined("inches", tmp_path)
    gains = model.airframe.gains["airframe"]
    assert gains["mass_kg"] == pytest.approx(5.897, rel=1e-3)
    assert gains["wing_area_m2"] == pytest.approx(0.982, rel=1e-3)
    assert model.found.stall == pytest.approx(8.45, abs=0.1)  # as of the rascal in metres


def test_a_model_that_commands_rates_is_refused_for_its_integrator(tmp_path):
    stage, said = reason(MODELS["rate-command"](tmp_path / "mine"), tmp_path)
    assert stage == "speeds" and "integrates the elevator" in said


def test_forces_that_run_away_at_rest_are_said(tmp_path):
    stage, said = reason("paraglider", tmp_path)
    assert stage == "speeds" and "run away" in said


def test_a_models_own_autopilot_is_not_switched_on_by_ours(tmp_path):
    copy = safe_copy(find(str(MODELS["own-control"](tmp_path / "mine"))), "mine")
    texts = [e.text for e in copy.model.walk()] + [
        v for e in copy.model.walk() for v in e.attributes.values()
    ]
    assert not any(text.strip().startswith("ap/") for text in texts)
    assert any("model-ap/on == 1" in text for text in texts)
    assert any("ap/" in note for note in copy.notes)


def test_flightgears_copies_of_properties_are_read_where_jsbsim_has_them():
    copy = safe_copy(find("p51d"), "mine")
    boost = next(e for tree in copy.systems.values() for e in tree.walk()
                 if e.attributes.get("name") == "systems/engine/target-mp-inhg")  # fmt: skip
    assert boost.first("independentVar").text.strip() == "fcs/throttle-cmd-norm"
    assert any("FlightGear" in note for note in copy.notes)


def test_a_command_that_is_not_followed_is_no_flight():
    def step(overshoot, error):
        return [
            Scored(Case(c, 30.0, (30.0, 0.0, 1.0), 9.0), 1.0, overshoot, error)
            for c in ("v", "omega", "zeta")
        ]

    disks = {(30.0, "elevator"): 1.0}
    assert judge(step(0.05, 0.01), disks).kind == GOOD
    lost = judge(step(0.0, 1.2), disks)
    assert lost.kind == REFUSED and lost.stage == "steps" and "does not follow" in lost.remarks[0]


@pytest.mark.parametrize("data", ["adopted.json", "user-models.json"])
def test_the_guide_has_the_table_of_its_data(data):
    rows = json.loads((GUIDE / "data" / data).read_text(encoding="utf-8"))
    order = sorted(rows, key=str.lower) if data == "adopted.json" else list(rows)
    page = (GUIDE / "adopted.md").read_text(encoding="utf-8")
    assert table({name: rows[name] for name in order}).strip() in page


def test_what_is_promised_of_adopted_aircraft_holds_in_the_committed_tables():
    rows = json.loads((GUIDE / "data" / "adopted.json").read_text(encoding="utf-8"))
    flying = [r for r in rows.values() if r["verdict"] != REFUSED]
    assert len(rows) == 60 and len(flying) >= 28
    assert sum(r["verdict"] == GOOD for r in flying) >= 18
    named = ["c172p", "c172r", "c182", "pa28", "J3Cub", "L17", "dr1", "737", "A320", "B747", "A4", "T37"]
    assert {rows[name]["verdict"] for name in named} == {GOOD}
    assert all(rows[name]["seconds"] <= 40 for name in named)
    c172p = rows["c172p"]["worst"]
    assert c172p["t63_omega_s"] <= 0.8 and c172p["t63_zeta_s"] <= 0.7 and c172p["t63_v_s"] <= 4.0
    assert c172p["disk_margin"] >= 0.75
    own = json.loads((GUIDE / "data" / "user-models.json").read_text(encoding="utf-8"))
    assert own["elevons"]["worst"]["t63_omega_s"] <= 0.45  # the x8 and the rascal from their bare models
    assert own["tail"]["worst"]["t63_omega_s"] <= 0.45
