"""Starts drawn at random, crossing streams, and whether vehicles wait for ever."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import testbed
from filters.model import Array, Command, View
from testbed.components import catalogue
from testbed.components.initial_conditions import generators, places
from testbed.errors import UserError
from testbed.measures.progress import Progress
from testbed.scenario.randomness import random_fields
from testbed.scenario.scenario import load
from testbed.verification import settings as again
from testbed.verification.check import verify
from tests.forgery import edit_entry, seal


@given(seed=st.integers(0, 2**40), vehicles=st.integers(1, 12), form=st.sampled_from(["root", "squared"]))
@settings(max_examples=10, deadline=None)
def test_every_pair_starts_well_inside_the_safe_set_and_goals_are_far(
    seed: int, vehicles: int, form: str
) -> None:
    s = load("random-goals", [f"seed={seed}", f"vehicles={vehicles}", f"barrier.form={form}"])
    state, goal = places(s, generators(s.seed)["start"])
    h = catalogue.barrier(s).values(state).h
    least = 4.0 if form == "root" else 9.0**2 - 5.0**2
    assert h.min(initial=np.inf) >= least
    way = goal[:, :2] - state.position[:, :2]
    assert (np.hypot(*way.T) >= 350.0).all() and np.abs(state.position).max() <= 350.0
    assert np.cos(state.theta) == pytest.approx(way[:, 0] / np.hypot(*way.T))
    # The second opinion draws the same.
    data = s.model_dump(mode="json")
    assert np.array_equal(again.goals(data), goal)
    assert again.start(data).position == pytest.approx(state.position, abs=1e-9)


def test_a_draw_with_room_begins_in_the_set_of_the_flow_filter_and_one_without_may_not() -> None:
    for seed, least, inside in ((2001, 4.0, False), (2001, 25.0, True), (2005, 25.0, True)):
        lagged = ["plant=lagged", "lags.source=airframe", "filter.kind=flow", "margin_m=2"]
        s = load("random-goals", [*lagged, f"seed={seed}", f"start_h_m={least}"])
        state, goal = places(s, generators(seed)["start"])
        chosen = catalogue.filter_(s, catalogue.barrier(s), goal)
        level, speeds = np.zeros(20), np.full(20, 20.0)
        rates = Command(speeds, level, level)
        chosen(View(state, rates), rates, catalogue.limits(s))
        clear = chosen.record.checks["flow_clear"].worst  # type: ignore[attr-defined]
        assert (clear >= 0.0) == inside, (seed, least, clear)  # -6.4, 21.7 and 11.4 m


def test_the_seed_alone_draws_and_a_draw_of_fewer_is_the_begin_of_a_draw_of_more() -> None:
    few, more, other = (
        places(s, generators(s.seed)["start"])[0].position
        for s in (load("random-goals", [v]) for v in ("lateral_perturbation_m=0", "duration_s=1", "seed=2"))
    )
    assert np.array_equal(few, more) and not np.array_equal(few, other)
    assert random_fields(load("random-goals")) == ["start.pattern"]


def test_streams_meet_at_the_crossing_and_all_fly_equally_far() -> None:
    s = load("crossing-streams", ["crossing_deg=60", "vehicles=7"])
    state, goal = places(s, generators(1)["start"])
    way = goal - state.position
    assert np.linalg.norm(way, axis=1) == pytest.approx(np.full(7, 2 * 200.0 + 3 * 60.0))
    assert np.degrees(state.theta) == pytest.approx([0, 60, 0, 60, 0, 60, 0])
    at_crossing = np.linalg.norm(state.position, axis=1)
    assert at_crossing == pytest.approx([200, 200, 260, 260, 320, 320, 380])
    data = s.model_dump(mode="json")
    assert again.goals(data) == pytest.approx(goal) and again.start(data).position == pytest.approx(
        state.position
    )


BAD = {
    ("vehicles=40", "square_m=150", "goal_distance_m=50", "start_h_m=60"): (
        r"start.pattern: of 10000 draws none gives vehicle \d+ of 40 h >= 60 m with all before it; fly fewer"
    ),
    ("goal_distance_m=800",): r"start: goal_distance_m: goals 800 m away hardly fit into a square of 700 m",
    ("vehicles=1", "vehicle=[{x_m=0, y_m=0, course_deg=0}]"): r"vehicle.1: start.pattern = 'random",
    ("spacing_m=40",): r"start.spacing_m: has no effect on a start drawn at random",
    ("start_h_m=-1",): r"start.start_h_m: .*greater than or equal to 0",
}  # fmt: skip


@pytest.mark.parametrize("overrides", BAD, ids=lambda o: o[0])
def test_a_draw_that_cannot_be_had_is_one_clear_line(overrides: tuple[str, ...]) -> None:
    with pytest.raises(UserError, match=BAD[overrides]) as error:
        s = load("random-goals", list(overrides))
        places(s, generators(1)["start"])
    assert "\n" not in str(error.value)


def by_hand(t: Array, away: Array, step: float) -> float:
    """The longest wait, by trying every pair of instants."""
    marks, known = [0.0], away[0]
    for now, d in zip(t, away, strict=True):
        if d <= max(known - step, step):
            marks.append(float(now))
            known = d
            if d <= step:
                return float(np.diff(marks).max())
    return float(np.diff([*marks, float(t[-1])]).max())


@given(seed=st.integers(0, 2**31), cuts=st.lists(st.integers(1, 99), max_size=4))
@settings(max_examples=40, deadline=None)
def test_waits_do_not_depend_on_how_steps_are_handed_over(seed: int, cuts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(100) * 0.5
    away = np.abs(200.0 - np.cumsum(rng.normal(2.0, 8.0, (100, 3)), axis=0))
    seen = Progress(away[0], 20.0, 30.0)
    for k in np.split(np.arange(100), sorted(set(cuts))):
        if k.size:
            seen.update(t[k], away[k])
    longest, begin = seen.waits(float(t[-1]))
    assert longest == pytest.approx([by_hand(t, away[:, v], 20.0) for v in range(3)])
    assert ((begin >= 0) & (begin + longest <= t[-1] + 1e-9)).all()
    assert np.array_equal(seen.arrived, (away <= 20.0).any(axis=0))


SHORT = [
    "vehicles=3",
    "duration_s=16",
    "square_m=200",
    "goal_distance_m=60",
    "filter_dt_s=0.1",
    "record_dt_s=0.1",
]


def test_who_waits_for_ever_is_found_and_a_forged_wait_as_well(tmp_path: Path) -> None:
    # Vehicle 1 holds a course away from its goal; the others fly 60 m and more to theirs.
    own = "vehicle=[{goal_x_m=-90, goal_y_m=0, guidance={kind='hold', course_deg=0}}, {}, {}]"
    wait = [
        "start.pattern=circle",
        "radius_m=60",
        *(x for x in SHORT if "square" not in x and "goal_d" not in x),
    ]
    waiting = testbed.run(
        load("paper-20-turn", [*wait, own, "manoeuvre_instants=0", "lookahead_m=5"]), tmp_path / "w"
    )
    said = waiting.guarantee("progress")
    assert said["verdict"] == "violated" and said["vehicles"] == [1]
    assert said["bound"] == pytest.approx(8.0)  # 120 m at 15 m/s
    assert said["value"] > 12.0 and said["detail"]["waiting"] == 1 and said["detail"]["of"] == 3
    assert [f.what for f in verify(tmp_path / "w") if f.agrees is False] == []
    for fields in (
        {"value": 3.0, "margin": 5.0, "verdict": "holds"}, {"vehicles": [2]}, {"t_s": said["t_s"] + 0.5},
        {"bound": 90.0, "margin": 90.0 - said["value"], "verdict": "holds"},
        {"detail": said["detail"] | {"arrived": 3}},
    ):  # fmt: skip
        edit_entry(tmp_path / "w", "progress", **fields)
        assert "G7b progress" in [f.what for f in verify(tmp_path / "w") if f.agrees is False], fields
        edit_entry(tmp_path / "w", "progress", **{k: said[k] for k in fields})


def test_random_goals_are_flown_verified_and_a_forged_draw_is_found(tmp_path: Path) -> None:
    run = testbed.run(load("random-goals", SHORT), tmp_path / "r")
    assert run.guarantee("start-safe")["verdict"] == "holds"
    assert run.guarantee("progress")["detail"]["of"] == 3
    found = verify(tmp_path / "r")
    assert [f.what for f in found if f.agrees is False] == []
    assert {"start", "G7 goal", "G7b progress", "nominal"} <= {f.what for f in found if f.agrees}
    manifest = json.loads((tmp_path / "r/manifest.json").read_text())
    manifest["scenario"]["start"]["start_h_m"] = 60.0  # another draw
    (tmp_path / "r/manifest.json").write_text(json.dumps(manifest))
    seal(tmp_path / "r")
    assert "start" in [f.what for f in verify(tmp_path / "r") if f.agrees is False]


def test_a_run_shorter_than_the_way_says_nothing_of_waiting() -> None:
    run = testbed.run(load("paper-2-turn", ["duration_s=0.1"]))
    assert "progress" not in [v.id for v in run.guarantees]
