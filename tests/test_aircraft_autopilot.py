"""The X8 under its autopilot: step responses, limits, wind, and the loops' margins."""

import math

import numpy as np
import pytest

from aircraft.airframe import load
from aircraft.autopilot import EQUATIONS, parse, system_xml
from aircraft.linear import LOOPS, margins, response
from aircraft.tuning import fly, score

TURN = math.radians(11.7)


@pytest.fixture(scope="module")
def x8():
    return load("x8")


def test_the_committed_xml_is_what_the_equations_and_gains_say(x8):
    committed = (x8.folder / "systems" / "autopilot.xml").read_text()
    assert committed == system_xml(parse(EQUATIONS.read_text()), x8.gain_values())


def test_an_equation_with_an_unknown_name_is_refused():
    with pytest.raises(ValueError, match="nonsense is neither"):
        system_xml(parse("== c ==\na = 2 * nonsense"), {})


@pytest.mark.parametrize(("v", "t63"), [(16, 0.34), (20, 0.36), (25, 0.38)])
def test_turn_rate_step(x8, v, t63):
    f = fly(x8, v, (v, TURN, 0.0))
    s = score(f.t, f.omega, 0.0, TURN)
    assert s.t63 <= t63 and s.overshoot <= 0.02 and abs(s.final_error) <= 0.005
    assert np.abs(f.position[:, 2]).max() <= 0.25


@pytest.mark.parametrize(("v", "to", "settling"), [(16, 20, 1.6), (20, 24, 2.2), (20, 16, 3.5)])
def test_speed_step(x8, v, to, settling):
    # 20 -> 16 is as fast as drag and the idle propeller allow
    f = fly(x8, v, (to, 0.0, 0.0))
    s = score(f.t, f.v, v, to)
    assert s.settling <= settling and s.overshoot <= 0.01


@pytest.mark.parametrize("v", [16, 25])
@pytest.mark.parametrize(("zeta", "t63", "speed_change"), [(2.0, 0.33, 0.4), (3.9, 0.48, 0.8)])
def test_climb_rate_step(x8, v, zeta, t63, speed_change):
    f = fly(x8, v, (v, 0.0, zeta))
    s = score(f.t, f.zeta, 0.0, zeta)
    assert s.t63 <= t63 and s.overshoot <= 0.03
    assert np.abs(f.v - v).max() <= speed_change


@pytest.mark.parametrize("v", [16, 18, 20])
def test_all_three_steps_at_once(x8, v):
    f = fly(x8, v, (v + 4, TURN, 3.9))
    scores = score(f.t, f.v, v, v + 4), score(f.t, f.omega, 0.0, TURN), score(f.t, f.zeta, 0.0, 3.9)
    assert scores[1].overshoot <= 0.04
    assert all(s.crossings < 2 for s in scores)


def test_a_dive_that_drag_cannot_pay_for_keeps_the_speed_and_says_so(x8):
    f = fly(x8, 16.0, (16.0, 0.0, -3.9), duration=20.0, telemetry=["limited_zeta"])
    assert f.v.min() >= 15.0 and f.v.max() <= 25.0
    assert f.telemetry["limited_zeta"][-1] == 1.0
    assert f.zeta[-1] > -3.0  # idle sink is 2.4 m/s at this speed


def test_limits_are_silent_when_nothing_is_limited(x8):
    f = fly(
        x8, 20.0, (20.0, 0.1, 1.0), duration=4.0, telemetry=["limited_v", "limited_omega", "limited_zeta"]
    )
    assert all(not channel[200:].any() for channel in f.telemetry.values())


def test_a_turn_the_wing_cannot_carry_is_limited_and_does_not_stall(x8):
    names = ["limited_omega", "alpha_rad", "roll_rad"]
    f = fly(x8, 15.0, (15.0, 2.0, 0.0), telemetry=names)
    assert f.telemetry["limited_omega"].all()
    assert f.telemetry["alpha_rad"].max() < 0.24
    assert abs(f.zeta[-200:]).max() < 0.3


def test_a_speed_below_the_stall_is_refused_in_flight(x8):
    f = fly(x8, 16.0, (6.0, 0.0, 0.0), duration=20.0, telemetry=["airspeed_mps", "limited_v"])
    assert f.telemetry["airspeed_mps"].min() > 12.0
    assert f.telemetry["limited_v"][-1] == 1.0


def test_overspeed_is_refused_in_flight(x8):
    f = fly(x8, 25.0, (60.0, 0.0, -6.0), duration=20.0, telemetry=["airspeed_mps"])
    assert f.telemetry["airspeed_mps"].max() < 30.5


def test_in_a_crosswind_speed_and_course_are_over_the_ground(x8):
    f = fly(x8, 20.0, (20.0, 0.0, 0.0), wind=(0.0, 5.0, 0.0), telemetry=["heading_rad", "airspeed_mps"])
    assert np.abs(f.v - 20.0).max() < 1e-3
    # heading east with the air going north: the nose points south of the course
    assert f.telemetry["heading_rad"][-1] == pytest.approx(-math.atan(5 / 20), abs=1e-3)
    assert f.telemetry["airspeed_mps"][-1] == pytest.approx(math.hypot(20, 5), rel=1e-3)


@pytest.mark.parametrize("wind", [(5.0, 0.0, 0.0), (0.0, -5.0, 0.0)])
def test_a_circle_over_the_ground_is_held_in_wind(x8, wind):
    f = fly(x8, 20.0, (20.0, TURN, 0.0), duration=40.0, wind=wind)
    late = f.t > 2.0
    # healthy 0.02 m/s rms; without the air-relative acceleration fed forward 0.58
    assert (f.v[late] - 20.0).std() < 0.05
    assert np.abs(f.omega[late] - TURN).max() < math.radians(0.25)
    assert np.abs(f.zeta[late]).max() < 0.1


def test_responses_do_not_depend_on_the_period(x8):
    t63 = {}
    for dt in (0.01, 0.005, 0.0025):
        f = fly(x8, 20.0, (22.0, TURN, 2.0), duration=4.0, dt=dt)
        t63[dt] = [score(f.t, f.omega, 0.0, TURN).t63, score(f.t, f.zeta, 0.0, 2.0).t63, f.v[-1], f.zeta[-1]]
    # one sample of delay differs between them
    np.testing.assert_allclose(t63[0.01], t63[0.0025], atol=0.02)
    np.testing.assert_allclose(t63[0.005], t63[0.0025], atol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("loop", LOOPS)
def test_every_loop_has_its_margins_at_every_trim_speed(x8, loop):
    for v in x8.speeds.trim_mps:
        m = margins(response(x8, v, loop))
        assert m.gain_db >= 6 and m.phase_deg >= 45 and m.disk >= 0.5, (loop, v, m)
