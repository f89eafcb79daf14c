"""Scenarios with several airframes, and the lagged plant that stands for them."""

import math

import numpy as np
import pytest

from aircraft.airframe import load as airframe
from testbed.components import catalogue
from testbed.errors import UserError
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

MIXED = 'airframes=["x8","rascal"]'


def test_different_airframes_fly_in_one_scenario() -> None:
    flown = run(load("paper-2-turn", ["plant=jsbsim", MIXED, "duration_s=3"]))
    assert set(flown.manifest["airframes"]) == {"x8", "rascal"}
    last = flown.vehicles[flown.vehicles.t_s == flown.vehicles.t_s.max()].set_index("vehicle")
    assert np.all(last.v_mps > 22)  # both speed up towards their goals
    # each has its own surfaces, and none of the other's
    assert math.isfinite(last.elevon_left_rad[1]) and math.isnan(last.rudder_rad[1])
    assert math.isnan(last.elevon_left_rad[2]) and math.isfinite(last.rudder_rad[2])


def test_every_vehicle_of_a_lagged_plant_lags_as_its_airframe() -> None:
    lags = catalogue.lags(load("paper-2-turn", ["plant=lagged", MIXED]))
    for name, (v, omega, _) in zip(("x8", "rascal"), lags, strict=True):
        known = airframe(name).identified
        assert known is not None
        assert (v.time_constant_s, v.rate_max) == (known.v.time_constant_s, known.v.rate_max)
        assert omega.delay_s == known.omega.delay_s
    assert lags[0] != lags[1]


def test_a_lagged_run_names_the_airframes_it_depends_on() -> None:
    assert set(catalogue.airframe_hashes(load("paper-2-turn", ["plant=lagged", MIXED]))) == {"x8", "rascal"}
    assert catalogue.airframe_hashes(load("paper-2-turn", ["plant=lagged", "lags.source=table"])) == {}


def test_without_limits_only_lags_and_delays_are_left() -> None:
    ((v, omega, zeta), *_) = catalogue.lags(load("paper-2-turn", ["plant=lagged", "lags.limits=false"]))
    for lag in (v, omega, zeta):
        assert (lag.rate_min, lag.rate_max) == (-math.inf, math.inf) and lag.time_constant_s > 0
    table = ["plant=lagged", "lags.source=table", "lags.v_rise_max_mps2=2"]
    assert catalogue.lags(load("paper-2-turn", table))[0][0].rate_max == 2.0
    assert catalogue.lags(load("paper-2-turn", [*table, "lags.limits=false"]))[0][0].rate_max == math.inf


def test_the_table_keeps_the_lags_it_always_had() -> None:
    ((v, omega, zeta),) = catalogue.lags(load("paper-2-turn", ["plant=lagged", "lags.source=table"]))
    assert [c.time_constant_s for c in (v, omega, zeta)] == [1.0, 0.35, 0.3]


@pytest.mark.parametrize("field", ["omega_time_constant_s=0.35", "zeta_delay_s=0.1", "v_fall_max_mps2=1"])
def test_a_number_in_the_table_that_nothing_would_read_is_refused(field: str) -> None:
    with pytest.raises(UserError, match=r"has no effect on lags that the airframe says; source = 'table'"):
        load("paper-2-turn", ["plant=lagged", f"lags.{field}"])


def test_an_airframe_without_identified_channels_cannot_lag(tmp_path) -> None:
    text = (airframe("x8").folder / "airframe.toml").read_text()
    (tmp_path / "airframe.toml").write_text(text[: text.index("[identified]")])
    s = load("paper-2-turn", ["plant=lagged", f'airframes=["{tmp_path.as_posix()}"]'])
    with pytest.raises(UserError, match="x8 has no identified channels; run: testbed aircraft identify"):
        catalogue.lags(s)
