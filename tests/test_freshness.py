"""Fingerprints, what makes them stale, and how derived numbers are remade; no aircraft is flown."""

import hashlib
import json
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from aircraft.airframe import copy, load
from aircraft.airframes.provenance import FITTED, differs, fitted_fingerprint, identified_fingerprint
from aircraft.airframes.schema import Fitted, names
from aircraft.airframes.setup import Engines, Setup
from aircraft.autopilots import freshness, remaking
from aircraft.autopilots.channel_family import FittedModel
from aircraft.autopilots.freshness import stale_feedforward, stale_lags
from aircraft.autopilots.remaking import Remade, remade_autopilot, remade_feedforward, remade_lags
from aircraft.jsbsim.errors import FdmError
from testbed.studies.tuning.lags import known_lags


@pytest.fixture
def folder(tmp_path):
    return copy("x8", tmp_path / "mine")


def edit(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


# -- fingerprints


@pytest.mark.parametrize("variant", ["", "@arduplane", "@px4", "@px4@typical", "@inverting@typical"])
@pytest.mark.parametrize("name", names())
def test_fingerprints_are_those_written_when_the_numbers_were_made(name, variant):
    airframe = load(name + variant)
    assert airframe.fitted.fingerprint == fitted_fingerprint(airframe)
    if airframe.identified is not None:
        assert airframe.identified.fingerprint == identified_fingerprint(airframe)


def digest(content):
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:8]


# What JSBSim does not read; and the model and the autopilot of `tiny` as they count.
PROSE = "".join(
    f"<{name}>me</{name}>"
    for name in (
        "fileheader",
        "documentation",
        "description",
        "note",
        "author",
        "license",
        "reference",
        "email",
    )
)
MODEL = [
    ["x8.xml", "fdm_config", [["name", ["a", 1.5]]], [],
     ["metrics", [], [], ["wingarea", [["unit", ["M2"]]], [0.75]]],
     ["property", [["value", [3.0]]], ["mine"]], ["property", [], ["ap/turn-damping"]],
     ["a", [], ["one", 20.0], ["property", [["value", [3.0]]], ["mine"]]],
     ["system", [["file", ["autopilot"]]], []]]
]  # fmt: skip
AUTOPILOT = [
    ["systems/autopilot.xml", "system", [["name", ["ap"]]], [], ["channel", [["a", ["x"]], ["b", [2.0]]], []]]
]


@pytest.fixture
def tiny(folder):
    """An airframe of a few elements: MODEL and AUTOPILOT are what counts of them, written out by hand."""
    (folder / "x8.xml").write_text(
        '<fdm_config name="a 1.50"><fileheader><author>me</author></fileheader>\n'
        f'<!-- no --><metrics><wingarea unit="M2"> 0.750 </wingarea>{PROSE}</metrics>\n'
        '<property value="3">ap/turn-damping</property><property value="3">mine</property>'
        "<property>ap/turn-damping</property>"
        '<a> one  2e1 <property value="3">ap/turn-damping</property><property value="3">mine</property></a>'
        '<system file="autopilot"/></fdm_config>'
    )
    (folder / "systems" / "autopilot.xml").write_text('<system name="ap"><channel b="2" a="x"/></system>')
    return folder


def test_a_fingerprint_is_of_the_files_as_nested_lists_and_of_what_airframe_toml_says(tiny):
    airframe = load(tiny)
    speeds = {"v_min_mps": 15.0, "v_max_mps": 25.0, "start_mps": 20.0, "trim_mps": airframe.speeds.trim_mps}
    lags = [AUTOPILOT, airframe.gains, speeds]
    assert identified_fingerprint(airframe) == f"{digest(lags)}-{digest(MODEL)}"
    known = airframe.gains["airframe"]
    used = ("mass_kg", "wing_area_m2", "thrust_area_share", "motor_speed_mps", "elevator_norm_rad")
    values = {name: known.get(name) for name in (*FITTED, *used)}
    lowest = airframe.gains["envelope"]["airspeed_min_mps"]
    assert fitted_fingerprint(airframe) == f"{digest([values, lowest, 25.0])}-{digest(MODEL)}"
    assert len(FITTED) == 8 and set(FITTED) <= set(known)
    empty = airframe.model_copy(update={"gains": {}})
    assert fitted_fingerprint(empty).partition("-")[0] == digest([dict.fromkeys(values), None, 25.0])
    # What the model is told by airframe.toml belongs to it.
    flaps = airframe.model_copy(update={"setup": Setup(flaps=0.3), "engines": Engines(count=2)})
    told = [*MODEL, ["airframe.toml", {"flaps": 0.3}, {"count": 2}]]
    assert identified_fingerprint(flaps) == f"{digest(lags)}-{digest(told)}"


