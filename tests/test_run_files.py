"""Run folders: whole or absent, equal for equal scenarios, readable as tables."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

import testbed
from testbed.errors import UserError
from testbed.records.run import PAIR_COLUMNS, VEHICLE_COLUMNS
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

SHORT = ["duration_s=0.1"]


def digests(folder: Path) -> dict[str, str]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


@pytest.mark.parametrize("plant", ["unicycle", "jsbsim"])
def test_equal_scenarios_give_equal_files_but_for_the_timing(tmp_path: Path, plant: str) -> None:
    s = load("paper-2-turn", [f"plant={plant}", "duration_s=1", "heading_perturbation_deg=1"])
    for name in ("a", "b"):
        run(s, tmp_path / name)
    a, b = digests(tmp_path / "a"), digests(tmp_path / "b")
    assert set(a) == {"manifest.json", "vehicles.parquet", "pairs.parquet", "guarantees.json", "timing.json"}
    assert {name for name in a if a[name] != b[name]} <= {"timing.json"}


def test_tables_have_the_documented_columns_and_rows(tmp_path: Path) -> None:
    run(load("paper-2-turn", SHORT), tmp_path / "r")
    result = testbed.load(tmp_path / "r")
    assert list(result.vehicles.columns) == list(VEHICLE_COLUMNS)
    assert list(result.pairs.columns) == list(PAIR_COLUMNS)
    assert len(result.vehicles) == 2 * 21 and len(result.pairs) == 21
    assert set(result.vehicles.vehicle) == {1, 2}
    moved = result.pairs.h_m.diff().to_numpy()[1:] / 0.005
    assert np.allclose(result.pairs.hdot_realised_mps.to_numpy()[:-1], moved, rtol=0, atol=1e-9)
    assert np.isnan(result.pairs.hdot_realised_mps.iloc[-1])


def test_recording_sparsely_loses_no_minimum(tmp_path: Path) -> None:
    fine = run(load("paper-2-turn"))
    coarse = run(load("paper-2-turn", ["record_dt_s=1"]))
    assert len(coarse.pairs) == 21
    assert coarse.guarantee("separation") == fine.guarantee("separation")
    assert coarse.guarantee("safe-set") == fine.guarantee("safe-set")


def test_in_memory_and_written_runs_agree(tmp_path: Path) -> None:
    s = load("paper-2-turn", SHORT)
    kept, written = run(s), run(s, tmp_path / "r")
    assert kept.guarantees == written.guarantees
    assert kept.vehicles.equals(written.vehicles)


def test_an_existing_folder_is_replaced_only_on_request_and_only_if_it_is_a_run(tmp_path: Path) -> None:
    s = load("paper-2-turn", SHORT)
    run(s, tmp_path / "r")
    with pytest.raises(UserError, match="exists; give another --out, or --overwrite"):
        run(s, tmp_path / "r")
    run(s, tmp_path / "r", overwrite=True)
    other = tmp_path / "thesis"
    other.mkdir()
    (other / "chapter.tex").write_text("years of work")
    with pytest.raises(UserError, match="is not a run"):
        run(s, other, overwrite=True)
    assert (other / "chapter.tex").read_text() == "years of work"


def test_a_refused_start_leaves_nothing_behind(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "er"
    with pytest.raises(UserError, match=r"outside the safe set: h = -4\.750 for vehicles 1 and 2"):
        run(load("paper-2-straight", ["course_offset_deg=0", *SHORT]), out)
    assert list(tmp_path.iterdir()) == []


def test_two_vehicles_at_one_place_are_refused_even_by_force() -> None:
    place = "{x_m = 0, y_m = 0, course_deg = 0, goal_x_m = 1, goal_y_m = 0}"
    s = load("paper-2-turn", ["pattern=list", f"places=[{place}, {place}]"])
    with pytest.raises(UserError, match="vehicles 1 and 2 start at one place"):
        run(s, force=True)


def test_a_damaged_or_unfinished_run_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="holds no finished run"):
        testbed.load(tmp_path)
    run(load("paper-2-turn", SHORT), tmp_path / "r")
    (tmp_path / "r" / "guarantees.json").write_text("[{")
    with pytest.raises(UserError, match="is damaged"):
        testbed.load(tmp_path / "r")
    manifest = json.loads((tmp_path / "r" / "manifest.json").read_text())
    (tmp_path / "r" / "guarantees.json").write_text("[]")
    (tmp_path / "r" / "manifest.json").write_text(json.dumps(manifest | {"schema_version": 0}))
    with pytest.raises(UserError, match="schema version 0"):
        testbed.load(tmp_path / "r")


def test_one_vehicle_and_no_duration_are_runs_too() -> None:
    alone = run(load("paper-2-turn", ["vehicles=1", *SHORT]))
    assert alone.guarantee("separation")["verdict"] == "not applicable"
    assert len(alone.pairs) == 0
    instant = run(load("paper-2-turn", ["duration_s=0"]))
    assert len(instant.vehicles) == 2
    assert instant.guarantee("separation")["value"] == pytest.approx(400.0)
