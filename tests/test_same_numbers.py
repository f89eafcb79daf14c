"""The comparison of two checkouts finds a moved number and a changed word, and nothing else."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from benchmarks import same_numbers

VEHICLES = {
    "t_s": [0.0, 0.0, 1.0],
    "vehicle": [1, 2, 1],
    "x_m": [0.5, -3e4, 2.0],
    "qp_status": ["", "a", "b"],
}
VERDICT = {
    "id": "separation",
    "value": 6.5,
    "t_s": 7.5,
    "verdict": "holds",
    "why": "",
    "claim": "apart",
    "vehicles": [1, 2],
}


def produced(folder: Path, changes: dict[str, Any] | None = None, **verdict: Any) -> Path:
    run = folder / "run-small"
    run.mkdir(parents=True)
    pd.DataFrame(VEHICLES | (changes or {})).to_parquet(run / "vehicles.parquet")
    (run / "guarantees.json").write_text(json.dumps([VERDICT | verdict]), encoding="utf-8")
    return folder


def compared(tmp_path: Path, changes: dict[str, Any] | None = None, **verdict: Any) -> same_numbers.Moved:
    before, after = produced(tmp_path / "before"), produced(tmp_path / "after", changes, **verdict)
    report = same_numbers.compare(before, after)
    assert len(report) == 2
    return report["run-small/vehicles.parquet" if changes else "run-small/guarantees.json"]


def test_equal_folders_have_no_change(tmp_path: Path) -> None:
    moved = compared(tmp_path)
    assert not moved.any and moved.numbers == 6


def test_a_number_moved_by_more_than_the_tolerance_is_found(tmp_path: Path) -> None:
    moved = compared(tmp_path, {"x_m": [0.5, -3e4 * (1 + 3e-12), 2.0]})
    assert moved.any and moved.where == "x_m" and moved.largest == pytest.approx(3e-12, rel=1e-3)


def test_rounding_is_no_change(tmp_path: Path) -> None:
    assert not compared(tmp_path, {"x_m": [0.5, -3e4 * (1 + 1e-14), 2.0]}).any


def test_a_number_that_became_nan_is_found(tmp_path: Path) -> None:
    assert compared(tmp_path, {"x_m": [0.5, float("nan"), 2.0]}).words == ["x_m"]


def test_a_changed_status_is_found(tmp_path: Path) -> None:
    assert compared(tmp_path, {"qp_status": ["", "a", "c"]}).words == ["qp_status"]


def test_the_order_of_rows_is_no_change(tmp_path: Path) -> None:
    turned = {name: values[::-1] for name, values in VEHICLES.items()}
    assert not compared(tmp_path, turned).any


def test_a_changed_verdict_is_found(tmp_path: Path) -> None:
    assert compared(tmp_path, verdict="lost").words == ["separation.verdict"]


def test_a_worst_instant_may_move_to_another_just_as_bad(tmp_path: Path) -> None:
    moved = compared(tmp_path / "a", t_s=7.6)
    assert not moved.any and moved.ties == ["separation.t_s"]
    assert compared(tmp_path / "b", t_s=7.6, value=6.4).any


def test_wording_is_no_change_but_a_new_sentence_is(tmp_path: Path) -> None:
    assert not compared(tmp_path / "a", claim="the vehicles keep apart").any
    moved = compared(tmp_path / "b", why="no pair")
    assert moved.any and moved.where == "separation.why"


def test_a_missing_file_is_found(tmp_path: Path) -> None:
    before, after = produced(tmp_path / "before"), produced(tmp_path / "after")
    (after / "run-small" / "vehicles.parquet").unlink()
    assert same_numbers.compare(before, after)["run-small/vehicles.parquet"].gone == ["the file"]
