"""Remedies as a scenario states them: in one order, seen by the filter only, refused where they cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from filters.cbf.collision import CollisionFilter
from filters.model import State
from filters.wrappers.air_mass import AirMass
from filters.wrappers.pose_prediction import Horizon, LaggedPose, Predicted
from filters.wrappers.row_margins import BoundedError, InputToState, Sum
from testbed.components import catalogue
from testbed.errors import UserError
from testbed.records.run import Run
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

# Long enough to pass each other, at 20 Hz: what is compared here does not need more.
QUICK = [
    "rates.filter_dt_s=0.05",
    "rates.record_dt_s=0.05",
    "duration_s=10",
    "checks.manoeuvre_instants=0",
]
GOAL = np.zeros((2, 3))


def scenario(*overrides: str):
    return load("paper-2-turn", [*QUICK, *overrides])


def flown(*overrides: str) -> Run:
    return run(scenario(*overrides))


def filter_of(*overrides: str):
    s = scenario(*overrides)
    judge = catalogue.barrier(s)
    return catalogue.filter_(s, judge, GOAL), judge


def closest(result: Run) -> float:
    return float(result.guarantee("separation")["value"])


def true_h(result: Run, s) -> np.ndarray:
    """The unmodified barrier at the recorded true states."""
    v = result.vehicles.sort_values(["t_s", "vehicle"])
    fields = [v[name].to_numpy().reshape(-1, 2) for name in ("x_m", "y_m", "theta_rad", "z_m")]
    judge = catalogue.barrier(s)
    return np.array([judge.values(State(*(f[k] for f in fields))).h[0] for k in range(len(fields[0]))])


def test_without_remedies_the_filter_is_the_papers_over_the_judges_barrier() -> None:
    made, judge = filter_of()
    assert type(made) is CollisionFilter and made.margin is None and made.barrier is judge


def test_remedies_wrap_in_the_stated_order() -> None:
    made, judge = filter_of(
        "remedy.air_mass=true",
        "remedy.prediction_s=0.4",
        "remedy.robust_v_mps=0.5",
        "remedy.robust_omega_degps=1",
        "remedy.issf_epsilon=2",
        "remedy.ds_buffer_m=0.5",
        "remedy.derate=0.8",
        "remedy.derate_speed=0.95",
        "remedy.smoothing_m2=30",
        "wind.speed_mps=3",
        "wind.towards_deg=90",
    )
    assert isinstance(made, AirMass) and isinstance(made.filter, Predicted)
    np.testing.assert_allclose(made.wind, [0.0, 3.0], atol=1e-12)
    assert made.filter.pose == Horizon(0.4)
    inner = made.filter.filter
    assert isinstance(inner, CollisionFilter)
    assert inner.margin == Sum(
        (BoundedError(0.5, np.radians(1.0), 0.0), InputToState(2.0, 1.0, np.radians(2.0), 1.0))
    )
    own = inner.barrier
    assert (own.d_safe, own.delta, own.smoothing) == (5.5, 0.0, 30.0)
    assert own.omega == pytest.approx(0.8 * judge.omega) and own.v == pytest.approx(0.95 * judge.v)
    assert (judge.d_safe, judge.delta, judge.smoothing) == (5.0, 0.01, 0.0)


def test_predicted_lags_are_those_of_the_plant() -> None:
    table = ("plant=lagged", "lags.source=table", "lags.omega_delay_s=0.1")
    kinematic, judge = filter_of(*table, "remedy.predict_lags=true")
    assert isinstance(kinematic.pose, LaggedPose)
    np.testing.assert_array_equal(kinematic.pose.held.array(), judge.manoeuvre(2).array())
    (v, omega, zeta), *_ = catalogue.lags(scenario(*table))
    assert [c.time_constant_s for c in (v, omega, zeta)] == [1.0, 0.35, 0.3] and omega.delay_s == 0.1
    aircraft = catalogue.lags(scenario("plant=jsbsim"))
    assert len(aircraft) == 2 and aircraft[0][0].time_constant_s > 0
    assert catalogue.lags(scenario("plant=lagged")) == aircraft


def test_a_buffer_keeps_the_larger_distance_on_unicycles() -> None:
    result = flown("remedy.ds_buffer_m=1")
    assert closest(result) >= 6.0 and closest(result) > closest(flown()) + 0.5
    # Judged by the paper's Ds all the same.
    assert result.guarantee("separation")["bound"] == 5.0


@pytest.mark.parametrize(
    "override",
    ["remedy.prediction_s=0.45", "remedy.derate=0.8", "remedy.smoothing_m2=30", "remedy.ds_buffer_m=1"],
)
def test_the_recorded_h_is_the_true_one_and_the_filters_its_own(override: str) -> None:
    result = flown(override)
    pairs = result.pairs
    np.testing.assert_allclose(pairs.h_m, true_h(result, scenario(override))[: len(pairs)], rtol=0, atol=1e-9)
    apart = np.abs(pairs.h_filter_m - pairs.h_m)
    # A smoothed barrier lowers h by eps^2 / (4 |Z| sqrt(m)), little where headings are opposed.
    assert np.max(apart) > (1e-4 if "smoothing" in override else 0.4)
    if "buffer" in override:
        np.testing.assert_allclose(pairs.h_filter_m, pairs.h_m - 1.0, atol=1e-9)


@pytest.mark.slow
def test_lags_break_the_guarantee_and_prediction_with_a_buffer_restores_it() -> None:
    """Healthy 5.9 m and more, broken 4.2 m."""
    lagged = ("plant=lagged", "guidance.lookahead_m=10")
    assert closest(flown(*lagged)) < 4.5
    for buffer in (0.5, 1.0):
        result = flown(*lagged, "remedy.prediction_s=0.45", f"remedy.ds_buffer_m={buffer}")
        assert closest(result) > 5.5
        assert result.guarantee("safe-set")["verdict"] == "holds"
        assert result.guarantee("qp-feasibility")["verdict"] == "holds"
    assert closest(flown(*lagged, "remedy.predict_lags=true")) > 5.1


@pytest.mark.slow
def test_the_identified_lags_restore_the_guarantee_on_the_aircraft() -> None:
    """Healthy 7.3 m, broken 4.7 m, 1 m where the rate limits were predicted too."""
    aircraft = ("plant=jsbsim", "guidance.lookahead_m=10")
    assert closest(flown(*aircraft)) < 5.0
    result = flown(*aircraft, "remedy.predict_lags=true")
    assert closest(result) > 7.0
    assert result.guarantee("safe-set")["verdict"] == "holds"


REFUSED = {
    ("remedy.ds_buffer_m=-1",): "remedy.ds_buffer_m: input should be greater than or equal to 0, got -1",
    ("remedy.prediction_s=-0.1",): "remedy.prediction_s: input should be greater than or equal to 0",
    ("remedy.derate=0",): "remedy.derate: input should be greater than 0",
    ("remedy.derate=1.1",): "remedy.derate: input should be less than or equal to 1",
    ("remedy.issf_epsilon=0",): "remedy.issf_epsilon: input should be greater than 0",
    ("remedy.issf_v_mps=2",): "issf_v_mps: has no effect without issf_epsilon",
    (
        "remedy.issf_epsilon=1",
        "issf_v_mps=0",
        "issf_omega_degps=0",
        "issf_zeta_mps=0",
    ): "issf_epsilon: needs a scale above 0",
    ("remedy.prediction_s=0.3", "remedy.predict_lags=true"): "both predict the pose; set one of them",
    ("filter.kind=none", "remedy.prediction_s=0.3"): "remedy.prediction_s: filter 'none' cannot take it",
    ("filter.kind=navigation", "remedy.robust_v_mps=1"): "remedy.robust_v_mps: filter 'navigation' cannot",
    ("filter.kind=navigation", "remedy.air_mass=true"): "remedy.air_mass: filter 'navigation' cannot take it",
    ("filter.monitor=true", "remedy.prediction_s=0.3"): "remedy.prediction_s: filter.monitor checks",
    ("barrier.kind=straight", "remedy.derate=0.8"): "remedy.derate: a 'straight' barrier has no turn",
    ("barrier.kind=straight", "remedy.smoothing_m2=30"): "remedy.smoothing_m2: only a turn barrier",
    (
        "barrier.kind=euclidean",
        "remedy.predict_lags=true",
    ): "remedy.predict_lags: needs one evading",
    ("barrier.kind=euclidean", "remedy.derate_speed=0.9"): "remedy.derate_speed: a 'euclidean' barrier",
    (
        "plant=lagged",
        "lags.source=table",
        "lags.v_delay_s=-1",
    ): "lags.v_delay_s: input should be greater",
}


@pytest.mark.parametrize("overrides", REFUSED, ids=" ".join)
def test_a_remedy_that_cannot_be_is_one_line_that_names_it(overrides: tuple[str, ...]) -> None:
    with pytest.raises(UserError) as error:
        load("paper-2-turn", list(overrides))
    assert REFUSED[overrides] in str(error.value)
    assert "\n" not in str(error.value)


def test_an_air_frame_in_too_much_wind_is_one_line() -> None:
    with pytest.raises(UserError, match=r"remedy\.air_mass: a wind of 15 m/s is not slower than limits"):
        filter_of("remedy.air_mass=true", "wind.speed_mps=15")


def test_the_navigation_baseline_takes_a_prediction() -> None:
    made, _ = filter_of("filter.kind=navigation", "remedy.prediction_s=0.3")
    assert isinstance(made, Predicted)
