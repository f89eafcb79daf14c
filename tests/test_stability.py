"""An unstable autopilot is called so, with loop, speed and frequency; the poles and the flight agree."""

import math

import numpy as np
import pytest

from aircraft.airframe import copy, load
from aircraft.autopilots.linear_model import linear_model
from aircraft.autopilots.margins import margins, response
from aircraft.autopilots.specification import margin_rows
from aircraft.autopilots.stability import flown_oscillation, instabilities, unstable_modes
from aircraft.check.check import check
from aircraft.datasheets.datasheet import describe
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start
from testbed.report.aircraft_page import page
from testbed.report.aircraft_tables import markdown


def slowest(model):
    """The largest real part [1/s] of all poles but the heading's, which is neutral."""
    z = np.linalg.eigvals(model.a)
    growth = np.log(np.abs(z[np.abs(z) > 1e-9])) / model.dt
    neutral = np.abs(growth) < 1e-6
    assert neutral.sum() == 1
    return growth[~neutral].max()


@pytest.mark.parametrize(("name", "decay"), [("x8", 0.33), ("rascal", 0.10)])
def test_ours_are_stable_at_all_trim_speeds_by_their_poles_and_in_flight(name, decay):
    airframe = load(name)
    for v in airframe.speeds.trim_mps:
        assert slowest(linear_model(airframe, v)) < -decay
    assert instabilities(airframe) == []


# The X8's bank feedback is 7.5 per s; the linear model puts the boundary at 18 m/s between 52 and 58.
@pytest.mark.parametrize(("gain", "stable"), [(48.0, True), (52.0, True), (58.0, False), (60.0, False)])
def test_poles_and_flight_agree_on_which_gain_is_too_high_and_on_the_frequency(gain, stable):
    airframe = load("x8").with_gains({"turn.bank_feedback_per_s": gain})
    modes, flown = unstable_modes(linear_model(airframe, 18.0), 18.0), flown_oscillation(airframe, 18.0)
    assert bool(modes) is not stable and (flown is None) is stable
    if flown is not None:
        assert modes[0].loop == flown.loop == "aileron"
        assert flown.frequency == pytest.approx(modes[0].frequency, rel=0.03)


def test_the_loop_that_is_unstable_is_named():
    airframe = load("x8").with_gains({"climb.feedback_per_s": 15.0})
    found = instabilities(airframe, [20.0])
    assert [(x.loop, x.flown) for x in found] == [("elevator", False)]
    assert "unstable at 20 m/s: the elevator loop oscillates at 13." in str(found[0])


def test_no_other_loop_is_blamed_for_what_an_unstable_loop_shakes():
    """In flight the throttle moves most at 18 m/s; its gains are sound."""
    airframe = load("x8").with_gains({"climb.feedback_per_s": 40.0})
    assert {x.loop for x in instabilities(airframe, [18.0])} == {"elevator"}
    assert flown_oscillation(airframe, 18.0).loop == "throttle"


def test_a_flight_under_high_gains_begins_in_its_trim():
    """Evaluated without the surfaces' lag this autopilot runs away, and began with ailerons at their stop."""
    fdm = Fdm(load("x8").with_gains({"turn.bank_feedback_per_s": 44.0}), 0.005, Origin())
    fdm.start(Start(0.0, 0.0, 0.0, 0.0, 18.0))
    worst = 0.0
    for _ in range(400):
        fdm.run((0.0, 0.0, 0.0), 1)
        worst = max(worst, abs(fdm.read("fcs/aileron-cmd-norm")))
    assert worst < 1e-3


@pytest.fixture(scope="module")
def wild(tmp_path_factory):
    """An X8 with turn and bank feedback many times as high: it rolls from stop to stop."""
    folder = copy("x8", tmp_path_factory.mktemp("unstable") / "wild")
    toml = folder / "airframe.toml"
    text = toml.read_text().replace("\nfeedback = 0.22", "\nfeedback = 3.0")
    toml.write_text(text.replace("bank_feedback_per_s = 7.5", "bank_feedback_per_s = 60"))
    return folder


def test_check_says_unstable_with_loop_speed_frequency_and_line(wild):
    findings = [f for f in check(wild) if f.rule == "stability"]
    assert {f.severity for f in findings} == {"error"}
    for v in load(wild).speeds.trim_mps:
        assert any(f"unstable at {v:g} m/s: the aileron loop oscillates at 2" in f.message for f in findings)
    lines = (wild / "airframe.toml").read_text().splitlines()
    assert all(lines[f.line - 1] == "[gains.turn]" for f in findings)


@pytest.mark.slow
def test_describe_says_unstable_and_quotes_no_margin(wild):
    sheet = describe(load(wild))
    assert {x.v for x in sheet.unstable} == set(sheet.airframe.speeds.trim_mps)
    assert sheet.loops == [] and sheet.as_dict()["margins"] == []
    rows = [row for row in sheet.rows if row.group == "margins"]
    assert rows and all(math.isnan(row.value) and not row.met for row in rows)
    for text in (page(sheet), markdown(sheet)):
        assert "unstable" in text and "Least margins" not in text and "gain dB" not in text


def test_no_margin_is_quoted_at_a_speed_whose_flight_oscillates():
    rows = margin_rows(load("x8"), [18.0, 20.0], unstable=[18.0])
    assert all(math.isnan(row.value) == (row.case.endswith("at 18 m/s")) for row in rows)


def test_no_margin_is_quoted_where_a_pole_grows():
    """At 60 per s the bank feedback is too high at 18 m/s; the flight was not asked. At 40 it is not."""
    for gain, quoted in ((60.0, False), (40.0, True)):
        rows = margin_rows(load("x8").with_gains({"turn.bank_feedback_per_s": gain}), [18.0])
        assert rows and all(math.isnan(row.value) is not quoted for row in rows)
        assert quoted or not any(row.met for row in rows)


def test_noise_and_dead_bands_neither_look_unstable_nor_hide_an_impulse():
    """Measured through the noise of typical sensors there would be no crossover at all."""
    typical = load("x8@typical")
    assert flown_oscillation(typical, 18.0) is None
    found = margins(response(typical, 18.0, "aileron"))
    assert found.crossover == pytest.approx(7.3, rel=0.05) and found.phase_deg == pytest.approx(53, abs=5)
