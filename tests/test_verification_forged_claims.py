"""Every field of every claim changed, checksums and all: the verification names the claim."""

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
    edit_entry,
    edit_table,
    entry,
    read,
    seal,
    write,
)

HOLDS, VIOLATED, PREMISE, OTHER = "holds", "violated", "premise not met", "not applicable"


VALUED = [
    "manoeuvre-in-U", "off-the-kink", "separation", "safe-set", "barrier-condition", "zcbf-condition",
    "qp-feasibility", "command-limits", "rows-satisfied", "goal", "intervention", "manoeuvre-keeps-Ds",
    "monitor-gamma_is_safe", "monitor-gamma_is_safe_limited", "monitor-solvable",
]  # fmt: skip
JUDGED = [name for name in VALUED if name != "intervention"]
EVERY = ["start-safe", "shared-manoeuvre", "manoeuvre-flyable", "gradient", *VALUED, "monitor-cheaper"]


@pytest.mark.parametrize("name", VALUED)
@pytest.mark.parametrize("by", [1e-2, -1e-2])
def test_a_value(unicycle: Path, tmp_path: Path, name: str, by: float) -> None:
    """With a margin and a verdict that follow from it: only the record tells."""
    folder, e = copied(unicycle, tmp_path / "x"), entry(unicycle, name)
    value = e["value"] + (round(100 * by) if name == "qp-feasibility" else by)
    fields: dict[str, Any] = {"value": value}
    if e["margin"] is not None:
        fields["margin"] = e["margin"] + (
            e["value"] - value if name in ("goal", "qp-feasibility") else value - e["value"]
        )
        fields["verdict"] = _verdict(name, value, e["bound"])
    edit_entry(folder, name, **fields)
    seal(folder)
    assert differing(folder) == {name}


def _verdict(name: str, value: float, bound: float) -> str:
    if name in ("goal", "qp-feasibility"):
        return HOLDS if value <= bound else VIOLATED
    fails = PREMISE if name in ("manoeuvre-in-U", "off-the-kink") else VIOLATED
    allowed = {"barrier-condition": 1e-3, "rows-satisfied": 1e-6, "safe-set": 1e-9, "zcbf-condition": 1e-9}
    return HOLDS if value >= bound - allowed.get(name, 0.0) else fails


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("verdict", [HOLDS, VIOLATED, PREMISE, OTHER])
def test_a_verdict_that_does_not_follow(unicycle: Path, tmp_path: Path, name: str, verdict: str) -> None:
    folder = copied(unicycle, tmp_path / "x")
    if entry(folder, name)["verdict"] == verdict:
        pytest.skip("that is the verdict")
    edit_entry(folder, name, verdict=verdict)
    seal(folder)
    assert differing(folder) == {name}


@pytest.mark.parametrize("name", JUDGED)
@pytest.mark.parametrize("field", ["bound", "margin"])
def test_a_bound_or_margin(unicycle: Path, tmp_path: Path, name: str, field: str) -> None:
    folder = copied(unicycle, tmp_path / "x")
    edit_entry(folder, name, **{field: entry(folder, name)[field] + 0.5})
    seal(folder)
    assert differing(folder) == {name}


@pytest.mark.parametrize(
    "name",
    [
        "off-the-kink",
        "separation",
        "safe-set",
        "barrier-condition",
        "zcbf-condition",
        "rows-satisfied",
        "goal",
    ],
)
@pytest.mark.parametrize("fields", [{"t_s": 0.2}, {"t_s": 99.0}, {"vehicles": [2, 7]}], ids=str)
def test_an_instant_or_vehicles(unicycle: Path, tmp_path: Path, name: str, fields: dict[str, Any]) -> None:
    folder = copied(unicycle, tmp_path / "x")
    edit_entry(folder, name, **fields)
    seal(folder)
    assert differing(folder) == {name}


@pytest.mark.parametrize("name", ["separation", "safe-set", "barrier-condition", "manoeuvre-keeps-Ds"])
def test_a_violation_painted_over(lagged: Path, tmp_path: Path, name: str) -> None:
    """Every field of the entry agrees with every other."""
    folder, e = copied(lagged, tmp_path / "x"), entry(lagged, name)
    better = e["bound"] + 0.7
    fields: dict[str, Any] = {"value": better, "margin": better - e["bound"], "verdict": HOLDS}
    if name == "separation":
        fields["detail"] = {"between_steps_m": better}
    edit_entry(folder, name, **fields)
    seal(folder)
    assert differing(folder) == {name}


