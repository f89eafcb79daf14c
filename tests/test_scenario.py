"""Scenario files: what they accept, and the one line they answer with to what they do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from testbed.components.initial_conditions import generators, places
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario, builtin, load


@pytest.mark.parametrize("name", sorted(builtin()))
def test_every_built_in_scenario_loads_under_its_own_name(name: str) -> None:
    assert load(name).name == name


def test_defaults_are_the_papers_settings() -> None:
    s = load("paper-2-turn")
    assert (s.limits.v_min_mps, s.limits.v_max_mps) == (15.0, 25.0)
    assert (s.limits.omega_max_degps, s.limits.zeta_max_mps) == (13.0, 3.9)
    assert s.barrier.v_mps == pytest.approx(0.9 * 15 + 0.1 * 25)
    assert s.barrier.omega_degps == pytest.approx(0.9 * 13)
    assert (s.d_safe_m, s.barrier.delta_m2, s.alpha.kind, s.alpha.coefficient) == (5.0, 0.01, "cubic", 0.1)


BAD = {
    "vehicles=two": "vehicles: input should be a valid integer, got 'two'",
    "limits.v_min_mps=30": "limits: v_min_mps 30 is above v_max_mps 25",
    "d_safe_m=0": "d_safe_m: input should be greater than 0, got 0",
    "d_safe_m=-1": "d_safe_m: input should be greater than 0, got -1",
    "d_safe_m=nan": "d_safe_m: input should be a finite number",
    "rates.filter_dt_s=0.012": "0.012 s is not a multiple of the FDM period 0.005 s; try 0.01 or 0.015",
    "rates.record_dt_s=0.012": "record period 0.012 s is not a multiple of the FDM period 0.005 s",
    "plant=glider": "plant: input should be 'unicycle'",
    "plnt=unicycle": "--set plnt: unknown field; did you mean plant?",
    "duration_s=20.001": "20.001 s is not a multiple of the filter period 0.005 s; try 20 or 20.005",
    "barrier.omega_degps=0": "omega_degps: a turn needs a turn rate other than zero",
    "seed=1.5": "seed: input should be a valid integer",
    "vehicles=true": "vehicles: input should be a valid integer",
    "barrier.kind=rollout": "manoeuvres: a rollout needs at least one manoeuvre",
    "alpha.kind=odd-polynomial": "coefficients: an odd polynomial needs at least one positive coefficient",
    "rates=1": "rates",
    "radius_m": "write field=value",
}


@pytest.mark.parametrize("override", BAD)
def test_a_bad_value_is_one_line_with_the_fields_path(override: str) -> None:
    with pytest.raises(UserError) as error:
        load("paper-2-turn", [override])
    assert BAD[override] in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_scenario_names_the_nearest() -> None:
    with pytest.raises(UserError, match="did you mean paper-2-turn"):
        load("paper-2-tern")


def test_an_unknown_key_in_a_file_names_its_path_and_the_nearest(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\nvehicles = 2\n[limits]\nv_mn_mps = 3.0\n')
    with pytest.raises(
        UserError, match=r"mine\.toml: limits\.v_mn_mps: unknown field; did you mean v_min_mps"
    ):
        load(file)


def test_a_file_that_is_no_toml_or_is_missing_says_so(tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text("name = ")
    with pytest.raises(UserError, match="not valid TOML"):
        load(file)
    with pytest.raises(UserError, match="does not exist"):
        load(tmp_path / "none.toml")


def test_overrides_take_dotted_paths_short_names_and_toml_values() -> None:
    s = load("paper-2-turn", ["start.radius_m=100", "vehicles=5", "heights_m=[1, 2.5]"])
    assert (s.start.radius_m, s.vehicles, s.start.heights_m) == (100.0, 5, [1.0, 2.5])
    with pytest.raises(UserError, match=r"could be guidance\.kind or filter\.kind or barrier\.kind or"):
        load("paper-2-turn", ["kind=cubic"])


def test_vehicles_face_the_centre_of_the_circle_and_their_goal_is_opposite() -> None:
    s = load("paper-2-turn", ["vehicles=7"])
    state, goal = places(s, generators(1)["start"])
    assert np.allclose(np.hypot(state.x, state.y), 200.0)
    assert np.allclose(state.x + 200 * np.cos(state.theta), 0.0)
    assert np.allclose(goal[:, :2], -np.stack([state.x, state.y], -1))
    assert (state.x[0], state.theta[0]) == (pytest.approx(-200.0), 0.0)


def test_published_starts_are_rounded_to_two_decimals_heading_in_degrees() -> None:
    s = load("published-20-turn", ["vehicles=7"])
    state, _ = places(s, generators(1)["start"])
    for values in (state.x, state.y, np.degrees(state.theta)):
        assert np.allclose(values, np.round(values, 2), atol=1e-12)
    assert not np.allclose(state.x[1], 200 * np.cos(np.pi + 2 * np.pi / 7), atol=1e-6)


def test_perturbations_stay_inside_their_bounds_and_follow_the_seed() -> None:
    overrides = [
        "vehicles=50",
        "lateral_perturbation_m=10",
        "heading_perturbation_deg=5",
        "height_perturbation_m=1",
    ]
    s, plain = load("paper-2-turn", overrides), load("paper-2-turn", ["vehicles=50"])
    a, _ = places(s, generators(1)["start"])
    b, _ = places(s, generators(1)["start"])
    c, _ = places(s, generators(2)["start"])
    exact, _ = places(plain, generators(1)["start"])
    assert np.array_equal(a.array(), b.array())
    assert not np.allclose(a.array(), c.array())
    heading = np.degrees(a.theta - exact.theta)
    offset = np.hypot(a.x - exact.x, a.y - exact.y)
    along = (a.x - exact.x) * np.cos(exact.theta) + (a.y - exact.y) * np.sin(exact.theta)
    assert 4 < np.abs(heading).max() <= 5
    assert 8 < offset.max() <= 10
    assert np.abs(along).max() < 1e-9
    assert 0.8 < np.abs(a.z).max() <= 1


def test_offsets_move_the_vehicles_that_they_are_listed_for() -> None:
    plain, _ = places(load("paper-2-turn"), generators(1)["start"])
    lists = ["lateral_offsets_m=[3.0, 0.0]", "heading_offsets_deg=[0.0, -4.0]", "height_offsets_m=[0.0, 2.0]"]
    moved, _ = places(load("paper-2-turn", lists), generators(1)["start"])
    # Vehicle 1 flies east: to its left is north
    assert moved.array()[0] == pytest.approx(plain.array()[0] + [0.0, 3.0, 0.0, 0.0])
    assert moved.array()[1] == pytest.approx(plain.array()[1] + [0.0, 0.0, np.radians(-4.0), 2.0])
    drawn = ["heading_perturbation_deg=5", "seed=3"]
    alone, _ = places(load("paper-2-turn", drawn), generators(3)["start"])
    both, _ = places(load("paper-2-turn", drawn + lists), generators(3)["start"])
    assert np.degrees(both.theta - alone.theta) == pytest.approx([0.0, -4.0])


@pytest.mark.parametrize("name", ["lateral_offsets_m", "heading_offsets_deg", "height_offsets_m"])
def test_offsets_are_listed_for_every_vehicle_or_none(name: str) -> None:
    with pytest.raises(UserError, match=rf"start.{name}: 3 offsets for 2 vehicles"):
        load("paper-2-turn", [f"{name}=[1.0, 2.0, 3.0]"])


def test_a_heading_offset_beyond_half_a_turn_is_refused() -> None:
    with pytest.raises(UserError, match=r"heading_offsets_deg.*180"):
        load("paper-2-turn", ["heading_offsets_deg=[200.0, 0.0]"])


def test_a_resolved_scenario_reads_back_as_itself() -> None:
    for name in builtin():
        s = load(name)
        assert Scenario.model_validate(s.model_dump(mode="json")) == s
