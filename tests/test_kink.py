"""The kink study: what its cases fly, what its rows say, that it resumes, and the kink itself."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from testbed.campaigns.engine import fly_all
from testbed.campaigns.journal import journal_beside
from testbed.components.initial_conditions import generators, places
from testbed.simulation.simulate import run
from testbed.studies.kink import kink
from testbed.studies.paper.paper import make

SHORT = ("duration_s=0.2",)


def test_the_cases_are_every_barrier_period_and_seed() -> None:
    cases = kink.perturbed(3)
    assert len(cases) == len(set(cases)) == 2 * 3 * 3
    for case in cases:
        s = case.scenario()
        assert (s.vehicles, s.filter.kind, s.plant) == (20, "limited", "unicycle")
        assert s.rates.fdm_dt_s == s.rates.filter_dt_s == case.dt_s and s.seed == case.seed
        assert s.start.heading_perturbation_deg == 5.0 and s.duration_s == 20.0
        expected = (0.01, 0.0) if case.barrier == "paper" else (0.0, 30.0)
        assert (s.barrier.delta_m2, s.barrier.smoothing_m2) == expected
    crowd = kink.crowded(20)
    assert [(c.barrier, c.heading_deg) for c in crowd[:2]] == [("paper", 0.0), ("smoothed", 0.0)]
    assert len(crowd) == 2 + 2 * 3 and all(c.heading_deg == 1e-6 for c in crowd[2:])
    for case in crowd:
        s = case.scenario()
        assert (s.vehicles, s.filter.kind, s.start.radius_m) == (50, "centralised", 200.0)
        assert s.start.heading_perturbation_deg <= 1e-6 and s.rates.filter_dt_s == 0.005


def test_a_seed_starts_both_barriers_alike_at_every_period() -> None:
    def headings(case: kink.Case) -> np.ndarray:
        s = case.scenario()
        return np.asarray(places(s, generators(s.seed)["start"])[0].theta)

    first = headings(kink.Case("paper", 0.005, 1))
    assert np.array_equal(first, headings(kink.Case("smoothed", 0.02, 1)))
    off = np.degrees(first - np.arange(20) * 2 * np.pi / 20)
    assert np.abs(off).max() <= 5.0 and np.abs(off).max() > 2.5
    assert not np.allclose(first, headings(kink.Case("paper", 0.005, 2)))


def test_a_row_is_what_the_run_met() -> None:
    case = kink.Case("paper", 0.02, 3, overrides=SHORT)
    row = kink.row(case)
    pairs = run(case.scenario("record_dt_s=0.02")).pairs
    closest = pairs.loc[pairs.distance_m.idxmin()]
    assert row["min_distance_m"] == pytest.approx(closest.distance_m, abs=1e-12)
    assert (row["i"], row["j"]) == (closest.i, closest.j)
    assert row["min_distance_at_s"] == pytest.approx(closest.t_s)
    assert row["min_h_m"] == pytest.approx(pairs.h_m.min(), abs=1e-12)
    assert row["infeasible"] == 0


@pytest.mark.slow
def test_the_paper_barrier_is_drained_where_the_smoothed_one_holds() -> None:
    def fly(barrier: str) -> dict[str, Any]:
        return kink.row(kink.Case(barrier, 0.02, 4, overrides=("duration_s=11",)))

    paper, smoothed = fly("paper"), fly("smoothed")
    # every QP was solved, and still: 3.6 m against 6.1 m
    assert paper["infeasible"] == smoothed["infeasible"] == 0
    assert paper["min_distance_m"] < 4.5 and paper["min_h_m"] < -0.5
    assert smoothed["min_distance_m"] > 6.0 and smoothed["min_h_m"] > 1.0


def test_at_equal_headings_one_barrier_has_a_kink_and_the_other_none() -> None:
    apart, step = 9.0, 0.1
    h = kink.over_heading(apart, np.array([-step, 0.0, step]))
    bend = {name: (v[2] - 2 * v[1] + v[0]) / math.radians(step) for name, v in h.items()}
    # |Z| = 2 |D| |q| turns by twice the radius of 16 m/s at 11.7 deg/s, whatever the step
    radius = 16 / math.radians(11.7)
    assert bend["paper"] == pytest.approx(-2 * radius, rel=0.02)
    assert abs(bend["smoothed"]) < 0.1 * radius
    assert h["smoothed"][1] == pytest.approx(math.sqrt(apart**2 - 30) - 5)
    assert h["paper"][1] == pytest.approx(apart - 5, abs=0.01)
    wide = kink.over_heading(apart, np.linspace(-20, 20, 41))
    assert np.all(wide["smoothed"] <= wide["paper"] + 0.01)


def test_what_h_lost_is_its_promise_less_its_change() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.3])
    flat = np.zeros((2, 4))
    look = kink.Look(
        kink.Case("paper", 0.1, 1), 1, 2, t, flat, flat[0], 3.0 - 2.0 * t, np.full(4, -0.5), flat[0]
    )
    assert np.allclose(look.lost_m(), 1.5 * t)


def test_the_summary_counts_runs_that_lost_ds_or_h() -> None:
    rows = pd.DataFrame(
        {
            "vehicles": 20,
            "heading_deg": 5.0,
            "barrier": ["paper", "paper", "smoothed"],
            "dt_s": 0.01,
            "seed": [1, 2, 1],
            "min_distance_m": [4.9, 6.0, 6.1],
            "min_h_m": [-0.2, -0.1, 1.0],
            "infeasible": [0, 3, 0],
            "worst_qp_residual": [1e-9, 1e-8, 0.0],
        }
    )
    paper, smoothed = kink.summary(rows, 5.0).to_dict("records")
    assert (paper["runs"], paper["below_ds"], paper["below_h0"], paper["no_solution"]) == (2, 1, 2, 3)
    assert (paper["least_m"], paper["least_h_m"]) == (4.9, -0.2)
    assert (smoothed["below_ds"], smoothed["below_h0"]) == (0, 0)
    cases = [kink.Case(b, 0.01, s) for b, s in (("paper", 1), ("paper", 2), ("smoothed", 1))]
    assert kink.worst(rows, cases, 5.0) == cases[0]


def test_an_interrupted_study_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = [kink.Case("paper", 0.02, seed) for seed in (1, 2, 3)]
    flown: list[int] = []

    def row(case: kink.Case) -> dict[str, Any]:
        if case.seed == 3 and flown == [1, 2]:
            raise KeyboardInterrupt
        flown.append(case.seed)
        return {"seed": case.seed, "min_distance_m": 6.0, "min_h_m": 1.0}

    monkeypatch.setattr(kink, "row", row)
    with pytest.raises(KeyboardInterrupt), journal_beside(tmp_path / "k", "kink") as book:
        kink.study(cases, book, workers=1)
    assert len(list(tmp_path.iterdir())) == 1
    flown.append(0)
    with journal_beside(tmp_path / "k", "kink") as book:
        table = kink.study(cases, book, workers=1)
    assert flown == [1, 2, 0, 3] and list(table.seed) == [1, 2, 3]
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_processes_answer_in_the_order_asked() -> None:
    assert fly_all(math.sqrt, [16.0, 4.0, 9.0], workers=2) == [4.0, 2.0, 3.0]


@pytest.mark.slow
def test_the_study_writes_its_table_and_figures(tmp_path: Path) -> None:
    out = tmp_path / "kink"
    book = make(out, ["kink"], overrides=SHORT, seeds=1, workers=1)
    table = pd.read_csv(out / "kink.csv")
    assert len(table) == 6 and not table.duplicated(["barrier", "dt_s", "seed"]).any()
    named = {"min_distance_m", "min_distance_at_s", "i", "j", "min_h_m", "min_h_at_s", "infeasible"}
    assert named <= set(table.columns)
    assert list(pd.read_csv(out / "kink-50.csv").vehicles) == [50] * 4
    assert len(book.tables["the kink"]) == 6 + 4
    for name in ("kink-mechanism", "kink-seeds"):
        for kind in ("png", "pdf"):
            assert (out / f"{name}.{kind}").stat().st_size > 10_000
    assert [p.name for p in tmp_path.iterdir()] == ["kink"]