@pytest.mark.parametrize("change", [{"setup": Setup(flaps=0.3)}, {"engines": Engines(full=0.9)}])
def test_what_airframe_toml_sets_in_the_model_changes_both_fingerprints(change):
    """Flaps or an engine's range change the flight and no file of the model."""
    x8 = load("x8")
    changed = x8.model_copy(update=change)
    for fingerprint in (identified_fingerprint, fitted_fingerprint):
        assert differs(fingerprint(x8), fingerprint(changed)) == "model"


def test_of_other_autopilots_equations_parameters_and_sensors_count(tiny):
    (tiny / "own.eq").write_bytes("a = 1 # \u00e4".encode() + b"\xff")
    airframe = load(tiny)
    # Their XML is compiled from the equations when they are loaded: that in the folder does not count.
    lags = [airframe.gains, airframe.speeds.model_dump(exclude_none=True)]
    model = digest(MODEL)
    for change, own in (
        ({"autopilot": "own.eq"}, ["own", "", "a = 1 # \u00e4\ufffd", {}, {}]),
        (
            {"autopilot": "px4", "parameters": {"K": 2.0}, "equations_sha256": "ab"},
            ["px4", "ab", "", {"K": 2.0}, {}],
        ),
        ({"variant": "@x"}, ["inverting", "", "", {}, {}]),
        ({"sensors": {"preset": "typical"}}, ["inverting@typical", "", "", {}, {"preset": "typical"}]),
    ):
        changed = airframe.model_copy(update=change)
        assert identified_fingerprint(changed) == f"{digest([*own, *lags])}-{model}"
        assert fitted_fingerprint(changed) == fitted_fingerprint(airframe)


def test_what_two_fingerprints_differ_in():
    assert differs("a-b", "a-b") is None
    assert differs("a-b", "a-c") == "model"
    assert differs("a-b", "c-b") == "gains" and differs("a-b", "c-d") == "gains"
    assert differs("a", "a-b") == differs("a-b", "a") == "model"


def test_a_folder_that_cannot_be_read_has_a_fingerprint_without_files(folder):
    airframe = load(folder)
    (folder / "airframe.toml").write_text("no = 1")
    assert fitted_fingerprint(airframe).endswith(digest([]))


# -- freshness


class Flown:
    """Stands for `tuning.fly`: a flight whose numbers are formulas of time."""

    def __init__(self, off=0.0, error=None):
        self.off, self.error, self.asked = off, error, []

    def __call__(self, airframe, v, command, duration):
        assert airframe.name in ("x8", "mine")
        self.asked.append((v, command, duration))
        if self.error:
            raise self.error
        t = np.arange(1, 601) * 0.005
        return SimpleNamespace(v=20 + t / 3, omega_measured=0.2 * t + self.off, zeta=np.sin(t))


RECORDED = [
    round(x, 5)
    for k in (50, 100, 200, 400, 600)
    for x in (20 + k * 0.005 / 3, k * 0.001, float(np.sin(k * 0.005)))
]