@pytest.mark.parametrize(
    "name", ["separation", "safe-set", "barrier-condition", "zcbf-condition", "rows-satisfied", "gradient",
             "off-the-kink", "manoeuvre-keeps-Ds"]
)  # fmt: skip
@pytest.mark.parametrize("fields", [{"verdict": HOLDS}, {"value": 1.0}], ids=str)
def test_claims_of_one_vehicle_on_others(name: str, fields: dict[str, Any], tmp_path: Path) -> None:
    run(load("paper-2-turn", [*NEAR, "vehicles=1", "duration_s=0.5"]), tmp_path / "run")
    edit_entry(tmp_path / "run", name, **fields)
    seal(tmp_path / "run")
    assert differing(tmp_path / "run") == {name}


def test_the_start_of_one_vehicle_is_safe(tmp_path: Path) -> None:
    run(load("paper-2-turn", [*NEAR, "vehicles=1", "duration_s=0.5"]), tmp_path / "run")
    edit_entry(tmp_path / "run", "start-safe", verdict=PREMISE)
    seal(tmp_path / "run")
    assert differing(tmp_path / "run") == {"start-safe"}


@pytest.mark.parametrize("vehicle", [1, 9])
def test_who_was_altered_most(tmp_path: Path, vehicle: int) -> None:
    """Of two that meet and one that passes far off."""
    places = "places=[" + ", ".join(
        f"{{x_m={x}, y_m={y}, course_deg={c}, goal_x_m={-x}, goal_y_m={y}}}"
        for x, y, c in ((0, 500, 0), (-60, 0, 0), (60, 0, 180))
    ) + "]"  # fmt: skip
    run(load("paper-2-turn", [*NEAR[1:], "vehicles=3", "start.pattern=list", places]), tmp_path / "run")
    assert entry(tmp_path / "run", "intervention")["value"] > 0.0 and differing(tmp_path / "run") == set()
    edit_entry(tmp_path / "run", "intervention", vehicles=[vehicle])
    seal(tmp_path / "run")
    assert differing(tmp_path / "run") == {"intervention"}


def test_an_unsafe_start_called_safe(tmp_path: Path) -> None:
    run(load("paper-2-turn", [*NEAR, "radius_m=7", "duration_s=0.5"]), tmp_path / "run", force=True)
    assert entry(tmp_path / "run", "start-safe")["verdict"] == PREMISE
    edit_entry(tmp_path / "run", "start-safe", verdict=HOLDS)
    edit_entry(tmp_path / "run", "safe-set", verdict=VIOLATED)
    seal(tmp_path / "run")
    assert differing(tmp_path / "run") == {"start-safe", "safe-set"}


def test_a_boundary_reached_and_denied(lagged: Path, tmp_path: Path) -> None:
    folder = copied(lagged, tmp_path / "x")
    assert entry(folder, "gradient")["value"] is not None
    nothing: dict[str, Any] = {"value": None, "bound": None, "margin": None, "t_s": None, "vehicles": []}
    edit_entry(folder, "gradient", verdict=OTHER, **nothing)
    seal(folder)
    assert differing(folder) == {"gradient"}


@pytest.mark.parametrize("by", [0.1, -0.1])
def test_the_gradient_at_the_boundary(lagged: Path, tmp_path: Path, by: float) -> None:
    folder, e = copied(lagged, tmp_path / "x"), entry(lagged, "gradient")
    edit_entry(folder, "gradient", value=e["value"] + by, margin=e["margin"] + by)
    seal(folder)
    assert differing(folder) == {"gradient"}


def test_manoeuvres_shared_or_not(crowd: Path, tmp_path: Path) -> None:
    for name in ("shared-manoeuvre", "manoeuvre-in-U", "manoeuvre-flyable"):
        folder = copied(crowd, tmp_path / name)
        edit_entry(folder, name, verdict=HOLDS)
        seal(folder)
        assert differing(folder) == {name}


def test_qps_without_a_solution_forgotten(crowd: Path, tmp_path: Path) -> None:
    folder, e = copied(crowd, tmp_path / "x"), entry(crowd, "qp-feasibility")
    assert e["value"] > 0
    none: dict[str, Any] = {"value": 0, "margin": 0, "verdict": HOLDS, "t_s": None, "vehicles": []}
    edit_entry(folder, "qp-feasibility", detail={"in_safe_set": 0}, **none)
    seal(folder)
    assert differing(folder) == {"qp-feasibility"}
    # Painted over in the table as well, the commands do not satisfy what they are said to solve.
    edit_table(folder, "vehicles", lambda table: table.assign(qp_status="solved"))
    seal(folder)
    assert differing(folder) >= {"solutions", "rows-satisfied"}


