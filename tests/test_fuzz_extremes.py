"""The ends of every range, and angles in the wrong unit: a valid run, or one line with a hint."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from testbed.errors import UserError
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

BASE = ["checks.manoeuvre_instants=0"]
EXTREMES = {
    "one vehicle": ["vehicles=1", "duration_s=0.1"],
    "one vehicle for no time": ["vehicles=1", "duration_s=0"],
    "no time": ["duration_s=0"],
    "two hundred vehicles": ["vehicles=200", "radius_m=5000", "duration_s=0.01", "filter.kind=limited"],
    "two hundred, one QP": ["vehicles=200", "radius_m=5000", "duration_s=0.005"],
    "an hour": ["duration_s=3600", "fdm_dt_s=1", "filter_dt_s=1", "record_dt_s=1"],
    "dt 1e-4": ["duration_s=0.01", "fdm_dt_s=1e-4", "filter_dt_s=1e-4", "record_dt_s=1e-4"],
    "dt 1": ["duration_s=20", "fdm_dt_s=1", "filter_dt_s=1", "record_dt_s=1"],
    "Ds 0.01": ["d_safe_m=0.01", "duration_s=0.1"],
    "Ds 500": ["d_safe_m=500", "radius_m=2000", "duration_s=0.1"],
    "Ds 500 on the circle of 200": ["d_safe_m=500", "duration_s=0.1"],
    "every limit equal": [
        "v_min_mps=16", "v_max_mps=16", "omega_max_degps=0", "zeta_max_mps=0", "duration_s=1"
    ],
}  # fmt: skip


@pytest.mark.parametrize("what", EXTREMES)
def test_the_ends_of_the_ranges_are_flown(tmp_path: Path, what: str) -> None:
    s = load("paper-2-turn", [*BASE, *EXTREMES[what]])
    result = run(s, tmp_path / "r", force=True)
    assert result.manifest["ended_early"] is None
    steps = s.filter_steps // s.rates.record_steps + 1
    assert len(result.vehicles) == steps * s.vehicles
    # Of large fleets only near pairs are recorded, and on a circle of 5 km no two are near.
    near = "near_pairs" in result.manifest
    assert near == (s.vehicles > 150)
    assert len(result.pairs) == (0 if near else steps * (s.vehicles * (s.vehicles - 1) // 2))
    wanted = ["x_m", "y_m", "v_mps", "omega_command_radps"]
    for table, names in ((result.vehicles, wanted), (result.pairs, ["h_m"])):
        assert np.isfinite(table[names].to_numpy(dtype=float)).all()
    json.dumps([v.to_json() for v in result.guarantees], allow_nan=False)


def test_an_hour_at_the_papers_period_is_accepted() -> None:
    assert load("paper-20-turn", [*BASE, "plant=jsbsim", "duration_s=3600"]).filter_steps == 720_000


@pytest.mark.parametrize("field", ["limits.omega_max_degps", "barrier.omega_degps"])
@pytest.mark.parametrize("radians", [0.2269, 0.2042, -0.2042])
def test_radians_where_degrees_are_wanted_are_named_with_what_they_are(field: str, radians: float) -> None:
    if radians < 0 and field.startswith("limits"):
        pytest.skip("refused for its sign")
    with pytest.raises(UserError, match=f"{field}: .* if rad/s was meant, give {np.degrees(radians):.4g}"):
        load("paper-2-turn", [f"{field}={radians}"])


def test_degrees_twice_are_out_of_range() -> None:
    with pytest.raises(UserError, match="omega_max_degps: input should be less than or equal to 360"):
        load("paper-2-turn", [f"omega_max_degps={np.degrees(13)}"])


def test_a_number_of_thousands_of_digits_is_called_that(tmp_path: Path) -> None:
    file = tmp_path / "digits.toml"
    file.write_text("vehicles = " + "9" * 5000)
    with pytest.raises(UserError, match=r"digits\.toml: not valid TOML: a number with too many digits"):
        load(file)