def test_a_step_in_all_three_channels_is_flown_and_noted_at_five_instants(monkeypatch):
    monkeypatch.setattr(freshness, "fly", fly := Flown())
    x8 = load("x8")
    assert freshness.flown(x8) == RECORDED
    # From the middle of its speeds to nine tenths, turning by 0.2 rad/s, climbing by 2 m/s.
    assert fly.asked == [(20.0, (24.0, 0.2, 2.0), 3.0)]
    slow = x8.model_copy(
        update={"speeds": x8.speeds.model_copy(update={"turn_radps": 0.1, "climb_mps": 1.95})}
    )
    freshness.flown(slow)
    assert fly.asked[1] == (20.0, (24.0, 0.1, pytest.approx(1.0)), 3.0)


def with_lags(x8, **change):
    known = {"flown": RECORDED, "fingerprint": identified_fingerprint(x8)} | change
    return x8.model_copy(update={"identified": x8.identified.model_copy(update=known)})


def of_another_model(airframe):
    gains, _, model = identified_fingerprint(airframe).partition("-")
    return f"{gains}-{'0' * len(model)}"


def test_lags_are_stale_if_made_of_other_gains_or_of_a_model_that_flies_otherwise(monkeypatch, tiny):
    monkeypatch.setattr(freshness, "fly", fly := Flown())
    x8, remedy = load(tiny), f"; run: testbed aircraft identify {tiny}"
    assert stale_lags(x8.model_copy(update={"identified": None})) is None
    assert stale_lags(with_lags(x8)) is None
    nothing = "[identified] does not say from which model and gains it was made"
    assert stale_lags(with_lags(x8, fingerprint=None)) == nothing + remedy
    gains = "[identified] was made from other gains or speeds"
    assert stale_lags(with_lags(x8, fingerprint="00000000-11111111")) == gains + remedy
    assert fly.asked == []  # what differs in gains need not fly
    other = with_lags(x8, fingerprint=of_another_model(x8))
    assert stale_lags(other) is None and len(fly.asked) == 1
    model = "[identified] was made from another model" + remedy
    for change in (Flown(4e-5), Flown(-4e-5), Flown(error=FdmError("no trim"))):
        monkeypatch.setattr(freshness, "fly", change)
        assert stale_lags(other) == model
    monkeypatch.setattr(freshness, "fly", Flown(2e-5))
    assert stale_lags(other) is None  # rounding of five decimals, and a little more
    for recorded in (RECORDED[:-1], []):
        assert stale_lags(with_lags(x8, fingerprint=of_another_model(x8), flown=recorded)) == model


def test_lags_of_a_flight_log_are_of_the_aircraft_that_flew(folder):
    log = folder / "flight.bin"
    log.write_bytes(b"flown")
    sha = hashlib.sha256(b"flown").hexdigest()
    airframe = load(folder)
    known = {"log": "logs/flight.bin", "log_sha256": sha, "command": "make it", "fingerprint": None}
    logged = airframe.model_copy(update={"identified": airframe.identified.model_copy(update=known)})
    assert stale_lags(logged) is None
    log.write_bytes(b"flown otherwise")
    assert stale_lags(logged) == "[identified] was made from another logs/flight.bin; run: make it"
    log.unlink()
    assert stale_lags(logged) is None  # what is not there cannot be compared


def test_a_feedforward_is_stale_if_edited_or_fitted_to_a_model_that_gives_another(monkeypatch, tiny):
    x8, remedy, fits = load(tiny), f"; run: testbed aircraft trim {tiny}", []
    gains = dict(x8.gains["airframe"])

    def fitted(airframe):
        fits.append(airframe)
        return {name: gains[name] for name in FITTED}

    def with_fitted(fingerprint):
        return x8.model_copy(update={"fitted": Fitted(command="", fingerprint=fingerprint)})

    monkeypatch.setattr(freshness, "feedforward", fitted)
    assert stale_feedforward(x8.model_copy(update={"fitted": None})) is None
    assert stale_feedforward(with_fitted(fitted_fingerprint(x8))) is None
    nothing = "[fitted] does not say from which model and gains it was made"
    assert stale_feedforward(with_fitted(None)) == nothing + remedy
    edited = "the feed-forward of [fitted] was edited, or made from other gains or speeds"
    assert stale_feedforward(with_fitted("00000000-11111111")) == edited + remedy
    assert fits == []
    other = with_fitted(fitted_fingerprint(x8).partition("-")[0] + "-00000000")
    assert stale_feedforward(other) is None and fits == [other]
    model = "the feed-forward of [fitted] was made from another model" + remedy
    for name in FITTED:  # six digits are in the file
        written = x8.gains["airframe"][name]
        for share, stale in ((3e-5, True), (-3e-5, True), (1e-5, False), (-1e-5, False)):
            gains[name] = written * (1 + share) + (
                2e-9 if stale else 0.9e-9 if not written else 0.0
            ) * np.sign(share)
            assert (stale_feedforward(other) == model) is stale, (name, share)
        gains[name] = written

    def fails(airframe):
        raise FdmError("no trim")

    monkeypatch.setattr(freshness, "feedforward", fails)
    assert stale_feedforward(other) == model


