"""The ledger: what the unicycle predicts of h, what the motion makes of it, and which channel is to blame."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from filters.barriers.closed_form import TurnBarrier
from filters.model import Command, State
from testbed.measures.hdot_ledger import CHANNELS, channel_bounds, residuals, robust_settings, summary
from testbed.records.run import Run
from testbed.records.store import load as loaded
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

FAST = ["manoeuvre_instants=0"]


def residual(overrides: list[str]) -> np.ndarray:
    pairs = run(load("paper-2-turn", FAST + overrides)).pairs
    near = pairs[(pairs.h_m < 50) & pairs.hdot_realised_mps.notna()]
    return (near.hdot_realised_mps - near.hdot_predicted_mps).to_numpy()


def test_on_the_unicycle_the_residual_is_first_order_in_the_period() -> None:
    worst = [np.abs(residual([f"filter_dt_s={dt}", f"record_dt_s={dt}"])).max() for dt in (0.02, 0.01, 0.005)]
    assert worst[0] / worst[1] == pytest.approx(2.0, rel=0.15)
    assert worst[1] / worst[2] == pytest.approx(2.0, rel=0.15)


@pytest.fixture(scope="module")
def lagged() -> Run:
    """Two vehicles that are told to turn at gamma's rate and follow with a lag of 0.35 s and nothing else."""
    overrides = [
        "plant=lagged",
        "lags.source=table",
        "lags.v_time_constant_s=0",
        "lags.omega_time_constant_s=0.35",
        "lags.zeta_time_constant_s=0",
        "guidance.kind=manoeuvre",
        "filter.kind=none",
        "start.speed_mps=16",
        "course_offset_deg=10",
        "duration_s=3",
    ]
    return run(load("paper-2-turn", FAST + overrides))


def test_with_a_known_lag_the_residual_is_the_analytic_value(lagged: Run) -> None:
    rows, dt, lag = lagged.pairs.iloc[:-1], 0.005, 0.35
    omega = np.radians(11.7)
    # Both start straight: the turn rate lacks omega e^(-t/T), on average over the ends of a period
    t = rows.t_s.to_numpy()
    lacking = -omega * 0.5 * (np.exp(-t / lag) + np.exp(-(t + dt) / lag))
    barrier = TurnBarrier(16.0, omega, 5.0, 0.01)
    v = lagged.vehicles
    expected = []
    for k, instant in enumerate(t):
        at = v[v.t_s == instant]
        state = State(at.x_m.to_numpy(), at.y_m.to_numpy(), at.theta_rad.to_numpy(), at.z_m.to_numpy())
        lie_i, lie_j = barrier.values(state).lie(state)
        expected.append((lie_i[0, 1] + lie_j[0, 1]) * lacking[k])
    np.testing.assert_allclose(rows.residual_omega_mps, expected, rtol=1e-6, atol=1e-9)
    for name in ("v", "zeta", "course"):
        assert np.abs(rows[f"residual_{name}_mps"]).max() < 1e-9


def test_the_channels_add_up_to_the_residual(lagged: Run) -> None:
    rows = lagged.pairs.iloc[:-1]
    parts = sum(rows[f"residual_{name}_mps"] for name in CHANNELS)
    total = rows.hdot_realised_mps - rows.hdot_predicted_mps
    # what is left is of second order in 5 ms; the residual itself reaches tens of m/s at these ranges
    assert np.abs(total - parts).max() < 0.02 * np.abs(total).max()


def test_course_and_heading_split_the_turn_rates_error() -> None:
    lie = np.array([[1.0, 10.0, 0.5]]), np.array([[2.0, 20.0, 0.25]])
    i, j = np.array([0]), np.array([1])
    told, did = Command([20.0, 20.0], [0.1, 0.1], 0.0), Command([19.0, 20.0], [0.3, 0.1], [0.0, 2.0])
    drift = np.array([0.05, 0.0])
    parts = residuals(lie, i, j, told, did, did, drift)
    assert parts["residual_v_mps"] == pytest.approx(-1.0)
    assert parts["residual_omega_mps"] == pytest.approx(10 * 0.15)
    assert parts["residual_course_mps"] == pytest.approx(10 * 0.05)
    assert parts["residual_zeta_mps"] == pytest.approx(0.25 * 2.0)


