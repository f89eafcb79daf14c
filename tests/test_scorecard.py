"""Premises and guarantees, each held and broken by a scenario whose answer is known beforehand."""

from __future__ import annotations

import functools

import pytest

from testbed.record import Run
from testbed.scenario import load
from testbed.simulate import run

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
    assert "vehicle 1 (x8) has no steady turn of 140.0 deg/s at 16.0 m/s" in tight["why"]
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
    assert found["verdict"] == "premise not met" and "at 7.0 m/s" in found["why"]


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
    assert verdict("separation") == "holds"
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


def test_gamma_flown_from_a_safe_state_keeps_ds_on_unicycles_and_not_on_slow_vehicles() -> None:
    kept = flown("manoeuvre_instants=20", "filter_dt_s=0.02", "record_dt_s=0.02")
    entry = kept.guarantee("manoeuvre-keeps-Ds")
    assert entry["verdict"] == "holds"
    # h's promise is kept to the FDM's sampling: 0.02 m
    assert max(row["short_m"] for row in entry["detail"]["branches"]) < 0.02
    slow = flown(
        "plant=lagged",
        "lags.source=table",
        "lags.omega_time_constant_s=1.5",
        "manoeuvre_instants=40",
        "lookahead_m=10",
        "filter_dt_s=0.02",
        "record_dt_s=0.02",
    ).guarantee("manoeuvre-keeps-Ds")
    assert slow["verdict"] == "violated"
    assert max(row["short_m"] for row in slow["detail"]["branches"]) > 1.0


def test_the_limited_qp_implies_the_centralised_rows() -> None:
    entry = flown(*NONE, "filter.kind=limited", "filter_dt_s=0.02", "record_dt_s=0.02").guarantee(
        "rows-satisfied"
    )
    assert entry["verdict"] == "holds"
    assert verdict("rows-satisfied", *NONE, "filter.kind=none", "duration_s=0.1") == "not applicable"


def test_intervention_is_reported_not_judged() -> None:
    entry = flown(*NONE, "filter_dt_s=0.02", "record_dt_s=0.02").guarantee("intervention")
    assert entry["verdict"] == "not applicable"
    # the barrier acts between 6.9 and 8.2 s of 20 s
    assert entry["value"] == pytest.approx(1.3 / 20, abs=0.01)
    assert entry["detail"]["altered_omega_rad"] > 0.5
    free = flown(*NONE, "filter.kind=none", "filter_dt_s=0.02", "record_dt_s=0.02").guarantee("intervention")
    assert free["value"] == 0.0
    added, without = (e["detail"]["path_added_m"][0] for e in (entry, free))
    assert 0.2 < added - without < 2.0
