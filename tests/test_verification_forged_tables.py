"""Cells of the tables and fields of the manifest changed: the verification names what does not fit."""

# Fixtures are imported by name, and asked for by name.
# ruff: noqa: F811

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from tests.forged_runs import NEAR, crowd, lagged, unicycle  # noqa: F401
from tests.forgery import (
    copied,
    differing,
    edit_cell,
    edit_entry,
    edit_manifest,
    edit_table,
    entry,
    open_,
    read,
    seal,
    write,
)

HOLDS, VIOLATED, PREMISE, OTHER = "holds", "violated", "premise not met", "not applicable"


@pytest.mark.parametrize(
    ("table", "column", "by", "named"),
    [
        ("vehicles", "x_m", 1e-4, {"motion", "distance_m", "h_m"}),
        ("vehicles", "z_m", 1e-4, {"motion", "nominal"}),
        ("vehicles", "theta_rad", 1e-5, {"motion", "h_m", "hdot_predicted"}),
        ("vehicles", "v_mps", 1e-3, {"motion", "residual_v"}),
        ("vehicles", "omega_radps", 1e-4, {"motion", "residual_omega"}),
        ("vehicles", "v_nominal_mps", 1e-3, {"nominal"}),
        ("vehicles", "omega_nominal_radps", 1e-3, {"nominal"}),
        ("vehicles", "v_command_mps", 1e-3, {"motion", "hdot_predicted"}),
        ("vehicles", "v_command_mps", 11.0, {"command-limits"}),
        ("vehicles", "qp_status", "infeasible", {"qp-feasibility"}),
        ("vehicles", "qp_status", "none", {"qp_status"}),
        ("vehicles", "override", True, {"override"}),
        ("vehicles", "x_m", float("nan"), {"numbers", "motion", "distance_m"}),
        ("pairs", "distance_m", 1e-4, {"distance_m"}),
        ("pairs", "h_m", 1e-6, {"h_m"}),
        ("pairs", "h_filter_m", 1e-6, {"h_filter_m"}),
        ("pairs", "hdot_predicted_mps", 1e-5, {"hdot_predicted"}),
        ("pairs", "hdot_realised_mps", 1e-4, {"hdot_realised"}),
        ("pairs", "residual_v_mps", 1e-5, {"residual_v"}),
        ("pairs", "residual_omega_mps", 1e-5, {"residual_omega"}),
        ("pairs", "residual_zeta_mps", 1e-5, {"residual_zeta"}),
        ("pairs", "residual_course_mps", 1e-5, {"residual_course"}),
    ],
)
def test_a_cell(unicycle: Path, tmp_path: Path, table: str, column: str, by: Any, named: set[str]) -> None:
    folder = copied(unicycle, tmp_path / "x")
    edit_cell(folder, table, column, 60, by)
    seal(folder)
    found = differing(folder)
    assert found >= named
    if table == "pairs":
        assert found == named


def test_another_start(unicycle: Path, tmp_path: Path) -> None:
    """A whole flight moved aside: no distance changes, and no motion."""
    folder = copied(unicycle, tmp_path / "x")
    edit_table(folder, "vehicles", lambda table: table.assign(y_m=table.y_m + 1.0))
    seal(folder)
    assert "start" in differing(folder)


def test_another_scenario(unicycle: Path, tmp_path: Path) -> None:
    for section, field, value in (
        ("alpha", "coefficient", 0.2), ("barrier", "v_mps", 17.0), ("limits", "v_max_mps", 16.0),
        ("guidance", "gain_per_s", 0.2), ("start", "radius_m", 61.0),
    ):  # fmt: skip
        folder = copied(unicycle, tmp_path / field)
        s = read(folder, "manifest.json")["scenario"]
        edit_manifest(folder, scenario=s | {section: s[section] | {field: value}})
        seal(folder)
        assert differing(folder), field
    folder = copied(unicycle, tmp_path / "ds")
    s = read(folder, "manifest.json")["scenario"]
    edit_manifest(folder, scenario=s | {"d_safe_m": 4.0})
    seal(folder)
    assert differing(folder) >= {"separation", "h_m", "safe-set", "manoeuvre-keeps-Ds"}


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"filter_steps": 7}, "end"),
        ({"ended_early": "vehicle 1: ground at 0.500 s; run stopped"}, "end"),
        ({"override_share": [0.0, 0.0]}, "override_share"),
    ],
)
def test_the_manifest(unicycle: Path, tmp_path: Path, fields: dict[str, Any], named: str) -> None:
    folder = copied(unicycle, tmp_path / "x")
    edit_manifest(folder, **fields)
    assert "files" in differing(folder)
    seal(folder)
    assert named in differing(folder)


def test_without_new_checksums_every_file_shows(unicycle: Path, tmp_path: Path) -> None:
    for name in ("vehicles.parquet", "pairs.parquet", "guarantees.json"):
        folder = copied(unicycle, tmp_path / name)
        manifest = read(folder, "manifest.json")
        manifest["files"].pop(name)
        write(folder, "manifest.json", manifest)
        seal(folder)
        assert "files" in differing(folder), f"{name} is not among the files"


@pytest.mark.slow
@pytest.mark.parametrize("airframe", ["x8", "rascal"])
def test_an_aircraft_that_violates_and_is_said_to_hold(airframe: str, tmp_path: Path) -> None:
    far = [*NEAR[1:], "duration_s=9", "plant=jsbsim", f'airframes=["{airframe}"]']
    s = load("paper-2-turn", far)
    run(s, tmp_path / "run")
    assert differing(tmp_path / "run") == set()
    assert "manoeuvre-keeps-Ds" in open_(tmp_path / "run")
    for name in ("separation", "safe-set", "barrier-condition"):
        folder, e = copied(tmp_path / "run", tmp_path / name), entry(tmp_path / "run", name)
        assert e["verdict"] == VIOLATED
        fields: dict[str, Any] = {"value": e["bound"] + 0.1, "margin": 0.1, "verdict": HOLDS}
        edit_entry(folder, name, **fields)
        seal(folder)
        assert name in differing(folder)
    for column, by, named in (
        ("x_m", 0.1, "motion"), ("theta_rad", 0.05, "motion"), ("v_mps", 0.5, "motion"),
        ("heading_rad", 0.01, "residual_omega"),
    ):  # fmt: skip
        folder = copied(tmp_path / "run", tmp_path / column)
        edit_cell(folder, "vehicles", column, 100, by)
        seal(folder)
        assert named in differing(folder), column
    for column in ("limited_v", "throttle"):
        folder = copied(tmp_path / "run", tmp_path / column)
        edit_table(folder, "vehicles", lambda table, column=column: table.assign(**{column: 1.0}))
        seal(folder)
        assert differing(folder) == {"command-limits"}