def test_the_summary_names_the_worst_moments(lagged: Run) -> None:
    found = summary(lagged, near_h_m=1e6)
    assert found["rows"] == len(lagged.pairs) - 1
    total = lagged.pairs.hdot_realised_mps - lagged.pairs.hdot_predicted_mps
    assert found["worst"][0]["residual_mps"] == pytest.approx(total.min())
    assert found["quantiles"]["total"]["0.5"] == pytest.approx(total.median())
    assert summary(lagged, near_h_m=-1e6)["rows"] == 0


def test_channel_bounds_are_those_of_the_tracking_errors(lagged: Run) -> None:
    bounds = channel_bounds(lagged)
    assert bounds["omega"] == pytest.approx(np.radians(11.7))
    assert bounds["v"] < 1e-9


def test_on_the_aircraft_the_turn_rate_lag_is_what_drains_h() -> None:
    result = run(load("paper-2-turn", [*FAST, "plant=jsbsim", "duration_s=9"]))
    found = summary(result)
    assert found["quantiles"]["total"]["0.01"] < -5.0
    worst = found["worst"][0]
    assert worst["omega"] < worst["v"] and worst["omega"] < 0.5 * worst["residual_mps"]


def test_worst_moments_are_half_a_second_apart_and_add_up(lagged: Run) -> None:
    worst = summary(lagged, near_h_m=1e6)["worst"]
    assert len(worst) == 5
    t = np.sort([moment["t_s"] for moment in worst])
    assert np.diff(t).min() >= 0.5
    for moment in worst:
        parts = sum(moment[name] for name in (*CHANNELS, "rest"))
        assert parts == pytest.approx(moment["residual_mps"])


def test_bounds_near_are_those_of_the_vehicles_that_met(lagged: Run) -> None:
    # all but the last instant, at which no motion is known yet; the error falls from the first
    assert channel_bounds(lagged, near_h_m=1e6) == channel_bounds(lagged)
    assert np.isnan(channel_bounds(lagged, near_h_m=-1e6)["omega"])


def test_a_ledgers_bounds_become_the_filters_margins_without_copying(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    flown = tmp_path / "run"
    quick = [
        "--plant",
        "lagged",
        "--set",
        "lookahead_m=10",
        "--set",
        "duration_s=9",
        "--set",
        "manoeuvre_instants=0",
    ]
    assert (
        call(
            "run",
            "paper-2-turn",
            *quick,
            "--set",
            "filter_dt_s=0.02",
            "--set",
            "record_dt_s=0.02",
            "--out",
            flown,
        )
        == 0
    )
    capsys.readouterr()
    assert call("ledger", flown, "--settings", "--quantile", "0.9") == 0
    printed = capsys.readouterr().out.split()
    assert not (tmp_path / "run-ledger").exists()
    s = load("paper-2-turn", printed[1::2])
    bounds = channel_bounds(loaded(flown), 0.9, 10.0)
    assert s.remedy.robust_omega_degps == pytest.approx(np.degrees(bounds["omega"]), rel=1e-3)
    assert s.remedy.robust_v_mps == pytest.approx(robust_settings(bounds)["remedy.robust_v_mps"], rel=1e-3)

    assert call("ledger", flown, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    folder = tmp_path / "run-ledger"
    table = pd.read_csv(folder / "quantiles.csv", index_col="channel")
    assert table.loc["total", "0"] == pytest.approx(found["quantiles"]["total"]["0"])
    assert pd.read_csv(folder / "worst.csv").residual_mps[0] == pytest.approx(table.loc["total", "0"])
    assert (folder / "ledger.png").stat().st_size > 10_000
    assert call("ledger", flown) == 2
    assert "exists; give another --out, or --overwrite" in capsys.readouterr().err
    assert call("ledger", flown, "--overwrite") == 0
    text = capsys.readouterr().out
    assert "worst moments [m/s]" in text and "remedy.robust_omega_degps" in text


def test_mistakes_with_a_ledger_are_one_line(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("ledger", tmp_path) == 2
    assert "holds no finished run" in capsys.readouterr().err
    (tmp_path / "comparison.json").write_text("{}")
    (tmp_path / "unicycle").mkdir()
    (tmp_path / "unicycle" / "manifest.json").write_text("{}")
    assert call("ledger", tmp_path) == 2
    assert "holds several runs; name one of them: unicycle" in capsys.readouterr().err
