"""The second opinion on runs that ended before their first decision: their claims are checked, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import testbed
from filters.cbf.collision import Passthrough
from filters.model import Command
from tests.forgery import copied, differing, edit_entry, open_, read, seal, write

BRIEF = ["filter_dt_s=0.05", "record_dt_s=0.1", "duration_s=1"]


class Silent:
    def __init__(self, s: Any, barrier: Any, goal: Any) -> None:
        pass

    def __call__(self, view: Any, nominal: Any, limits: Any) -> Any:
        raise RuntimeError("no map loaded")


class Undefined(Silent):
    def __call__(self, view: Any, nominal: Any, limits: Any) -> Any:
        decision = Passthrough()(view, nominal, limits)
        return replace(decision, command=Command(np.nan * nominal.v, nominal.omega, nominal.zeta))


class Grounded:
    def __init__(self, s: Any, wind: Any) -> None:
        raise RuntimeError("no wing")


KINDS: dict[str, tuple[dict[str, Any], list[str]]] = {
    "filter raises": ({"filter": Silent}, []),
    "command is nan": ({"filter": Undefined}, []),
    "no plant": ({"plant": Grounded}, []),
    "three, perturbed": ({"filter": Silent}, ["vehicles=3", "lateral_perturbation_m=5", "seed=4"]),
    "below Ds": ({"filter": Silent}, ["start.radius_m=2"]),
    "an intruder": (
        {"filter": Silent},
        [
            "vehicles=3",
            "vehicle=[{x_m=0, y_m=0, course_deg=0, goal_x_m=400, goal_y_m=0},"
            " {x_m=0, y_m=60, course_deg=0, goal_x_m=400, goal_y_m=60},"
            " {x_m=90, y_m=50, course_deg=180, goal_x_m=-300, goal_y_m=0, filter=false}]",
        ],
    ),
    "alone": ({"filter": Silent}, ["vehicles=1"]),
    "aircraft in wind": (
        {"filter": Silent},
        ["plant=jsbsim", "heading_perturbation_deg=3", "wind.speed_mps=2"],
    ),
}


def unflown(kind: str, folder: Path) -> testbed.Run:
    parts, more = KINDS[kind]
    s = testbed.load_scenario("paper-2-turn", [*BRIEF, *more])
    run = testbed.run(s, folder, parts=testbed.Parts(**parts), force=True)
    assert run.manifest["filter_steps"] == 0 and "in step 0" in run.manifest["ended_early"]
    return run


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unflown") / "run"
    unflown("three, perturbed", folder)
    return folder


@pytest.mark.parametrize("kind", KINDS)
def test_it_agrees_and_leaves_nothing_open_but_what_aircraft_trim(kind: str, tmp_path: Path) -> None:
    run = unflown(kind, tmp_path / "run")
    assert differing(tmp_path / "run") == set()
    assert open_(tmp_path / "run") <= ({"manoeuvre-flyable"} if kind == "aircraft in wind" else set())
    assert not [v.id for v in run.guarantees if v.status == "holds" and not v.number.startswith("P")]


def test_of_what_never_flew_h_is_not_violated(tmp_path: Path) -> None:
    verdict = unflown("filter raises", tmp_path / "run").guarantee("safe-set")
    assert verdict["verdict"] == "premise not met" and verdict["why"] == "no step was flown"
    assert unflown("below Ds", tmp_path / "near").guarantee("separation")["verdict"] == "violated"


CLAIMS = ["separation", "safe-set", "barrier-condition", "zcbf-condition", "qp-feasibility", "command-limits",
          "rows-satisfied", "goal", "intervention"]  # fmt: skip


@pytest.mark.parametrize("claim", CLAIMS)
@pytest.mark.parametrize("fields", [{"verdict": "holds"}, {"verdict": "open"}, {"value": 7.0}], ids=str)
def test_a_verdict_or_value_of_what_never_flew_is_named(
    recorded: Path, tmp_path: Path, claim: str, fields: dict[str, Any]
) -> None:
    folder = copied(recorded, tmp_path / "x")
    edit_entry(folder, claim, **fields)
    seal(folder)
    assert claim in differing(folder)


@pytest.mark.parametrize("claim", ["separation", "goal"])
@pytest.mark.parametrize("field", ["bound", "margin", "t_s", "vehicles"])
def test_distances_at_the_start_are_computed_again(
    recorded: Path, tmp_path: Path, claim: str, field: str
) -> None:
    folder = copied(recorded, tmp_path / "x")
    said = next(e for e in read(folder, "guarantees.json") if e["id"] == claim)[field]
    edit_entry(folder, claim, **{field: said[:-1] if field == "vehicles" else said + 0.1})
    seal(folder)
    assert differing(folder) == {claim}


@pytest.mark.parametrize(
    ("change", "named"),
    [({"filter_steps": 3}, "end"), ({"ended_early": "the plant failed at 0.500 s; run stopped"}, "end")],
)
def test_steps_that_are_said_and_not_recorded_are_named(
    recorded: Path, tmp_path: Path, change: dict[str, Any], named: str
) -> None:
    folder = copied(recorded, tmp_path / "x")
    write(folder, "manifest.json", read(folder, "manifest.json") | change)
    seal(folder)
    assert named in differing(folder)


def test_without_rows_a_run_that_says_it_was_flown_whole_is_refused(recorded: Path, tmp_path: Path) -> None:
    folder = copied(recorded, tmp_path / "x")
    write(folder, "manifest.json", read(folder, "manifest.json") | {"ended_early": None})
    seal(folder)
    with pytest.raises(testbed.UserError, match="0 instants recorded, 11 expected"):
        differing(folder)
