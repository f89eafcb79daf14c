"""Every claim of a run changed, as a forger would, checksums and all: the verification names the claim."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
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

NEAR = ["radius_m=60", "lookahead_m=10", "duration_s=4", "filter_dt_s=0.05", "record_dt_s=0.05"]
HOLDS, VIOLATED, PREMISE, OTHER = "holds", "violated", "premise not met", "not applicable"


@pytest.fixture(scope="module")
def unicycle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two vehicles that meet, every step recorded; all can be decided but the other QP of the monitor."""
    folder = tmp_path_factory.mktemp("forged") / "unicycle"
    overrides = [*NEAR[:3], "fdm_dt_s=0.02", "filter_dt_s=0.02", "record_dt_s=0.02", "filter.monitor=true"]
    run(load("paper-2-turn", [*overrides, "duration_s=8", "height_perturbation_m=1"]), folder)
    assert differing(folder) == set()
    return folder


@pytest.fixture(scope="module")
def lagged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two vehicles that answer late: Ds, h and the barrier condition are violated."""
    folder = tmp_path_factory.mktemp("forged") / "lagged"
    lags = ["plant=lagged", "lags.source=table", "omega_time_constant_s=0.6", "radius_m=120", "duration_s=8"]
    run(load("paper-2-turn", [*NEAR[1:2], *NEAR[3:], *lags]), folder)
    assert differing(folder) == set()
    for name in ("separation", "safe-set", "barrier-condition", "manoeuvre-keeps-Ds"):
        assert entry(folder, name)["verdict"] == VIOLATED, name
    return folder


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The counterexample: three vehicles whose QP has no solution, each pair with its own turn."""
    folder = tmp_path_factory.mktemp("forged") / "crowd"
    rates = ["fdm_dt_s=0.02", "filter_dt_s=0.02", "record_dt_s=0.02"]
    run(load("paper-counterexample", rates), folder, force=True)
    assert differing(folder) == set()
    return folder


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


@pytest.mark.parametrize(
    ("key", "by"),
    [
        ("h", 1e-3),
        ("promised_m", 1e-3),
        ("least_m", 1e-3),
        ("short_m", -1e-3),
        ("short_m", 1e-3),
        ("safe_pairs", 1),
        ("t_s", 0.02),
    ],
)
def test_a_manoeuvre_flown_from_a_unicycle(unicycle: Path, tmp_path: Path, key: str, by: float) -> None:
    """Also an instant that does not decide the verdict."""
    folder = copied(unicycle, tmp_path / "x")
    e = entry(folder, "manoeuvre-keeps-Ds")
    branch = max(e["detail"]["branches"], key=lambda b: b["least_m"])
    branch[key] += by
    edit_entry(folder, "manoeuvre-keeps-Ds", detail=e["detail"])
    seal(folder)
    assert differing(folder) == {"manoeuvre-keeps-Ds"}


def test_promises_of_manoeuvres_are_those_of_the_recorded_poses(lagged: Path, tmp_path: Path) -> None:
    for key in ("h", "promised_m", "safe_pairs"):
        folder = copied(lagged, tmp_path / key)
        e = entry(folder, "manoeuvre-keeps-Ds")
        e["detail"]["branches"][1][key] += 1
        edit_entry(folder, "manoeuvre-keeps-Ds", detail=e["detail"])
        seal(folder)
        assert differing(folder) == {"manoeuvre-keeps-Ds"}


@pytest.mark.parametrize(("key", "by"), [("h", 60.0), ("promised_m", 1e-3)])
def test_promises_between_recorded_instants_are_near_those_around(
    tmp_path: Path, key: str, by: float
) -> None:
    run(load("paper-2-turn", [*NEAR[:4], "record_dt_s=0.4", "plant=lagged"]), tmp_path / "run")
    assert differing(tmp_path / "run") == set()
    e = entry(tmp_path / "run", "manoeuvre-keeps-Ds")
    branch = next(b for b in e["detail"]["branches"] if (b["t_s"] + 0.01) % 0.4 > 0.02)
    branch[key] += by
    if key == "h":
        branch["promised_m"] += by
        branch["short_m"] += by
    edit_entry(tmp_path / "run", "manoeuvre-keeps-Ds", detail=e["detail"])
    seal(tmp_path / "run")
    assert differing(tmp_path / "run") == {"manoeuvre-keeps-Ds"}


def test_the_worst_manoeuvres_left_out(lagged: Path, tmp_path: Path) -> None:
    folder = copied(lagged, tmp_path / "x")
    e = entry(folder, "manoeuvre-keeps-Ds")
    good = [b for b in e["detail"]["branches"] if b["least_m"] >= 5.0]
    assert good
    best = min(good, key=lambda b: b["least_m"])
    fields = {"value": best["least_m"], "margin": best["least_m"] - 5.0, "t_s": best["t_s"], "verdict": HOLDS}
    edit_entry(folder, "manoeuvre-keeps-Ds", detail={"branches": good}, **fields)
    seal(folder)
    assert differing(folder) == {"manoeuvre-keeps-Ds"}


def test_a_worst_manoeuvre_that_none_of_those_flown_is(unicycle: Path, tmp_path: Path) -> None:
    folder = copied(unicycle, tmp_path / "x")
    edit_entry(folder, "manoeuvre-keeps-Ds", value=entry(folder, "manoeuvre-keeps-Ds")["value"] + 1e-6)
    seal(folder)
    assert differing(folder) == {"manoeuvre-keeps-Ds"}


def test_who_has_the_least_room_for_the_manoeuvre(tmp_path: Path) -> None:
    run(
        load("paper-2-turn", [*NEAR, "duration_s=0.5", "sigma=[1.0, 1.2]", "omega_degps=8"]), tmp_path / "run"
    )
    assert entry(tmp_path / "run", "manoeuvre-in-U")["vehicles"] == [1]
    edit_entry(tmp_path / "run", "manoeuvre-in-U", vehicles=[2])
    seal(tmp_path / "run")
    assert differing(tmp_path / "run") == {"manoeuvre-in-U"}


def test_a_fault_in_a_manoeuvre_is_no_pass(unicycle: Path, tmp_path: Path) -> None:
    folder = copied(unicycle, tmp_path / "x")
    e = entry(folder, "manoeuvre-keeps-Ds")
    e["detail"]["branches"][0]["fault"] = "vehicle 1: stall"
    edit_entry(folder, "manoeuvre-keeps-Ds", detail=e["detail"])
    seal(folder)
    assert differing(folder) == {"manoeuvre-keeps-Ds"}


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
    assert differing(folder) == {"entries"}


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
        ("nominal", "gain_per_s", 0.2), ("start", "radius_m", 61.0),
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
        ({"override_share": [0.0, 0.0]}, "override"),
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
