"""Disturbed flights: the same air for every plant, verdicts on the truth, equal files for equal seeds."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from filters.model import State
from testbed.errors import UserError
from testbed.records.run import WIND_COLUMNS
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

WIND = list(WIND_COLUMNS)
ALL = [
    "wind.speed_mps=4",
    "wind.towards_deg=70",
    "shear_exponent=0.14",
    "intensity=moderate",
    "position_noise_m=0.5",
    "course_drift_deg=1",
    "speed_bias_mps=0.2",
    "delay_s=0.02",
    "latency_s=0.13",
    "loss=0.2",
]
# One vehicle flying east at 20 m/s.
STRAIGHT = ["filter.kind=none", "controller=manoeuvre", "vehicles=1", "barrier.kind=straight"]
STRAIGHT += ["barrier.v_mps=20", "speed_step=0"]
# A filter slow enough that the air is asked between its steps.
SLOW = ["filter_dt_s=0.1", "record_dt_s=0.1"]


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["unicycle", "jsbsim"])
@pytest.mark.parametrize("kind", ["centralised", "limited"])
def test_equal_disturbed_scenarios_give_equal_files(tmp_path: Path, plant: str, kind: str) -> None:
    settings = [*ALL, *SLOW, f"plant={plant}", f"filter.kind={kind}", "duration_s=1"]
    folders = [tmp_path / name for name in "ab"]
    for folder in folders:
        run(load("paper-2-turn", settings), folder)
    for name in ("manifest.json", "vehicles.parquet", "pairs.parquet", "guarantees.json"):
        a, b = (hashlib.sha256((folder / name).read_bytes()).hexdigest() for folder in folders)
        assert a == b, name


@pytest.mark.slow
def test_a_still_unicycle_and_an_aircraft_meet_the_same_air() -> None:
    """The recorded wind is a function of time and place: evaluated anew at the recorded places, it agrees."""
    from testbed.components.initial_conditions import generators
    from testbed.environment.disturbance import build

    settings = ["wind.speed_mps=4", "intensity=severe", "duration_s=2", "record_dt_s=0.5", "vehicles=3"]
    first = {}
    for plant in ("unicycle", "jsbsim"):
        s = load("paper-2-turn", [*settings, f"plant={plant}"])
        flown = run(s, force=True).vehicles
        air = build(s, generators(s.seed))
        for t, rows in flown.groupby("t_s"):
            state = State(rows.x_m, rows.y_m, rows.theta_rad, rows.z_m)
            assert np.allclose(rows[WIND].to_numpy(), air.wind(float(t), state), atol=1e-12)  # type: ignore[arg-type]
        first[plant] = flown[flown.t_s == 0][WIND].to_numpy()
    # An aircraft starts where the unicycle does, to some 10 um; fields of other seeds differ by m/s.
    assert np.allclose(first["unicycle"], first["jsbsim"], atol=1e-4)
    assert np.abs(first["jsbsim"] - [4.0, 0.0, 0.0]).max() > 0.1


def test_wind_columns_stand_in_windy_runs_only() -> None:
    calm = run(load("paper-2-turn", ["duration_s=0.1", "position_noise_m=1"])).vehicles
    windy = run(load("paper-2-turn", ["duration_s=0.1", "updraft_mps=1"])).vehicles
    assert not set(WIND) & set(calm.columns)
    assert np.array_equal(windy[WIND].to_numpy(), np.tile([0.0, 0.0, 1.0], (len(windy), 1)))


@pytest.mark.slow
def test_a_unicycle_flies_over_the_ground_whatever_the_wind() -> None:
    calm = run(load("paper-2-turn", ["duration_s=3"]))
    windy = run(load("paper-2-turn", ["duration_s=3", "wind.speed_mps=9", "intensity=severe"]))
    assert calm.guarantees == windy.guarantees
    assert windy.vehicles.drop(columns=WIND).equals(calm.vehicles)


def test_a_lagged_unicycle_feels_a_gust_and_corrects_it() -> None:
    base = ["plant=lagged", "duration_s=3", *STRAIGHT]
    calm = run(load("paper-2-turn", base)).vehicles
    steady = run(load("paper-2-turn", [*base, "wind.speed_mps=6", "wind.towards_deg=90"])).vehicles
    gusty = run(load("paper-2-turn", [*base, "intensity=moderate"])).vehicles
    # It starts in the steady wind, so that changes nothing; gusts do.
    assert np.allclose(steady.y_m, calm.y_m, atol=1e-9)
    moved = np.abs(gusty.y_m - calm.y_m).max()
    assert 1e-3 < moved < 10.0


@pytest.mark.slow
@pytest.mark.parametrize("towards", [90, -90, 0, 180])
def test_an_x8_in_steady_wind_keeps_ground_speed_and_course(towards: int) -> None:
    wind = ["wind.speed_mps=6", f"wind.towards_deg={towards}"]
    flown = run(load("paper-2-turn", ["plant=jsbsim", "duration_s=8", *STRAIGHT, *wind])).vehicles
    # Started trimmed, it stays so: healthy 0.01 m/s, 0.01 deg and 0.05 m; untrimmed, 2 m/s and 17 deg.
    assert np.abs(flown.v_mps - 20.0).max() < 0.05
    assert np.abs(np.degrees(flown.theta_rad)).max() < 0.1
    assert np.abs(flown.y_m).max() < 0.2
    assert flown.x_m.iloc[-1] == pytest.approx(-200.0 + 20.0 * 8.0, abs=0.3)
    crab = np.degrees(flown.heading_rad - flown.theta_rad).to_numpy()
    across, against = -6.0 * np.sin(np.radians(towards)), 20.0 - 6.0 * np.cos(np.radians(towards))
    assert np.allclose(crab, np.degrees(np.arctan2(across, against)), atol=0.1)  # 16.7 deg in the crosswind


def test_a_start_that_no_aircraft_can_fly_in_that_wind_is_one_line() -> None:
    settings = ["plant=jsbsim", "wind.speed_mps=80", "vehicles=1"]
    with pytest.raises(UserError, match=r"^start: x8 cannot fly steadily at ground speed 20 m/s") as error:
        run(load("paper-2-turn", settings))
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_verdicts_use_the_truth_where_the_filter_saw_something_else() -> None:
    """A filter that sees vehicles 1 s ago believes in another h; h_m is that of the poses recorded."""
    from testbed.components import catalogue

    for kind in ("centralised", "limited"):
        s = load("paper-2-turn", ["delay_s=1", "duration_s=6", "record_dt_s=0.5", f"filter.kind={kind}"])
        result = run(s)
        barrier = catalogue.barrier(s)
        for t, rows in result.vehicles.groupby("t_s"):
            pair = result.pairs[result.pairs.t_s == t].iloc[0]
            true = barrier.values(State(rows.x_m, rows.y_m, rows.theta_rad, rows.z_m)).h[0]  # type: ignore[arg-type]
            assert pair.h_m == pytest.approx(true, abs=1e-9)
        assert np.abs(result.pairs.h_m - result.pairs.h_filter_m).max() > 1.0
        late = np.interp(2.0, result.pairs.t_s, result.pairs.h_m)
        assert np.interp(3.0, result.pairs.t_s, result.pairs.h_filter_m) == pytest.approx(late, abs=1e-9)


def test_the_nominal_controller_steers_by_what_a_vehicle_knows_of_itself() -> None:
    settings = ["delay_s=0.5", "duration_s=2", "filter.kind=none", "course_offset_deg=30", "record_dt_s=0.1"]
    late = run(load("paper-2-turn", settings)).vehicles.query("vehicle == 1").set_index("t_s")
    from testbed.components import catalogue
    from testbed.components.initial_conditions import generators, places

    s = load("paper-2-turn", settings)
    _, goal = places(s, generators(s.seed)["start"])
    nominal = catalogue.nominal(s, goal, catalogue.barrier(s))
    then = late.iloc[10]
    state = State([then.x_m] * 2, [then.y_m] * 2, [then.theta_rad] * 2, [then.z_m] * 2)
    wanted = nominal(0.0, state)
    assert late.iloc[15].omega_nominal_radps == pytest.approx(wanted.omega[0], abs=1e-12)


@pytest.mark.slow
def test_limited_communication_flies_on_each_vehicles_own_view() -> None:
    lost = run(load("paper-2-turn", ["filter.kind=limited", "loss=1", "duration_s=12"]), force=True)
    fine = run(load("paper-2-turn", ["filter.kind=limited", "duration_s=12"]))
    # Each believes the other still at its start, behind the place where they meet.
    assert fine.guarantee("separation")["value"] > 5.0
    assert lost.guarantee("separation")["value"] < fine.guarantee("separation")["value"] - 1.0


def test_a_long_filter_period_asks_for_the_air_between_its_steps() -> None:
    """With the filter at 0.5 s a lagged plant still meets the wind at 0.05 s, so its path hardly changes."""
    from testbed.components import catalogue
    from testbed.components.initial_conditions import generators
    from testbed.environment.disturbance import build
    from testbed.simulation.simulate import _advance

    s = load("paper-2-turn", ["filter_dt_s=0.5", "record_dt_s=0.5", "intensity=severe"])
    asked: list[float] = []

    class Spy:
        windy = True

        def wind(self, t: float, state: State) -> np.ndarray:
            asked.append(t)
            return build(s, generators(1)).wind(t, state)

    from testbed.components.initial_conditions import places

    start, _ = places(s, generators(1)["start"])
    plant = catalogue.plant(s)
    plant.reset(start, generators(1)["plant"])
    command = plant.achieved()
    track = _advance(plant, Spy(), command, 1.0, np.zeros((2, 3)), 100)  # type: ignore[arg-type]
    assert track.shape == (100, 2, 3)
    assert asked == pytest.approx(np.arange(1.05, 1.5, 0.05))
    assert np.allclose(np.diff(track[:, 0, 0]), 20.0 * 0.005)


@pytest.mark.slow
def test_jsbsims_own_turbulence_follows_the_seed_and_differs_between_aircraft() -> None:
    settings = ["plant=jsbsim", "jsbsim_turbulence=moderate", "duration_s=2", "record_dt_s=0.1"]
    first, again, other = (
        run(load("paper-2-turn", [*settings, f"seed={seed}"])).vehicles for seed in (1, 1, 2)
    )
    assert first.equals(again)
    assert np.abs(first.v_mps - other.v_mps).max() > 0.01
    one, two = (first[first.vehicle == v].airspeed_mps.to_numpy() for v in (1, 2))
    assert np.abs(one - two).max() > 0.05  # in calm the two are mirror images, apart by 1e-6


def test_jsbsims_own_turbulence_is_refused_elsewhere() -> None:
    with pytest.raises(UserError, match=r"gusts\.jsbsim_turbulence: plant 'unicycle' has none; gusts\.inten"):
        load("paper-2-turn", ["jsbsim_turbulence=light"])
