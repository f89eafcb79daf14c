"""`[goal] on_arrival`: who has left is neither seen nor judged; who loiters circles its goal and is both."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import testbed
from aircraft.kinematic import KinematicFleet
from filters.cbf.collision import CollisionFilter
from filters.model import Command, Limits, View
from testbed.components import catalogue
from testbed.errors import UserError
from testbed.export import acmi
from testbed.records.run import Run
from testbed.scenario.scenario import Scenario, load, parse
from testbed.simulation.refly import refly
from testbed.verification.check import verify
from tests.forgery import seal

COARSE = ["filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=3"]


def passing(*overrides: str, arrives: float = 150.0, duration: float = 16.0) -> Scenario:
    """Two fly towards each other's start 40 m aside; the first has its goal half-way, the other far off."""
    s = load("paper-2-turn", [*COARSE, *overrides])
    places = [
        {"x_m": -200, "y_m": 0, "course_deg": 0, "goal_x_m": -200 + arrives, "goal_y_m": 0},
        {"x_m": 200, "y_m": 0, "course_deg": 180, "goal_x_m": -400, "goal_y_m": 0},
    ]
    start = {"pattern": "list", "places": places}
    fields = {"start": start, "duration_s": duration, "goal": {"on_arrival": "leave"}}
    return parse(s.model_dump(mode="json") | fields)


def disagreeing(folder: Path) -> list[str]:
    return [f.what for f in verify(folder) if f.agrees is False]


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("left") / "r"
    testbed.run(passing(), folder)
    return testbed.load(folder)


def test_a_vehicle_leaves_at_the_first_filter_step_within_its_goal_radius(left: Run) -> None:
    one = left.vehicles[left.vehicles.vehicle == 1]
    distance = np.hypot(one.x_m + 50.0, one.y_m)
    first = one.t_s[distance <= 20.0].iloc[0]
    assert left.manifest["left_s"] == [pytest.approx(first), None]
    assert (one.left == (one.t_s >= first)).all() and not left.vehicles[left.vehicles.vehicle == 2].left.any()


def test_from_then_on_nobody_evades_and_nothing_is_judged(left: Run) -> None:
    gone = left.manifest["left_s"][0]
    alone = left.vehicles[(left.vehicles.t_s >= gone)]
    assert not alone.override.any() and (alone.qp_status[alone.vehicle == 1] == "none").all()
    after = left.pairs[left.pairs.t_s >= gone]
    numbers = [c for c in after.columns if c not in ("t_s", "i", "j")]
    assert len(after) and after[numbers].isna().all(axis=None)
    # It flew on and met the other: 1 m apart without anybody evading, and that is no loss.
    table = left.vehicles.pivot(index="t_s", columns="vehicle", values=["x_m", "y_m", "z_m"])
    apart = np.sqrt(sum((table[c][1] - table[c][2]) ** 2 for c in ("x_m", "y_m", "z_m")))
    assert apart.min() < 5.0 and left.guarantee("separation")["verdict"] == "holds"
    assert left.guarantee("separation")["value"] == pytest.approx(apart[apart.index <= gone + 1e-9].min())
    assert left.guarantee("safe-set")["value"] > 0.0
    stays = testbed.run(parse(left.manifest["scenario"] | {"goal": {"on_arrival": "fly-on"}}))
    assert "left" not in stays.vehicles and "left_s" not in stays.manifest
    assert stays.vehicles.override.any()


def test_arrival_is_read_from_the_time_before(left: Run) -> None:
    goal = left.guarantee("goal")
    assert goal["vehicles"] == [2] and goal["verdict"] == "violated"
    both = testbed.run(passing(arrives=150.0, duration=30.0))
    goal = both.guarantee("goal")
    assert goal["verdict"] == "holds"
    assert goal["detail"]["last_passed_s"] <= both.manifest["left_s"][1]


def test_the_second_opinion_and_the_second_flight_agree(left: Run) -> None:
    assert left.path is not None
    assert disagreeing(left.path) == []
    assert [f.what for f in refly(left.path) if f.agrees is False] == []


@pytest.mark.parametrize(
    "overrides",
    [
        ("filter.kind=limited", "filter.monitor=true"),
        ("filter.kind=none",),
        ("record_dt_s=0.4",),
        ("fdm_dt_s=0.05",),
        ("plant=lagged", "predict_lags=true", "ds_buffer_m=1", "delay_steps=2"),
        ("sensing.position_noise_m=0.3", "sensing.source=sensors", "latency_s=0.1", "filter.kind=limited"),
    ],
    ids=lambda o: o[0],
)
def test_so_it_is_under_other_filters_and_plants(overrides: tuple[str, ...], tmp_path: Path) -> None:
    s = parse(
        load("paper-20-turn", [*COARSE, "vehicles=4", *overrides]).model_dump(mode="json")
        | {"goal": {"on_arrival": "leave"}, "goal_radius_m": 150.0, "duration_s": 14.0}
    )
    run = testbed.run(s, tmp_path / "r", force=True)
    assert any(t is not None and t < 13.0 for t in run.manifest["left_s"])
    assert disagreeing(tmp_path / "r") == []