def test_a_tuning_compares_only_with_lags_of_the_airframe_as_it_is(tiny):
    x8 = with_lags(load(tiny))
    assert known_lags(x8) is x8.identified
    assert known_lags(with_lags(load(tiny), fingerprint="00000000-11111111")) is None


# -- remaking


def test_a_file_is_replaced_as_a_whole_and_its_folder_made(tmp_path):
    path = tmp_path / "systems" / "autopilot.xml"
    made = Remade(path, "<a>\u00e4</a>", "a")
    assert made.changed
    made.write()
    assert path.read_text(encoding="utf-8") == "<a>\u00e4</a>" and not made.changed
    Remade(path, "b", "b").write()
    assert made.changed and [f.name for f in path.parent.iterdir()] == ["autopilot.xml"]


def test_a_remade_feedforward_is_written_with_the_fingerprint_of_what_it_makes(monkeypatch, folder):
    values = {name: 0.0 if name == "cd_1" else 0.123456789 * (k + 1) for k, name in enumerate(FITTED)}
    airframe = load(folder)
    monkeypatch.setattr(remaking, "feedforward", lambda asked: values if asked is airframe else None)
    made = remade_feedforward(airframe)
    assert made.path == airframe.folder / "airframe.toml" and made.changed
    tables = tomllib.loads(made.text)
    assert {n: tables["gains"]["airframe"][n] for n in FITTED} == {
        n: float(f"{v:.6g}") for n, v in values.items()
    }
    assert tables["fitted"]["command"] == f"testbed aircraft trim {airframe.argument}"
    lines = [f"{n} = {v:.6g}" if v else f"{n} = 0.0" for n, v in values.items()]
    fingerprint = tables["fitted"]["fingerprint"]
    assert made.shown == "\n".join(
        ["[gains.airframe]", *lines, "", "[fitted]", f'command = "testbed aircraft trim {airframe.argument}"',
         f'fingerprint = "{fingerprint}"', ""]
    )  # fmt: skip
    made.write()
    after = load(folder)
    assert stale_feedforward(after) is None and fitted_fingerprint(after) == fingerprint


def test_a_remade_autopilot_is_the_compiled_file(folder):
    edit(folder / "airframe.toml", "bandwidth_radps = 9.5", "bandwidth_radps = 4.5")
    made = remade_autopilot(load(folder))
    assert made.path == load(folder).folder / "systems" / "autopilot.xml" and made.shown == made.text
    assert made.changed and '<property value="4.5"> ap/turn-bandwidth-radps' in made.text


LAGS = {
    "v": (0.3214, 0.1596, 1.756, 3.5549),
    "omega": (0.2, 0.08, 0.598, 0.6),
    "zeta": (0.1, 0.1, 6.57, 10.94),
}