@pytest.mark.parametrize("kind", ["centralised", "limited"])
def test_no_solution_claimed_where_there_is_one(kind: str, tmp_path: Path) -> None:
    """And where there is none, gamma is flown."""
    run(load("paper-2-turn", [*NEAR, "radius_m=7", f"filter.kind={kind}"]), tmp_path / "run", force=True)
    failures = entry(tmp_path / "run", "qp-feasibility")["value"]
    assert failures > 0 and differing(tmp_path / "run") == set()
    other = copied(tmp_path / "run", tmp_path / "other")
    edit_table(
        other,
        "vehicles",
        lambda table: table.assign(
            v_command_mps=table.v_command_mps.where(table.qp_status != "infeasible", 18.0)
        ),
    )
    seal(other)
    assert "qp_status" in differing(other)
    painted = copied(tmp_path / "run", tmp_path / "painted")
    edit_table(painted, "vehicles", lambda table: table.assign(qp_status="infeasible"))
    seal(painted)
    assert differing(painted) >= {"no-solutions", "qp_status"}


@pytest.mark.parametrize("fields", [{"t_s": 0.5}, {"vehicles": [9]}], ids=str)
def test_the_first_failure(crowd: Path, tmp_path: Path, fields: dict[str, Any]) -> None:
    folder = copied(crowd, tmp_path / "x")
    edit_entry(folder, "qp-feasibility", **fields)
    seal(folder)
    assert differing(folder) == {"qp-feasibility"}


@pytest.mark.parametrize("detail", [{"in_safe_set": 1}, {"infeasible": 1, "in_safe_set": 0}], ids=str)
def test_details_of_failures(crowd: Path, tmp_path: Path, detail: dict[str, int]) -> None:
    folder = copied(crowd, tmp_path / "x")
    edit_entry(folder, "qp-feasibility", detail=detail)
    seal(folder)
    assert differing(folder) == {"qp-feasibility"}


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("separation", "between_steps_m", 9.0),
        ("separation", "between_steps_m", 5.5),
        ("command-limits", "achieved_v_mps", [15.0, 26.0]),
        ("command-limits", "achieved_omega_radps", [0.0, 0.0]),
        ("intervention", "altered_v_m", 1.0),
        ("intervention", "altered_omega_rad", 0.0),
        ("intervention", "altered_zeta_m", 1.0),
        ("intervention", "path_added_m", [0.0, 0.0]),
        ("intervention", "time_added_s", [1.0, 1.0]),
        ("intervention", "time_added_s", [None, None]),
        ("goal", "last_passed_s", 0.5),
    ],
)
def test_details(unicycle: Path, tmp_path: Path, name: str, key: str, value: Any) -> None:
    folder = copied(unicycle, tmp_path / "x")
    e = entry(folder, name)
    assert key in e["detail"]
    edit_entry(folder, name, detail=e["detail"] | {key: value})
    seal(folder)
    assert differing(folder) == {name}


@pytest.mark.parametrize("name", EVERY)
def test_an_entry_left_out(unicycle: Path, tmp_path: Path, name: str) -> None:
    folder = copied(unicycle, tmp_path / "x")
    write(folder, "guarantees.json", [e for e in read(folder, "guarantees.json") if e["id"] != name])
    seal(folder)
    assert differing(folder) == {"entries"}


def test_a_guarantee_called_a_premise(unicycle: Path, tmp_path: Path) -> None:
    folder = copied(unicycle, tmp_path / "x")
    edit_entry(folder, "separation", number="P1")
    seal(folder)
    assert differing(folder) == {"entries", "texts"}


def test_no_qp_where_there_was_one(unicycle: Path, tmp_path: Path) -> None:
    """All words and both claims changed together."""
    folder = copied(unicycle, tmp_path / "x")
    edit_table(folder, "vehicles", lambda table: table.assign(qp_status="none"))
    nothing: dict[str, Any] = {"value": None, "bound": None, "margin": None, "t_s": None, "vehicles": []}
    for name in ("qp-feasibility", "rows-satisfied"):
        edit_entry(folder, name, verdict=OTHER, detail={}, **nothing)
    seal(folder)
    assert differing(folder) >= {"qp_status", "qp-feasibility"}


def test_an_entry_twice(unicycle: Path, tmp_path: Path) -> None:
    folder = copied(unicycle, tmp_path / "x")
    entries = read(folder, "guarantees.json")
    write(folder, "guarantees.json", [*entries, entries[-1]])
    seal(folder)
    assert differing(folder) == {"entries"}
