"""[[vehicle]] tables: what one vehicle has of its own, and that a fleet of equals flies as it always did."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.barriers.rollout import RolloutBarrier
from filters.model import State, step
from testbed import UserError, run
from testbed.campaigns.bases import bases
from testbed.campaigns.file import parse as campaign
from testbed.campaigns.plan import expand
from testbed.components import catalogue, remedies
from testbed.components.initial_conditions import generators, places
from testbed.scenario import fleet
from testbed.scenario.scenario import load, parse
from testbed.scenario.variants import changed
from testbed.verification.check import verify

TWO = [
    {"x_m": -60.0, "y_m": 0.0, "course_deg": 3.0, "goal_x_m": 200.0, "goal_y_m": 0.0},
    {"x_m": 60.0, "y_m": 2.0, "course_deg": 180.0, "goal_x_m": -200.0, "goal_y_m": 0.0},
]
SHORT = {"name": "two", "duration_s": 0.1, "checks": {"manoeuvre_instants": 1}}
OVERTAKING = """
name = "overtaking"
duration_s = 0.1
checks = { manoeuvre_instants = 1 }
[[vehicle]]
x_m = -60
y_m = 0
course_deg = 0
speed_mps = 24
goal_x_m = 600
goal_y_m = 0
goal_z_m = 30
[vehicle.limits]
v_max_mps = 24
[[vehicle]]
x_m = 0
y_m = 1
course_deg = 0
speed_mps = 17
goal_x_m = 500
goal_y_m = 0
[vehicle.limits]
v_max_mps = 17
zeta_max_mps = 1
[[vehicle]]
x_m = 60
y_m = -1
course_deg = 0
speed_mps = 20
goal_x_m = 500
goal_y_m = 0
z_m = 12
[vehicle.limits]
v_max_mps = 20
"""


def write(folder: Path, text: str) -> str:
    path = folder / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


angles, offsets = st.floats(-20, 20), st.floats(-15, 15)


@settings(max_examples=6, deadline=None)
@given(
    st.lists(st.tuples(offsets, angles, offsets), min_size=2, max_size=3),
    st.sampled_from(["centralised", "limited", "none"]),
    st.sampled_from(["unicycle", "lagged"]),
    st.booleans(),
)
def test_equal_vehicles_in_tables_give_the_numbers_of_a_list_of_places(drawn, kind, plant, rollout):
    listed, tables = [], []
    for k, (y, course, z) in enumerate(drawn):
        where = {"x_m": 70.0 * k, "y_m": y, "course_deg": course, "z_m": z}
        goal = {"goal_x_m": 900.0, "goal_y_m": 0.0, "goal_z_m": 1.0}
        listed.append(where | goal)
        tables.append(where | goal | ({"limits": {"v_max_mps": 22.0}} if k % 2 else {"speed_mps": 21.0}))
    common = {"plant": plant, "filter": {"kind": kind}, "limits": {"v_max_mps": 22.0}}
    start = {"speed_mps": 21.0} if plant == "lagged" else {}
    turn = {"v_mps": 16.0, "omega_degps": 11.7}
    one = SHORT | common | {"start": {"pattern": "list", "places": listed, "speed_mps": 21.0}}
    two = SHORT | common | {"vehicle": tables, "start": {"speed_mps": 21.0} | start}
    if rollout:
        one["barrier"] = {"kind": "rollout", "manoeuvres": [turn]}
        two["vehicle"] = [t | {"manoeuvre": turn} for t in tables]
    first, second = (run(parse(s | {"vehicles": len(drawn)}, keep_idle=True), force=True) for s in (one, two))
    for name in ("vehicles", "pairs"):
        a, b = getattr(first, name), getattr(second, name)
        assert list(a.columns) == list(b.columns)
        assert all(np.array_equal(a[c], b[c], equal_nan=a[c].dtype.kind == "f") for c in a)
    assert [v.to_json() for v in first.guarantees] == [v.to_json() for v in second.guarantees]


def test_scenarios_without_tables_say_nothing_of_them():
    data = load("paper-2-turn").model_dump(mode="json")
    assert "vehicle" not in data and "intruders" not in data
    said = parse({"name": "a", "vehicle": [{"z_m": 3.0}, {}]}).model_dump(mode="json")
    assert said["vehicle"] == [{"z_m": 3.0}, {}] and said["vehicles"] == 2
    assert parse(said).model_dump(mode="json") == said


def test_each_vehicle_has_its_own_start_speed_limits_and_goal(tmp_path):
    s = load(write(tmp_path, OVERTAKING))
    start, goal = places(s, generators(s.seed)["start"])
    assert start.x.tolist() == [-60, 0, 60] and start.z.tolist() == [0, 0, 12]
    assert goal[:, 2].tolist() == [30, 0, 0] and fleet.speeds(s) == [24, 17, 20]
    limits = catalogue.limits(s)
    assert limits.v_max.tolist() == [24, 17, 20] and limits.zeta_max.tolist() == [3.9, 1, 3.9]
    flown = run(s)
    fastest = flown.vehicles.groupby("vehicle").v_command_mps.max()
    assert (fastest.to_numpy() <= [24, 17, 20]).all() and fastest[1] == 24
    lagged = run(changed(s, {"plant": "lagged"}))
    assert lagged.vehicles.v_mps.to_numpy()[:3].tolist() == [24, 17, 20]


def test_what_a_vehicle_does_not_say_comes_from_the_scenarios_own_tables():
    s = parse(
        {
            "name": "a",
            "plant": "jsbsim",
            "airframes": ["x8", "rascal"],
            "guidance": {"gain_per_s": 0.2, "lookahead_m": 3.0},
            "vehicle": [{"airframe": "rascal"}, {"guidance": {"gain_per_s": 0.4}}],
        }
    )
    assert fleet.airframes(s) == ["rascal", "rascal"]
    assert [(g.gain_per_s, g.lookahead_m) for g in fleet.guidances(s)] == [(0.2, 3.0), (0.4, 3.0)]
    circle = parse({"name": "a", "vehicles": 2})
    for own, common in zip(*(places(x, generators(1)["start"])[0].array() for x in (s, circle)), strict=True):
        assert np.array_equal(own, common)


def test_overrides_and_axes_name_vehicles_by_number(tmp_path):
    path = write(tmp_path, OVERTAKING)
    s = load(path, ["vehicle.2.speed_mps=16", "vehicle.3.limits.v_max_mps=21", "vehicle.1.filter=false"])
    assert fleet.speeds(s) == [24, 16, 20] and s.vehicle[2].limits.v_max_mps == 21
    assert fleet.intruders(s) == (0,)
    assert changed(s, {"vehicle.2.speed_mps": 15.5}).vehicle[1].speed_mps == 15.5
    grid = {"vehicle.1.limits.v_max_mps": [22, 24]}
    told = campaign({"name": "c", "scenario": path, "seeds": 1, "grid": grid}, "c")
    plan = expand(told, bases(told, tmp_path))
    assert [plan.varied(c, 0)["vehicle"][0]["limits"]["v_max_mps"] for c in plan.cells] == [22, 24]


def brute(gamma, state, d_safe):
    """h of every pair by a fine sampling of the manoeuvres, refined by a golden section at its least."""
    n, found = len(state), []
    for i in range(n):
        for j in range(i + 1, n):

            def apart(t, i=i, j=j):
                ends = [step(state[[k] * len(t)], gamma[[k] * len(t)], t) for k in (i, j)]
                return np.linalg.norm(ends[0].position - ends[1].position, axis=-1)

            t = np.linspace(0.0, 400.0, 100_001)
            k = int(np.argmin(apart(t)))
            low, high = t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)]
            for _ in range(4):
                t = np.linspace(low, high, 1001)
                k = int(np.argmin(apart(t)))
                low, high = t[max(k - 1, 0)], t[min(k + 1, 1000)]
            found.append(apart(t)[k] - d_safe)
    return np.array(found)


@pytest.mark.parametrize("seed", range(2))
def test_the_barrier_over_each_vehicles_manoeuvre_is_the_least_distance_flown(seed):
    own = [
        {"v_mps": 16.0, "omega_degps": 11.7},
        {"v_mps": 21.0, "omega_degps": 23.4, "zeta_mps": 1.0},
        {"v_mps": 18.0, "omega_degps": -11.7},
    ]
    s = parse(
        {
            "name": "a",
            "limits": {"omega_max_degps": 30.0},
            "vehicle": [{"manoeuvre": m} for m in own] + [{}],
        }
    )
    b = catalogue.barrier(s)
    assert isinstance(b, RolloutBarrier)
    gamma = b.manoeuvre(4)
    assert gamma.v.tolist() == [16, 21, 18, 16]
    assert np.degrees(gamma.omega).round(9).tolist() == [11.7, 23.4, -11.7, 11.7]
    rng = np.random.default_rng(seed)
    state = State(*rng.uniform(-150, 150, (2, 4)), rng.uniform(-3, 3, 4), rng.uniform(-20, 20, 4))
    np.testing.assert_allclose(b.values(state).h, brute(gamma, state, 5.0), atol=1e-6)


def test_remedies_change_the_manoeuvres_that_vehicles_have():
    tables = [{"manoeuvre": {"v_mps": 18.0, "omega_degps": -11.7}}, {}]
    s = parse({"name": "a", "vehicle": tables, "remedy": {"derate": 0.5, "ds_buffer_m": 2.0}})
    own = catalogue.barrier(remedies.scenario(s))
    gamma = own.manoeuvre(2)
    assert own.d_safe == 7.0 and np.degrees(gamma.omega).round(9).tolist() == [-5.85, 5.85]
    assert catalogue.barrier(s).manoeuvre(2).v.tolist() == [18.0, 16.0]


BOTH = {"name": "a"}
BAD = [
    (BOTH | {"vehicles": 3, "vehicle": [{}, {}]}, "vehicles: 3, but 2 [[vehicle]] tables"),
    (BOTH | {"vehicle": [{"x_m": 1.0}, {}]}, "vehicle.1: x_m without y_m and course_deg"),
    (BOTH | {"vehicle": [{}, {"goal_y_m": 1.0}]}, "vehicle.2: goal_y_m without goal_x_m"),
    (BOTH | {"vehicle": [{}, {"limits": {"v_min_mps": 30.0}}]}, "vehicle.2.limits: v_min_mps 30 is above"),
    (
        BOTH | {"vehicle": [{}, {"limits": {"v_min_mps": 18.0}}]},
        "vehicle.2: its limits exclude its manoeuvre: v_mps 16 is below v_min_mps 18",
    ),
    (
        BOTH | {"vehicle": [{"manoeuvre": {"v_mps": 20.0, "omega_degps": 14.0}}, {}]},
        "vehicle.1: its limits exclude its manoeuvre: omega_degps 14 is beyond omega_max_degps 13",
    ),
    (
        BOTH | {"vehicle": [{}, {"sped_mps": 3.0}]},
        "vehicle.2.sped_mps: unknown field; did you mean",
    ),
    (
        BOTH | {"vehicle": [{}, {"guidance": {"gian_per_s": 3.0}}]},
        "vehicle.2.guidance.gian_per_s: unknown field; did you mean gain_per_s",
    ),
    (
        BOTH | {"barrier": {"kind": "euclidean"}, "vehicle": [{}, {"manoeuvre": {"v_mps": 20.0}}]},
        "vehicle.2.manoeuvre: a 'euclidean' barrier uses no manoeuvre",
    ),
    (
        BOTH
        | {
            "barrier": {
                "shared": False,
                "pairs": [{"i": 1, "j": 2, "v_mps": 16.0, "omega_degps": 10.0}],
            },
            "vehicle": [{}, {"manoeuvre": {"v_mps": 20.0}}],
        },
        "vehicle.2.manoeuvre: barrier.shared = false gives each pair its own",
    ),
    (
        BOTH | {"vehicle": [{"guidance": {"delay_steps": 2}}, {}]},
        "vehicle.1.guidance.delay_steps: one for all; guidance.delay_steps says it",
    ),
    (
        BOTH | {"vehicle": [{"airframe": "x8"}, {}]},
        "vehicle.1.airframe: has no effect: no airframe flies",
    ),
    (
        BOTH | {"start": {"radius_m": 100.0}, "vehicle": TWO},
        "start.radius_m: has no effect: every [[vehicle]] table has its own start and goal",
    ),
    (
        BOTH
        | {"vehicle": [{"manoeuvre": {"v_mps": 17.0, "omega_degps": 9.0}}, {}], "barrier": {"delta_m2": 1.0}},
        "barrier.delta_m2: has no effect: vehicles have manoeuvres of their own",
    ),
]


@pytest.mark.parametrize(("data", "said"), BAD)
def test_a_wrong_table_is_refused_in_one_line(data, said):
    with pytest.raises(UserError) as caught:
        parse(data)
    assert said in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("v_max_mps = 17", "v_max_mps = 'a'", "vehicle.2.limits.v_max_mps: input should be a valid number"),
        ("speed_mps = 20", "sped_mps = 20", "vehicle.3.sped_mps: unknown field"),
        ("v_max_mps = 17", "v_max_mps = 14", "vehicle.2.limits: v_min_mps 15 is above v_max_mps 14"),
        ("y_m = -1\n", "", "vehicle.3: x_m, course_deg without y_m"),
    ],
)
def test_messages_name_table_field_and_line(tmp_path, old, new, said):
    text = OVERTAKING.replace(old, new, 1)
    with pytest.raises(UserError) as caught:
        load(write(tmp_path, text))
    assert said in str(caught.value)
    line = int(str(caught.value).rpartition("(line ")[2].rstrip(")"))
    number = int(said.split(".")[1][0])
    begins = [k for k, row in enumerate(text.splitlines(), 1) if row == "[[vehicle]]"] + [10**6]
    assert begins[number - 1] <= line < begins[number]


@pytest.mark.parametrize(
    ("item", "said"),
    [
        ("vehicle.4.speed_mps=3", "vehicle.4: there is no such table; the scenario has 3 [[vehicle]] tables"),
        ("vehicle.0.speed_mps=3", "vehicle.0: there is no such table"),
        ("vehicle.two.speed_mps=3", "write vehicle.NUMBER.FIELD, such as vehicle.2.filter"),
        ("vehicle.2.sped_mps=3", "unknown field; did you mean speed_mps"),
        ("vehicles=5", "vehicles: 5, but 3 [[vehicle]] tables"),
    ],
)
def test_a_wrong_override_of_a_vehicle_is_refused(tmp_path, item, said):
    with pytest.raises(UserError, match="vehicle") as caught:
        load(write(tmp_path, OVERTAKING), [item])
    assert said in str(caught.value)


def test_an_unknown_airframe_names_the_table():
    s = parse({"name": "a", "plant": "jsbsim", "vehicle": [{}, {"airframe": "x9"}]})
    with pytest.raises(UserError, match=r"vehicle\.2\.airframe: "):
        catalogue.airframes(s)


def test_two_vehicles_at_one_place_are_refused():
    tables = [TWO[0], TWO[1] | {"x_m": TWO[0]["x_m"], "y_m": TWO[0]["y_m"]}]
    with pytest.raises(UserError, match="vehicles 1 and 2 start at one place"):
        run(parse(SHORT | {"vehicle": tables}), force=True)


def test_relative_airframes_of_vehicles_start_beside_the_file(tmp_path):
    (tmp_path / "wing").mkdir()
    text = 'name = "a"\nplant = "jsbsim"\n[[vehicle]]\nairframe = "wing"\n[[vehicle]]\n'
    assert load(write(tmp_path, text)).airframes_folder == tmp_path.resolve().as_posix()


@pytest.mark.parametrize("manoeuvre", [None, {"v_mps": 18.0, "omega_degps": 11.7}])
def test_verification_reads_vehicles_tables_by_itself(tmp_path, manoeuvre):
    data = tomllib.loads(OVERTAKING)
    if manoeuvre:
        data["vehicle"][2]["manoeuvre"] = manoeuvre
    run(parse(data), tmp_path / "run")
    wrong = [f for f in verify(tmp_path / "run") if f.agrees is False]
    assert not wrong
    # A forged table of limits leaves commands outside them.
    manifest = tmp_path / "run" / "manifest.json"
    said = json.loads(manifest.read_text())
    said["scenario"]["vehicle"][0]["limits"]["v_max_mps"] = 23.0
    manifest.write_text(json.dumps(said))
    found = {f.what for f in verify(tmp_path / "run") if f.agrees is False}
    assert "G5 command-limits" in found
