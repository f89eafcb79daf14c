"""Scenarios scaled to an airframe's speeds are the same flight in a larger world."""

from types import SimpleNamespace

import numpy as np
import pytest

import testbed
from aircraft.airframe import load
from testbed.errors import UserError
from testbed.scenario.scaling import scaled


def airframe(start, turn_degps=None, climb=None, low=None, high=None, name="big"):
    speeds = SimpleNamespace(
        start_mps=start,
        v_min_mps=low or 0.7 * start,
        v_max_mps=high or 1.3 * start,
        turn_radps=None if turn_degps is None else np.radians(turn_degps),
        climb_mps=climb,
    )
    return SimpleNamespace(name=name, speeds=speeds)


def test_on_an_airframe_of_the_same_speed_nothing_changes_but_the_description():
    before = testbed.load_scenario("paper-2-turn")
    after = scaled(before, [load("x8")] * 2)
    assert after.model_dump(exclude={"description"}) == before.model_dump(exclude={"description"})


@pytest.mark.parametrize("alpha", ["cubic", "linear"])
@pytest.mark.parametrize("form", ["root", "squared"])
def test_a_unicycle_flies_the_scaled_scenario_as_the_original(alpha, form):
    """Twice the speed, four times the lengths, at half the turn rate: distances are four times as large."""
    before = testbed.load_scenario(
        "paper-2-turn", [f"alpha.kind={alpha}", f"barrier.form={form}", "rates.filter_dt_s=0.02",
                         "rates.record_dt_s=0.02", "rates.fdm_dt_s=0.02"]
    )  # fmt: skip
    after = scaled(before, [airframe(40.0, low=20.0, high=60.0)] * 2)
    assert after.rates.filter_dt_s == pytest.approx(2 * before.rates.filter_dt_s)
    assert after.d_safe_m == pytest.approx(4 * before.d_safe_m)
    assert after.limits.omega_max_degps == pytest.approx(before.limits.omega_max_degps / 2)
    small, large = (testbed.run(s).pairs["distance_m"].to_numpy() for s in (before, after))
    n = min(len(small), len(large))
    # The QP weighs m/s against rad/s, which does not scale: found up to 0.6 %; unscaled alpha gives 60 %.
    assert large[:n] == pytest.approx(4 * small[:n], rel=0.02)


def test_a_turn_that_the_airframe_cannot_hold_makes_the_world_larger():
    before = testbed.load_scenario("paper-2-turn")
    after = scaled(before, [airframe(40.0, turn_degps=2.0)] * 2)
    assert after.barrier.omega_degps == pytest.approx(2.0)
    assert after.d_safe_m == pytest.approx(before.d_safe_m * 2 * 11.7 / 2.0)


def test_limits_are_within_the_speeds_and_the_climb_of_the_airframe():
    after = scaled(
        testbed.load_scenario("paper-2-turn"), [airframe(40.0, climb=1.5, low=35.0, high=44.0)] * 2
    )
    assert (after.limits.v_min_mps, after.limits.v_max_mps) == (35.0, 44.0)
    assert after.limits.zeta_max_mps == pytest.approx(1.5)
    assert "scaled to big: speeds x 2" in after.description


def test_airframes_of_different_speeds_get_limits_of_their_own():
    before = testbed.load_scenario("paper-2-turn", ["plant=jsbsim"])
    after = scaled(before, [airframe(40.0, name="slow"), airframe(120.0, name="fast")])
    assert [v.speed_mps for v in after.vehicle] == [40.0, 120.0]
    assert after.vehicle[0].limits.v_max_mps < after.vehicle[1].limits.v_min_mps
    assert after.barrier.sigma == [pytest.approx(1 / 3), 1.0]
    assert after.d_safe_m == pytest.approx(5.0 * 36.0)


def test_what_cannot_be_scaled_is_refused_in_one_line():
    with pytest.raises(UserError, match="navigation function"):
        scaled(testbed.load_scenario("paper-20-navigation"), [airframe(40.0)] * 20)
