"""Runs with fences: how they are said, refused, flown, judged, recorded; and what the verification finds."""

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from filters.model import State
from testbed.components.catalogue import barrier
from testbed.components.fences import fences
from testbed.errors import UserError
from testbed.export import acmi, csv
from testbed.export.events import events
from testbed.records.run import FENCE_COLUMNS
from testbed.records.store import load as load_run
from testbed.regression.quantities import fly, job, quantities
from testbed.report import fences as report_fences
from testbed.report import figures, playback, run_part
from testbed.report.style import drawing
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from testbed.statistics import rate_of
from testbed.verification.check import check
from tests.forgery import copied, differing, edit_cell, edit_entry, edit_manifest, entry, read, seal

ROOT = Path(__file__).parent.parent
FIELD = '{kind="keep-in", name="field", polygon_m=[[-300,-240],[300,-240],[300,240],[-300,240]]}'
MAST = '{kind="keep-out", name="mast", centre_m=[40, 25], radius_m=20, margin_m=2, vehicles=[1]}'
SHED = '{kind="keep-out", polygon_m=[[-90,-60],[-40,-70],[-60,-20]]}'
BAND = '{kind="heights", floor_m=-8, ceiling_m=60}'
COARSE = ["filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0", "start.radius_m=150"]
PLACES = (
    'start={pattern="list", places=[{x_m=-150, y_m=0, course_deg=0, goal_x_m=700, goal_y_m=0, goal_z_m=-30},'
    "{x_m=150, y_m=0, course_deg=180, goal_x_m=-700, goal_y_m=0}]}"
)
LEAVING = [*COARSE[:3], "lookahead_m=10", PLACES, "duration_s=30", f"fence=[{FIELD}, {MAST}, {SHED}, {BAND}]"]