FORGED: dict[str, Any] = {
    "earlier": lambda m, v, p: m["left_s"].__setitem__(0, m["left_s"][0] - 1.0),
    "never": lambda m, v, p: m["left_s"].__setitem__(0, None),
    "the other too": lambda m, v, p: m["left_s"].__setitem__(1, 3.0),
    "no list": lambda m, v, p: m.__setitem__("left_s", 4.0),
    "without": lambda m, v, p: m.pop("left_s"),
    "a flag": lambda m, v, p: v.__setitem__("left", v.left | (v.t_s > 2.0)),
    "hidden rows": lambda m, v, p: p.loc.__setitem__((p.t_s < 2.0, ["distance_m", "h_m"]), np.nan),
    "shown rows": lambda m, v, p: p.loc.__setitem__((p.t_s > 8.0, "distance_m"), 77.0),
    "nobody leaves": lambda m, v, p: m["scenario"].pop("goal"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_leaving_is_found(left: Run, tmp_path: Path, name: str) -> None:
    from tests.forgery import copied

    assert left.path is not None
    folder = copied(left.path, tmp_path / "f")
    manifest = json.loads((folder / "manifest.json").read_text())
    tables = {n: pd.read_parquet(folder / f"{n}.parquet") for n in ("vehicles", "pairs")}
    FORGED[name](manifest, tables["vehicles"], tables["pairs"])
    (folder / "manifest.json").write_text(json.dumps(manifest))
    for n, table in tables.items():
        table.to_parquet(folder / f"{n}.parquet")
    seal(folder)
    assert "left" in disagreeing(folder)


def test_a_fault_of_who_has_left_ends_nothing() -> None:
    class Failing(KinematicFleet):
        """Vehicle 1 is out of order from 8 s on."""

        def faults(self) -> list[str]:
            state = self.state()
            return ["out of order" if state.x[0] > -45.0 else "", ""]

    def plant(s: Scenario, wind: Any) -> KinematicFleet:
        return Failing(s.vehicles, s.rates.fdm_dt_s)

    parts = testbed.Parts(plant=plant)
    run = testbed.run(passing(), parts=parts)
    assert run.manifest["ended_early"] is None and run.manifest["left_s"][0] is not None
    flies_on = parse(passing().model_dump(mode="json") | {"goal": {"on_arrival": "fly-on"}})
    assert "vehicle 1: out of order" in testbed.run(flies_on, parts=parts).manifest["ended_early"]


def test_a_users_filter_is_told_who_is_still_there() -> None:
    seen: list[Any] = []

    class Watching:
        def __init__(self, s: Scenario, barrier: Any, goal: Any) -> None:
            self.inner = CollisionFilter(barrier, catalogue.alpha(s))

        def __call__(self, view: View, nominal: Command, limits: Limits) -> Any:
            seen.append(None if view.known is None else view.known.tolist())
            return self.inner(view, nominal, limits)

    run = testbed.run(passing(duration=10.0), parts=testbed.Parts(filter=Watching))
    assert run.manifest["ended_early"] is None
    assert seen[0] is None and seen[-1] == [False, True]
    assert run.guarantee("separation")["verdict"] == "holds"


def test_tacview_removes_it_once_and_tables_and_page_still_work(left: Run, tmp_path: Path) -> None:
    from testbed.measures.hdot_ledger import summary
    from testbed.report import playback

    acmi.write(left, tmp_path / "r.txt.acmi")
    text = (tmp_path / "r.txt.acmi").read_text("utf-8-sig")
    (line,) = [n for n, x in enumerate(text.splitlines()) if x.startswith("-")]
    name = text.splitlines()[line][1:]
    assert not any(x.startswith(f"{name},") for x in text.splitlines()[line:])
    shown = playback.data({"a": left})
    assert shown["plants"][0]["left"] == left.manifest["left_s"]
    json.dumps(shown, allow_nan=False)
    assert np.isfinite(summary(left, near_h_m=1e6)["quantiles"]["total"]["1"])


def test_who_loiters_circles_its_goal_as_its_manoeuvre_turns(tmp_path: Path) -> None:
    data = passing(duration=60.0).model_dump(mode="json") | {"goal": {"on_arrival": "loiter"}}
    run = testbed.run(parse(data | {"filter": {"kind": "none"}}), tmp_path / "r")
    one = run.vehicles[(run.vehicles.vehicle == 1) & (run.vehicles.t_s > 55.0)]
    radius = 16.0 / np.radians(11.7)
    assert np.hypot(one.x_m + 50.0, one.y_m).to_numpy() == pytest.approx(radius, abs=0.5)
    assert one.v_nominal_mps.to_numpy() == pytest.approx(16.0) and (one.omega_radps > 0).all()
    assert disagreeing(tmp_path / "r") == []
    assert [f.what for f in refly(tmp_path / "r") if f.agrees is False] == []
    # It is still seen and judged.
    assert run.pairs.h_m.notna().all() and run.guarantee("goal")["detail"]["last_passed_s"] < 35.0


def test_without_a_turning_manoeuvre_the_circle_takes_half_the_turn_rate() -> None:
    data = passing("barrier.kind=straight", duration=40.0).model_dump(mode="json")
    data |= {"goal": {"on_arrival": "loiter"}, "filter": {"kind": "none"}}
    run = testbed.run(parse(data), force=True)
    one = run.vehicles[(run.vehicles.vehicle == 1) & (run.vehicles.t_s > 39.0)]
    assert one.omega_radps.to_numpy() == pytest.approx(np.radians(6.5), rel=0.02)


def test_an_unknown_way_to_arrive_is_one_line() -> None:
    with pytest.raises(UserError, match=r"goal.on_arrival: input should be 'fly-on', 'loiter' or 'le"):
        load("paper-2-turn", ["goal.on_arrival=land"])


def test_flying_on_changes_nothing_in_what_a_scenario_says() -> None:
    assert "goal" not in load("paper-2-turn", ["goal.on_arrival=fly-on"]).model_dump()