@pytest.fixture
def lags(monkeypatch):
    asked = []

    def identify(airframe, channel, every, near):
        asked.append((channel, every, near))
        return LAGS[channel]

    def validate(fits, checks, fitted):
        assert (fits, checks) == ("fits", "checks") and fitted in LAGS.values()
        return SimpleNamespace(first_order_rms=0.0456, second_order_rms=0.0123)

    def choose(channel, fits, checks):
        assert (fits, checks) == ("fits", "checks")
        values = {"radps": 1.23456, "damping": 0.7, "delay_s": 0.1}
        best = FittedModel("second order", values, {"radps": 1.1}, {"radps": 1.4}, 0.02, 0.0346)
        return best, [best]

    monkeypatch.setattr(remaking, "identify", identify)
    monkeypatch.setattr(remaking, "validate", validate)
    monkeypatch.setattr(remaking, "flown_data", lambda airframe, channel: ("fits", "checks"))
    monkeypatch.setattr(remaking, "choose", choose)
    monkeypatch.setattr(remaking, "flown", lambda airframe: [20.5, 0.25, -0.125])
    return asked


def test_remade_lags_are_written_with_their_source(lags, folder):
    airframe, told = load(folder), []
    made = remade_lags(airframe, told.append)
    assert made.path == airframe.folder / "airframe.toml"
    assert told == ["steps of v", "steps of omega", "steps of zeta"]
    assert lags == [(channel, 1, None) for channel in ("v", "omega", "zeta")]
    table = tomllib.loads(made.text)["identified"]
    assert table == tomllib.loads(made.shown)["identified"]
    assert made.shown.startswith("[identified]\n") and made.text.count("[identified.v]") == 1
    assert table.pop("command") == f"testbed aircraft identify {airframe.argument}"
    assert table.pop("fingerprint") == identified_fingerprint(airframe)
    assert table == {
        "flown": [20.5, 0.25, -0.125],
        "v": {"time_constant_s": 0.321, "delay_s": 0.16, "rate_min": -1.76, "rate_max": 3.55},
        "omega": {"time_constant_s": 0.2, "delay_s": 0.08, "rate_min": -0.598, "rate_max": 0.6},
        "zeta": {"time_constant_s": 0.1, "delay_s": 0.1, "rate_min": -6.57, "rate_max": 10.9},
    }
    assert "time_constant_s = 0.200\ndelay_s = 0.080\nrate_min = -0.598\nrate_max = 0.6\n" in made.shown

    def near(v):
        return None

    remade_lags(airframe, every=4, near=near)
    assert lags[3:] == [(channel, 4, near) for channel in ("v", "omega", "zeta")]


def test_lags_of_another_autopilot_are_written_to_its_file_with_their_errors(lags, folder):
    made = remade_lags(load(f"{folder}@px4"))
    assert made.path == load(folder).folder / "autopilots" / "px4.toml"
    table = tomllib.loads(made.text)["identified"]["zeta"]
    assert (table["validation_rms"], table["second_order_rms"]) == (0.046, 0.012)
    assert table["best"] == {
        "kind": "second order",
        "validation_rms": 0.035,
        "values": {"radps": 1.235, "damping": 0.7, "delay_s": 0.1},
        "low": {"radps": 1.1},
        "high": {"radps": 1.4},
    }
    # what is written is read, and written again it is replaced
    made.write()
    again = load(f"{folder}@px4")
    assert again.identified.zeta.best.kind == "second order"
    assert remade_lags(again).text == made.text
    # What else the file says stays; where there is no file yet, it holds the lags alone.
    other = folder / "autopilots" / "px4.toml"
    other.write_text("# mine\n[parameters]\n")
    made = remade_lags(load(f"{folder}@px4"))
    assert made.text == f"# mine\n[parameters]\n\n{made.shown}"
    other.unlink()
    made = remade_lags(load(f"{folder}@px4"))
    assert made.text == made.shown and made.changed


def test_lags_of_a_gains_file_are_written_to_it(lags, folder, tmp_path):
    airframe = load(f"{folder}@px4").model_copy(update={"gains_file": tmp_path / "mine.toml"})
    (tmp_path / "mine.toml").write_text("[gains]\n")
    made = remade_lags(airframe)
    assert made.path == tmp_path / "mine.toml" and made.text == f"[gains]\n\n{made.shown}"
    assert (
        tomllib.loads(made.text)["identified"]["command"]
        == f"testbed aircraft identify {made.path.as_posix()}"
    )