def flown(*overrides, force=False, out=None):
    return run(load("paper-2-turn", list(overrides)), out, force=force)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run whose goals lie beyond every fence."""
    path = tmp_path_factory.mktemp("fenced") / "run"
    flown(*LEAVING, out=path)
    return path


def test_vehicles_whose_goals_lie_beyond_their_fences_stay_inside(folder):
    made = load_run(folder)
    for name in ("fence-clearance", "fence-safe-set", "qp-feasibility", "separation", "start-safe"):
        assert made.guarantee(name)["verdict"] == "holds", name
    assert list(made.fences) == list(FENCE_COLUMNS)
    assert made.guarantee("fence-clearance")["value"] == pytest.approx(made.fences.clearance_m.min(), abs=0.1)
    assert made.guarantee("fence-safe-set")["value"] == made.fences.h_m.min()
    # The mast is for vehicle 1 alone; every other fence is for both.
    of = made.fences.groupby("fence").vehicle.unique()
    assert {k: v.tolist() for k, v in of.items()} == {1: [1, 2], 2: [1], 3: [1, 2], 4: [1, 2]}
    bare = flown(*LEAVING[:-1])
    beyond = np.abs(bare.vehicles[["x_m", "y_m"]]).max(axis=0)
    assert beyond.x_m > 300
    assert bare.vehicles.z_m.min() < -8
    assert not len(bare.fences)
    assert list(bare.fences) == list(FENCE_COLUMNS)


def test_without_a_filter_the_fences_are_judged_and_lost():
    made = flown(*LEAVING, "filter.kind=none")
    verdict = made.guarantee("fence-clearance")
    assert verdict["verdict"] == "violated"
    assert verdict["value"] == pytest.approx(made.fences.clearance_m.min())
    assert verdict["detail"]["fence"] == 1


def test_a_vehicle_alone_is_judged_against_its_fence(tmp_path):
    alone = ["vehicles=1", *COARSE, f"fence=[{FIELD}, {BAND}]", "duration_s=20"]
    made = flown(*alone, out=tmp_path / "alone")
    assert made.guarantee("fence-clearance")["verdict"] == "holds"
    assert made.guarantee("separation")["verdict"] == "not applicable"
    assert [f.what for f in check(tmp_path / "alone").findings if f.agrees is False] == []


def test_a_passing_between_samples_is_not_missed():
    """Two samples a second, 20 m apart, either side of a mast that is 8 m wide."""
    mast = '{kind="keep-out", centre_m=[0, 0], radius_m=4, vehicles=[1]}'
    start = 'start={pattern="list", places=[{x_m=-30, y_m=0, course_deg=0, goal_x_m=900, goal_y_m=0}]}'
    long = ["filter.kind=none", "vehicles=1", "fdm_dt_s=1", "filter_dt_s=1", "record_dt_s=1", "duration_s=3"]
    made = flown(*long, "limits.v_max_mps=20", "gain_per_s=10", start, f"fence=[{mast}]", force=True)
    assert made.fences.clearance_m.min() > 0
    verdict = made.guarantee("fence-clearance")
    assert verdict["verdict"] == "violated"
    assert verdict["value"] == pytest.approx(-4.0)


def test_the_filter_keeps_more_where_a_remedy_says_so_and_verdicts_stay_the_scenarios():
    s = load("paper-2-turn", [*LEAVING, "remedy.ds_buffer_m=3", "remedy.derate=0.9"])
    made, judged = run(s), fences(s, barrier(s))
    assert made.guarantee("fence-clearance")["value"] >= 3.0
    last = made.vehicles.tail(2)
    state = State(*(last[c].to_numpy() for c in ("x_m", "y_m", "theta_rad", "z_m")))
    assert made.fences.h_m.tail(7).to_numpy() == pytest.approx(judged.values(state), abs=1e-9)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ('{kind="keep-in", polygon_m=[[0,0],[9,9],[9,0],[0,9]]}', "fence.1: the polygon crosses itself"),
        ('{kind="keep-in", polygon_m=[[0,0],[9,9]]}', "three corners at least, got 2"),
        ('{kind="heights", floor_m=50, ceiling_m=20}', "fence.1: floor 50 m and ceiling 20 m"),
        ('{kind="keep-out", centre_m=[0,0], radius_m=-3}', "fence.1.radius_m: .*greater than 0, got -3"),
        ('{kind="keep-out", centre_m=[0,0]}', "centre_m alone is none"),
        ('{kind="keep-out", centre_m=[0,0], polygon_m=[[0,0],[1,0],[0,1]]}', "are two shapes"),
        ('{kind="heights"}', "needs floor_m or ceiling_m"),
        ('{kind="heights", radius_m=3, floor_m=0}', "fence.1.radius_m: has no effect on a height band"),
        ('{kind="cage"}', "fence.1.kind: input should be 'keep-in', 'keep-out' or 'heights', got 'cage'"),
        ('{kind="heights", floor_m=0, vehicles=[3]}', "fence.1.vehicles: 3, but the vehicles are 1 to 2"),
        ('{kind="heights", floor_m=0, vehicles=[1,1]}', "listed twice"),
        ('{kind="heights", floor_m=0, margin_m=-1}', "fence.1.margin_m"),
        ('{kind="heights", floor_m=0, flor_m=1}', "did you mean floor_m"),
    ],
)
def test_a_wrong_fence_is_refused_in_one_line(change, why):
    with pytest.raises(UserError, match=why) as caught:
        load("paper-2-turn", [f"fence=[{change}]"])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("overrides", "why"),
    [
        (
            ["barrier.shared=false", "barrier.pairs=[{i=1, j=2, v_mps=16, omega_degps=9}]"],
            "one evading manoeuvre",
        ),
        (["barrier={kind='straight', zeta_mps=[1, 2]}", f"fence=[{BAND}]"], "fence.1: .*climbs at 1 m/s"),
        (["barrier={kind='straight'}", f"fence=[{SHED}]"], "fence.1: straight flight of vehicle 1 past"),
        (["remedy.air_mass=true", "wind.speed_mps=3"], "remedy.air_mass: .* drifts over the ground"),
        (["barrier={kind='straight'}"], "fence.1: .*vehicle 1 is straight flight and leaves every area"),
    ],
)
def test_a_manoeuvre_that_leaves_every_fence_is_refused(overrides, why):
    with pytest.raises(UserError, match=why):
        load("paper-2-turn", [f"fence=[{FIELD}, {SHED}, {BAND}]", *overrides])


@pytest.mark.parametrize(
    ("fence", "why"),
    [
        (
            '{kind="keep-in", name="yard", polygon_m=[[0,-200],[300,-200],[300,200],[0,200]]}',
            r"vehicle 1 starts 150.0 m beyond fence 1 \(yard\)",
        ),
        (
            '{kind="keep-in", polygon_m=[[-200,-400],[400,-400],[400,100],[-200,100]]}',
            "vehicle 1 starts clear of fence 1, but its evading manoeuvre passes it by 56.7 m",
        ),
        (
            '{kind="keep-in", polygon_m=[[-50,-50],[50,-50],[50,50],[-50,50]]}',
            "fence 1 leave vehicle 1 no room: no turn of 78.4 m radius fits anywhere",
        ),
        (
            '{kind="keep-in", polygon_m=[[-90,-90],[90,-90],[90,90],[-90,90]]},'
            '{kind="keep-out", centre_m=[0,0], radius_m=120}',
            "fence 1 and fence 2 leave vehicle 1 no room",
        ),
        (
            '{kind="heights", floor_m=20},{kind="heights", ceiling_m=10}',
            "fence 1 and fence 2 leave vehicle 1 no height",
        ),
    ],
)
def test_a_start_that_fences_exclude_is_refused_and_flown_only_by_force(fence, why):
    short = [*COARSE, "duration_s=0.1", f"fence=[{fence}]"]
    with pytest.raises(UserError, match=why):
        flown(*short)
    made = flown(*short, force=True)
    assert made.guarantee("start-safe")["verdict"] == "premise not met"
    assert made.guarantee("fence-safe-set")["verdict"] == "premise not met"
    assert made.guarantee("safe-set")["verdict"] == "holds"


def test_scenarios_without_fences_say_nothing_of_them():
    assert "fence" not in load("paper-2-turn").model_dump(mode="json")
    assert load("paper-2-turn", [f"fence=[{FIELD}]"]).model_dump(mode="json")["fence"][0]["name"] == "field"


@pytest.mark.parametrize(
    ("filter_", "plant"), [("limited", "unicycle"), ("centralised", "lagged"), ("none", "unicycle")]
)
def test_the_verification_agrees_with_fenced_runs(tmp_path, filter_, plant):
    path = tmp_path / "run"
    flown(*LEAVING, f"filter.kind={filter_}", f"plant={plant}", "duration_s=15", "fdm_dt_s=0.05", out=path)
    found = check(path)
    assert [f.what for f in found.findings if f.agrees is False] == []
    decided = {f.what for f in found.findings if f.agrees}
    assert {"G10 fence-clearance", "G11 fence-safe-set", "clearance_m", "fence_h_m"} <= decided


def _claim(**fields):
    return lambda path: edit_entry(path, "fence-clearance", **fields)


def _safe_set(**fields):
    return lambda path: edit_entry(path, "fence-safe-set", **fields)


def _nearer(path):
    """A wall moved in by half a metre: nobody was told."""
    s = read(path, "manifest.json")["scenario"]
    s["fence"][0]["margin_m"] = 0.5
    edit_manifest(path, scenario=s)


def _unfenced(path):
    s = read(path, "manifest.json")["scenario"]
    edit_manifest(path, scenario={name: value for name, value in s.items() if name != "fence"})


def test_a_vehicle_that_has_left_is_not_judged_by_its_fences(tmp_path):
    """It flies on straight through the fence behind its goal; the verification finds the same."""
    near = '{kind="keep-in", polygon_m=[[-400,-240],[250,-240],[250,240],[-400,240]], vehicles=[1]}'
    short = [*COARSE, "lookahead_m=10", "duration_s=25", "fdm_dt_s=0.05", f"fence=[{near}]"]
    kept, left = flown(*short), flown(*short, 'goal.on_arrival="leave"', out=tmp_path / "left")
    assert kept.vehicles.x_m.max() < 250 < left.vehicles.x_m.max()
    assert left.guarantee("fence-clearance")["verdict"] == "holds"
    gone = left.fences.t_s >= left.manifest["left_s"][0]
    assert left.fences.clearance_m.isna().equals(gone)
    assert [f.what for f in check(tmp_path / "left").findings if f.agrees is False] == []


FORGED = {
    "a clearance": (lambda path: edit_cell(path, "fences", "clearance_m", 40, 0.01), {"clearance_m"}),
    "an h": (lambda path: edit_cell(path, "fences", "h_m", 41, 0.01), {"fence_h_m"}),
    "a least clearance": (_claim(value=9.0, margin=9.0), {"fence-clearance"}),
    "a bound between samples": (_claim(detail={"fence": 1, "possible_m": -9.0}), {"fence-clearance"}),
    "another fence": (_claim(detail={"fence": 2, "possible_m": 0.0}), {"fence-clearance"}),
    "a least h": (_safe_set(value=4.0, margin=4.0), {"fence-safe-set"}),
    "an h lost": (_safe_set(verdict="violated"), {"fence-safe-set"}),
    "a wall moved": (_nearer, {"clearance_m", "fence_h_m"}),
    "fences taken away": (_unfenced, {"entries"}),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_fence_is_named(folder, tmp_path, name):
    change, due = FORGED[name]
    assert entry(folder, "fence-clearance")["verdict"] == "holds"
    path = copied(folder, tmp_path / "forged")
    change(path)
    seal(path)
    assert due <= differing(path)


def test_a_command_that_leaves_a_fences_row_short_is_named(folder, tmp_path):
    """A command that the rows do not allow; where the vehicles flew is left as it is."""
    made = load_run(folder)
    held = made.vehicles[made.vehicles.override & (made.vehicles.vehicle == 1)]
    row = int(held.index[len(held) // 2])
    path = copied(folder, tmp_path / "forged")
    edit_cell(path, "vehicles", "omega_command_radps", row, 0.05)
    seal(path)
    assert {"minimal"} <= differing(path)


def test_report_figures_player_and_exports_have_the_fences(folder, tmp_path):
    made = load_run(folder)
    scenario = made.manifest["scenario"]
    shown = playback.data({"unicycle": made})["fences"]
    assert [f["title"] for f in shown] == ["fence 1 (field)", "fence 2 (mast)", "fence 3"]
    assert [f["inside"] for f in shown] == [True, False, False]
    assert report_fences.bands(scenario) == ["fence 4: above -8 m and below 60 m"]
    with drawing():
        path = figures.panels({"unicycle": made}).axes[3]
        assert len(path.patches) == 3
    page = run_part.part({"unicycle": made}, None, "x")
    assert page.headline == "Separation kept on unicycle; fences kept"
    (section,) = [s for s in page.sections if s.title == "Fences"]
    assert len(section.blocks[0].rows) == 4
    assert not [e for e in csv.write(made, tmp_path) if e.kind == "beyond-fence"]
    assert (tmp_path / "fences.csv").read_text().count("\n") == len(made.fences) + 1
    acmi.write(made, tmp_path / "run.txt.acmi")
    lines = (tmp_path / "run.txt.acmi").read_text().splitlines()
    posts = [line for line in lines if "Type=Navaid+Static+Waypoint" in line]
    assert len(posts) == 4 + 24 + 3
    assert posts[3].startswith("10003,") and posts[3].endswith("Next=10000")


def test_a_page_says_that_a_fence_was_left_and_events_name_it():
    made = flown(*LEAVING, "filter.kind=none")
    page = run_part.part({"unicycle": made}, None, "x")
    assert page.headline.endswith("fences LEFT on unicycle")
    left = [e for e in events(made) if e.kind == "beyond-fence"]
    assert any(e.text.startswith("beyond fence 1 (field): ") for e in left)


def test_baselines_and_the_falsifier_know_fences(call, capsys):
    fenced, bare = load("paper-2-turn", LEAVING), load("paper-2-turn")
    names = {q.name for q in quantities(fenced)} - {q.name for q in quantities(bare)}
    assert names == {"fence-clearance", "fence-safe-set", "fence-clearance lost", "fence-safe-set lost"}
    row = fly(job(fenced, "x", {"duration_s": 5.0}, 1))
    assert row["fence-clearance lost"] == 0.0
    assert row["fence-clearance"] > 0
    assert call("falsify", "paper-2-turn", "--guarantee", "fence-clearance") == 2
    assert "paper-2-turn has no [[fence]] table" in capsys.readouterr().err


def test_the_guides_table_of_aircraft_is_that_of_the_runs_kept():
    page = (ROOT / "docs/guide/fences.md").read_text(encoding="utf-8")
    kept = pd.read_csv(ROOT / "docs/guide/data/fences-x8.csv", keep_default_na=False)
    asked = tomllib.loads((ROOT / "testbed/campaigns/files/fences-x8.toml").read_text(encoding="utf-8"))
    assert kept.remedy.unique().tolist() == asked["remedies"]
    for name, of in kept.groupby("remedy"):
        assert of.seed.tolist() == list(range(asked["first_seed"], asked["first_seed"] + asked["seeds"]))
        assert ((of.verdict == "holds") == (of.clearance_m >= 0)).all()
        rate = rate_of(int((of.verdict != "holds").sum()), len(of))
        share = f"{100 * rate.low:.1f} to {100 * rate.high:.1f} %"
        least, median = of.clearance_m.min(), of.clearance_m.median()
        line = f"| {name} | {rate.count} of {rate.runs} | {share} | {least:.2f} m | {median:.2f} m |"
        assert line in page
