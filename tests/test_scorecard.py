"""Premises and guarantees, each held and broken by a scenario whose answer is known beforehand."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from aircraft.airframe import load as load_airframe
from filters.barriers.closed_form import TurnBarrier
from filters.filter import Choose, Decision, Declaration, declaration
from filters.model import Command, Limits, State, View
from filters.qp.single import Status
from testbed.components import catalogue
from testbed.components.components import Parts
from testbed.measures.saturation import Saturation
from testbed.records.run import Run
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

NONE = ["manoeuvre_instants=0"]


@functools.cache
def flown(*overrides: str, scenario: str = "paper-2-turn") -> Run:
    return run(load(scenario, list(overrides)), force=True)


def verdict(name: str, *overrides: str, scenario: str = "paper-2-turn") -> str:
    return str(flown(*overrides, scenario=scenario).guarantee(name)["verdict"])


def test_a_start_outside_the_safe_set_is_a_premise_not_met() -> None:
    assert verdict("start-safe") == "holds"
    straight = [*NONE, "course_offset_deg=0", "duration_s=0.1"]
    assert verdict("start-safe", *straight, scenario="paper-2-straight") == "premise not met"


def test_a_manoeuvre_per_pair_is_not_shared() -> None:
    assert verdict("shared-manoeuvre") == "holds"
    assert verdict("shared-manoeuvre", scenario="paper-counterexample") == "premise not met"


def test_a_manoeuvre_beyond_the_limits_is_not_in_the_input_set() -> None:
    assert verdict("manoeuvre-in-U") == "holds"
    fast = flown(*NONE, "omega_degps=14", "duration_s=0.1").guarantee("manoeuvre-in-U")
    assert fast["verdict"] == "premise not met"
    # 14 against 13 deg/s, as a share of the range of 26
    assert fast["margin"] == pytest.approx(-1 / 26)


def test_an_aircraft_cannot_fly_a_turn_that_needs_more_lift_than_it_has() -> None:
    short = [*NONE, "plant=jsbsim", "duration_s=0.1"]
    assert verdict("manoeuvre-flyable", *short) == "holds"
    # 140 deg/s at 16 m/s: 76 degrees of bank, 4.1 g, above the stall
    tight = flown(*short, "omega_degps=140", "omega_max_degps=150").guarantee("manoeuvre-flyable")
    assert tight["verdict"] == "premise not met"
    assert (
        "vehicle 1 (x8) has no steady turn of 140.0 deg/s at 16.0 m/s: side force is short by" in tight["why"]
    )
    # a unicycle can
    assert (
        verdict("manoeuvre-flyable", *NONE, "omega_degps=140", "omega_max_degps=150", "duration_s=0.1")
        == "holds"
    )


def test_in_wind_the_manoeuvre_must_be_flyable_at_both_airspeeds() -> None:
    windy = [*NONE, "plant=jsbsim", "duration_s=0.1", "start.speed_mps=20"]
    assert verdict("manoeuvre-flyable", *windy, "wind.speed_mps=3") == "holds"
    found = flown(*windy, "wind.speed_mps=9").guarantee("manoeuvre-flyable")
    # at 16 m/s over the ground and 9 m/s of wind behind, 7 m/s of airspeed: below the stall
    assert found["verdict"] == "premise not met"
    assert "at 7.0 m/s: lift is short by" in found["why"] and "elevator" in found["why"]


@pytest.mark.slow
def test_perturbed_headings_put_twenty_vehicles_on_the_kink_and_cost_the_guarantee() -> None:
    circle = [
        "heading_perturbation_deg=5",
        "fdm_dt_s=0.02",
        "filter_dt_s=0.02",
        "record_dt_s=1",
        "seed=1",
        *NONE,
    ]
    found = flown(*circle, scenario="paper-20-turn")
    assert found.guarantee("off-the-kink")["verdict"] == "premise not met"
    assert found.guarantee("barrier-condition")["verdict"] == "violated"
    assert found.guarantee("separation")["value"] == pytest.approx(4.41, abs=0.3)
    # every QP was solved and every row satisfied: the theorem's premise failed, not the solver
    assert found.guarantee("rows-satisfied")["verdict"] == "holds"
    smooth = flown(*circle, "barrier.smoothing_m2=30", "delta_m2=0", scenario="paper-20-turn")
    for name in ("off-the-kink", "separation", "safe-set"):
        assert smooth.guarantee(name)["verdict"] == "holds"


def test_a_vehicle_that_lags_by_a_known_time_breaks_what_the_unicycle_keeps() -> None:
    for name in ("separation", "barrier-condition", "qp-feasibility", "zcbf-condition"):
        assert verdict(name) == "holds"
    lagged = [
        *NONE,
        "plant=lagged",
        "lags.source=table",
        "lookahead_m=10",
        "filter_dt_s=0.02",
        "record_dt_s=0.02",
    ]
    instant = ["lags.v_time_constant_s=0", "lags.omega_time_constant_s=0", "lags.zeta_time_constant_s=0"]
    slow = ["lags.v_time_constant_s=1", "lags.omega_time_constant_s=0.5", "lags.zeta_time_constant_s=0.5"]
    for name in ("separation", "safe-set"):
        assert verdict(name, *lagged, *instant) == "holds"
        assert verdict(name, *lagged, *slow) == "violated"
    condition = [flown(*lagged, *lag).guarantee("barrier-condition") for lag in (instant, slow)]
    # one FDM period's ramp to a new input against half a second's
    assert condition[0]["value"] > -0.5 and condition[1]["value"] < -5
    assert condition[1]["verdict"] == "violated"


def test_a_state_known_late_by_a_known_time_is_judged_on_the_truth() -> None:
    late = flown(*NONE, "sensing.delay_s=0.6", "lookahead_m=10", "filter_dt_s=0.02", "record_dt_s=0.02")
    assert late.guarantee("safe-set")["verdict"] == "violated"
    seen, true = late.pairs.h_filter_m.min(), late.pairs.h_m.min()
    assert true < 0.0
    # the filter saw the h of 0.6 s before
    delayed = late.pairs.set_index("t_s")
    assert delayed.h_filter_m.loc[8.0] == pytest.approx(delayed.h_m.loc[7.4], abs=0.01)
    assert seen >= true - 1e-9


FINE = ("filter_dt_s=0.02", "record_dt_s=0.02")


def test_gamma_flown_from_a_safe_state_keeps_what_h_promises_on_unicycles() -> None:
    entry = flown("manoeuvre_instants=8", *FINE).guarantee("manoeuvre-keeps-Ds")
    assert entry["verdict"] == "holds"
    rows = entry["detail"]["branches"]
    # to the FDM's sampling: 0.02 m
    assert len(rows) == 8 and max(row["short_m"] for row in rows) < 0.02


def test_a_manoeuvre_that_was_never_flown_from_a_safe_state_shows_nothing() -> None:
    """Eight metres apart and head-on there is no way out from the start."""
    lost = flown("manoeuvre_instants=2", *FINE, "radius_m=4", "lookahead_m=10", "duration_s=0.1")
    assert lost.pairs.h_m.max() < 0.0
    entry = lost.guarantee("manoeuvre-keeps-Ds")
    assert (entry["verdict"], entry["value"]) == ("premise not met", None)


DELAY_S = 0.4


def delayed(seconds: float) -> Run:
    """Vehicles that hear of a turn `seconds` late and fly on straight until then; no filter asks for one."""
    instant = [f"lags.{channel}_time_constant_s=0" for channel in ("v", "omega", "zeta")]
    table = ["plant=lagged", "lags.source=table", f"lags.omega_delay_s={seconds}", *instant]
    return flown(*table, *FINE, "fdm_dt_s=0.01", "filter.kind=none", "course_offset_deg=0", "duration_s=9")


def test_on_vehicles_that_turn_late_gamma_reaches_what_h_says_of_where_they_will_be() -> None:
    late = delayed(DELAY_S)
    entry = late.guarantee("manoeuvre-keeps-Ds")
    rows = entry["detail"]["branches"]
    assert len(rows) == 6
    barrier = TurnBarrier(16.0, np.radians(11.7), 5.0, 0.01)
    v = late.vehicles
    for row in rows:
        at = v[np.isclose(v.t_s, row["t_s"])]
        theta, ahead = at.theta_rad.to_numpy(), 16.0 * DELAY_S
        x, y = at.x_m + ahead * np.cos(theta), at.y_m + ahead * np.sin(theta)
        turning = State(x.to_numpy(), y.to_numpy(), theta, at.z_m.to_numpy())
        if row["safe_pairs"]:
            # to one FDM period, in which the channels ramp, at 25 m/s each
            assert row["least_m"] == pytest.approx(5.0 + barrier.values(turning).h[0], abs=0.25)
    assert entry["verdict"] == "violated"
    assert min(row["least_m"] for row in rows if row["safe_pairs"]) < 4.0
    assert delayed(0.0).guarantee("manoeuvre-keeps-Ds")["verdict"] == "holds"


def test_the_default_instants_find_the_window_in_which_an_aircrafts_gamma_fails() -> None:
    """Flown from every 0.1 s, gamma falls short of Ds from 7.05 to 8.3 s, by 0.67 m at most, at 7.2 s."""
    entry = flown("plant=jsbsim", "duration_s=9").guarantee("manoeuvre-keeps-Ds")
    assert entry["verdict"] == "violated"
    assert 7.0 < entry["t_s"] < 7.9 and entry["value"] == pytest.approx(4.35, abs=0.15)
    worst = min(entry["detail"]["branches"], key=lambda row: row.get("least_m", np.inf))
    assert worst["h"] > 0.0 and worst["promised_m"] > 5.0


def test_a_manoeuvre_outside_the_limits_leaves_no_input_and_is_not_flown_as_promised() -> None:
    """30 deg/s where 13 are allowed: h promises a turn that nobody may fly."""
    found = flown("omega_degps=30", "fdm_dt_s=0.02", *FINE)
    assert found.guarantee("manoeuvre-in-U")["verdict"] == "premise not met"
    assert found.guarantee("gradient")["verdict"] == "holds"
    for name in ("zcbf-condition", "qp-feasibility", "manoeuvre-keeps-Ds", "safe-set"):
        assert found.guarantee(name)["verdict"] == "violated", name
    assert found.guarantee("qp-feasibility")["detail"]["in_safe_set"] > 0


def test_side_by_side_no_input_changes_the_distance() -> None:
    """Two parallel courses Ds apart: the offset is square to both, so L_g h is zero."""
    beside = ["x_m=0, course_deg=0, goal_x_m=300, " + f"y_m={y}, goal_y_m={y}" for y in (0, 5)]
    places = "start.places=[" + ", ".join("{" + p + "}" for p in beside) + "]"
    found = flown(*NONE, "barrier.kind=euclidean", "start.pattern=list", places, "duration_s=0.1")
    entry = found.guarantee("gradient")
    assert entry["verdict"] == "premise not met" and entry["value"] < 1e-9


class Reckless:
    """Asks for 30 m/s of vehicles that have 25."""

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        zero = np.zeros(len(nominal))
        none = np.full(len(nominal), Status.NONE)
        return Decision(Command(zero + 30.0, zero, zero), none, zero, zero > 0, zero, None, zero[:1])


def test_a_filter_that_leaves_the_limits_is_found_out() -> None:
    s = load("paper-2-turn", [*NONE, "duration_s=0.1"])
    found = run(s, parts=Parts(filter=lambda s, barrier, goal: Reckless()))
    entry = found.guarantee("command-limits")
    # 5 m/s beyond, of a range of 10
    assert entry["verdict"] == "violated" and entry["margin"] == pytest.approx(-0.5)
    assert verdict("command-limits") == "holds"


def test_achieved_rates_and_surfaces_at_their_stops_are_reported() -> None:
    held = ["plant=jsbsim", *NONE, "duration_s=4", "filter.kind=none", *FINE]
    detail = flown(*held).guarantee("command-limits")["detail"]
    low, high = detail["achieved_v_mps"]
    # from 20 m/s towards the 25 m/s the nominal asks for
    assert low == pytest.approx(20.0, abs=0.3) and 24.0 < high < 25.5
    shares = detail["share_at_stop"]
    assert set(shares) >= {"throttle", "elevon_left_rad", "elevon_right_rad", "limited_v"}
    # full throttle to accelerate; elevons have nothing to do
    assert shares["throttle"] > 0.1 and shares["elevon_left_rad"] == 0.0
    assert "share_at_stop" not in flown(*NONE, *FINE).guarantee("command-limits")["detail"]


def test_a_stop_is_the_models_own() -> None:
    counted = Saturation([load_airframe("x8"), load_airframe("rascal")])
    stop = np.radians(30.0)
    nan = np.nan
    for left, throttle in ((stop, 0.5), (0.0, 0.5), (-0.995 * stop, 1.0), (0.9 * stop, 0.5)):
        counted.update({"elevon_left_rad": np.array([left, nan]), "throttle": np.array([0.5, throttle])})
    shares = counted.shares()
    assert (shares["elevon_left_rad"], shares["throttle"], shares["rudder_rad"]) == (0.5, 0.25, 0.0)


def test_the_limited_qp_implies_the_centralised_rows() -> None:
    entry = flown(*NONE, "filter.kind=limited", "filter_dt_s=0.02", "record_dt_s=0.02").guarantee(
        "rows-satisfied"
    )
    assert entry["verdict"] == "holds"
    assert verdict("rows-satisfied", *NONE, "filter.kind=none", "duration_s=0.1") == "not applicable"


class Forgetful:
    """Solves its QPs and flies the nominal input all the same."""

    def __init__(self, inner: Choose) -> None:
        self.inner = inner

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        decision, flown = self.inner(view, nominal, limits), limits.clip(nominal)
        assert decision.pairs is not None
        p, u = decision.pairs, flown.array()
        lie = p.lie(view.state)
        hdot = np.sum(lie[0] * u[p.i], axis=-1) + np.sum(lie[1] * u[p.j], axis=-1)
        return dataclasses.replace(decision, command=flown, hdot_predicted=hdot)

    @property
    def declaration(self) -> Declaration:
        return declaration(self.inner)


def test_inputs_that_break_their_rows_are_found_out() -> None:
    s = load("paper-2-turn", [*NONE, *FINE, "fdm_dt_s=0.02", "duration_s=7.4"])
    found = run(s, parts=Parts(filter=lambda *made: Forgetful(catalogue.filter_(*made))))
    entry = found.guarantee("rows-satisfied")
    # without a turn h falls until its row, the first at about 7 s, cannot hold
    assert entry["verdict"] == "violated" and entry["t_s"] > 6.5 and entry["value"] < -1.0
    # every QP had a solution, but what was flown is none
    assert found.guarantee("qp-feasibility")["verdict"] == "premise not met"


def test_intervention_is_reported_not_judged() -> None:
    entry = flown(*NONE, "filter_dt_s=0.02", "record_dt_s=0.02").guarantee("intervention")
    assert entry["verdict"] == "not applicable"
    # the barrier acts between 6.9 and 8.2 s of 20 s
    assert entry["value"] == pytest.approx(1.3 / 20, abs=0.01)
    assert entry["detail"]["altered_omega_rad"] > 0.5
    free = flown(*NONE, "filter.kind=none", "filter_dt_s=0.02", "record_dt_s=0.02").guarantee("intervention")
    assert free["value"] == 0.0
    for name, least, most in (("path_added_m", 0.2, 2.0), ("time_added_s", 0.01, 0.2)):
        added, without = (e["detail"][name][0] for e in (entry, free))
        assert least < added - without < most
    # alone, a unicycle takes the straight way in the time the nominal speed needs, to one FDM period
    assert free["detail"]["time_added_s"] == pytest.approx([0.0, 0.0], abs=0.01)
