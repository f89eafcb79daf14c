"""Guidance that keeps vehicles apart, layers of height and a roundabout: closed forms and whole runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import testbed
from filters.barriers.closed_form import TurnBarrier
from filters.model import Command, Limits, State, View, step
from testbed.components.following.evading import evading
from testbed.components.following.layers import Layers, dealt
from testbed.components.following.roundabout import Roundabout, ring_radius, sense_against
from testbed.errors import UserError
from testbed.scenario import guidance as tables
from testbed.scenario.scenario import Scenario, load, parse
from testbed.simulation.refly import refly
from testbed.verification.check import verify
from tests.forgery import copied, differing, edit_cell, read, seal, write

DT = 0.05
OMEGA = np.radians(13.0)
COARSE = ["filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]


def limits(n: int) -> Limits:
    return Limits.of(np.tile([15.0, 25.0, OMEGA, 3.9], (n, 1)))


def flown(law: Any, state: State, duration: float) -> np.ndarray:
    """Poses (S, N, 4) of unicycles that fly what the law wants, inside the limits."""
    box, poses = limits(len(state)), []
    for k in range(round(duration / DT)):
        poses.append(state.array())
        wanted = box.clip(law(k * DT, View(state, Command(np.full(len(state), 20.0), 0.0, 0.0))))
        state = step(state, wanted, DT)
    return np.array(poses)


def on_ring(radius: float, angle: np.ndarray, sense: float, z: np.ndarray) -> State:
    theta = angle + sense * np.pi / 2
    return State(radius * np.cos(angle), radius * np.sin(angle), theta, z)


@given(
    radius=st.floats(20, 600), omega=st.sampled_from([0.2, -0.2, 0.07]), seed=st.integers(0, 2**31),
    speed=st.floats(12, 25),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_on_a_ring_against_gamma_h_is_the_distance_less_ds(
    radius: float, omega: float, seed: int, speed: float
) -> None:
    rng = np.random.default_rng(seed)
    gamma = Command(np.full(5, speed), np.full(5, omega), np.zeros(5))
    state = on_ring(radius, rng.uniform(-np.pi, np.pi, 5), sense_against(gamma), rng.uniform(-9, 9, 5))
    values = TurnBarrier(speed, omega, 5.0, delta=0.0).values(state)
    apart = np.linalg.norm(state.position[values.i] - state.position[values.j], axis=1)
    # delta = 0 is the paper's h without its rounding.
    assert values.h == pytest.approx(apart - 5.0, abs=1e-6)


def test_with_gamma_s_sense_a_ring_of_two_turn_radii_has_no_h_at_all() -> None:
    speed, omega = 16.0, 0.2
    state = on_ring(2 * speed / omega, np.arange(5) * 2 * np.pi / 5, 1.0, np.zeros(5))
    values = TurnBarrier(speed, omega, 5.0, delta=0.0).values(state)
    # All circle about one centre: the least distance is zero, and h's root is rounded at 0.25 m.
    assert values.h == pytest.approx(np.full(10, -4.75), abs=1e-5)


@given(count=st.integers(2, 200), room=st.floats(1, 60))
@settings(max_examples=40, deadline=None)
def test_the_radius_gives_neighbours_the_room_asked_for(count: int, room: float) -> None:
    radius = ring_radius(tables.Roundabout(kind="roundabout", room_m=room), count, limits(count), 5.0)
    assert 2 * radius * np.sin(np.pi / count) - 5.0 >= room - 1e-9
    assert radius >= 20.0 / (0.6 * OMEGA) - 1e-9
    assert ring_radius(tables.Roundabout(kind="roundabout"), 1, limits(1), 5.0) == 20.0 / (0.6 * OMEGA)


def test_a_manoeuvre_without_one_sense_has_no_roundabout() -> None:
    for omega in ([0.0, 0.0], [0.2, -0.2], [0.2, 0.0], []):
        with pytest.raises(ValueError, match="has none"):
            sense_against(Command(np.full(len(omega), 20.0), np.array(omega), np.zeros(len(omega))))


def anywhere(seed: int, n: int) -> tuple[State, np.ndarray]:
    """Poses and goals (n, 3) in a square of 900 m, 60 m in height, whatever lies between them."""
    rng = np.random.default_rng(seed)
    x, y, z = rng.uniform(-1, 1, (3, n)) * [[450], [450], [30]]
    return State(x, y, rng.uniform(-np.pi, np.pi, n), z), rng.uniform(-1, 1, (n, 3)) * [450, 450, 30]


def arrived_s(poses: np.ndarray, goal: np.ndarray, radius: float = 20.0) -> np.ndarray:
    """(N,) s, inf if never."""
    near = np.linalg.norm(poses[:, :, [0, 1, 3]] - goal, axis=-1) <= radius
    return np.where(near.any(axis=0), near.argmax(axis=0) * DT, np.inf)


@pytest.mark.parametrize("kind", ["layers", "roundabout", "tight ring"])
def test_a_vehicle_alone_arrives_from_anywhere_at_any_goal(kind: str) -> None:
    """300 draws each: nobody circles its goal for ever, nor the ring."""
    state, goal = anywhere(11, 300)
    box = limits(300)
    law: Any
    if kind == "layers":
        law = Layers(goal, 20.0, np.linspace(-28, 28, 300), 20.0, np.full(300, 2.7), 0.5, 0.3, box)
    else:
        radius = 147.0 if kind == "roundabout" else 95.0
        law = Roundabout(goal, np.array([10.0, -20.0]), radius, -1.0, 20.0, 0.5, 0.3, box)
    when = arrived_s(flown(law, state, 130.0), goal)
    assert np.isfinite(when).all(), np.flatnonzero(~np.isfinite(when))


def test_a_swap_around_the_ring_needs_no_filter() -> None:
    for n, least in ((2, 150.0), (50, 14.0)):
        fields = [
            f"vehicles={n}",
            "filter_dt_s=0.1",
            "record_dt_s=1",
            "manoeuvre_instants=0",
            "duration_s=26",
        ]
        s = load("paper-20-turn", [*fields, "guidance.kind=roundabout", "filter.kind=none"])
        run = testbed.run(s)
        assert run.guarantee("separation")["value"] > least  # flown: 184, 16.2; of twenty 40.5
        # h is the distance less Ds on the ring, and not much less on the way onto it.
        assert run.guarantee("safe-set")["value"] > least - 6.0
        assert run.guarantee("goal")["verdict"] == "holds"
        assert run.guarantee("goal")["detail"]["last_passed_s"] < 25.0


def layer(**fields: Any) -> tables.Layers:
    return tables.Layers(kind="layers", **fields)


def test_layers_are_dealt_evenly_and_neighbours_in_number_are_not_neighbours_in_height() -> None:
    way = np.full(20, 400.0)
    made = dealt([layer()] * 20, limits(20), way, 20.0, 5.0)
    # (400 / 2 - 20) m at 20 m/s leave 9 s to climb at 0.7 of 3.9 m/s: 24.6 m up and down, layers 8 m apart.
    heights, many = np.unique(made, return_counts=True)
    assert heights.tolist() == [-24.0, -16.0, -8.0, 0.0, 8.0, 16.0, 24.0] and many.max() == 3
    assert np.abs(np.diff(made)).min() >= 16.0
    for count in range(1, 40):
        heights = dealt([layer(layers=count, spacing_m=6.0, middle_m=50.0)] * count, limits(count),
                        np.full(count, 400.0), 20.0, 5.0)  # fmt: skip
        assert np.sort(heights) == pytest.approx(50.0 + 6.0 * (np.arange(count) - (count - 1) / 2))
        assert count in (1, 2, 3, 4, 6) or np.abs(np.diff(heights)).min() > 6.0
    # A way too short to climb on has one layer; a layer of its own is the vehicle's.
    assert dealt([layer()] * 3, limits(3), np.full(3, 30.0), 20.0, 5.0).tolist() == [0.0] * 3
    assert dealt([layer(height_m=7.0), layer()], limits(2), np.full(2, 30.0), 20.0, 5.0).tolist() == [
        7.0,
        0.0,
    ]


def test_with_a_goal_passed_aside_there_are_more_layers_and_the_nearest_ones_are_not_left() -> None:
    made = dealt([layer(goal_offset_m=12.0)] * 20, limits(20), np.full(20, 400.0), 20.0, 5.0)
    assert np.unique(made).tolist() == [8.0 * k - 36.0 for k in range(10)]
    goal = np.array([[0.0, 0.0, 0.0]] * 2)
    law = Layers(goal, 20.0, np.array([12.0, 28.0]), 20.0, np.full(2, 2.0), 0.5, 0.3, limits(2), 12.0)
    for distance in (300.0, 100.0, 25.0):
        height = np.array([12.0, min(28.0, 12.0 + (distance - 20.0) * 0.1)])
        at = State(np.full(2, -distance), np.zeros(2), np.zeros(2), height)
        zeta = law(0.0, View(at, Command.of(np.zeros((2, 3))))).zeta
        assert zeta[0] == pytest.approx(0.0) and zeta[1] == pytest.approx(-2.0 if height[1] < 28 else 0.0)


def evading_law(goal: np.ndarray, layers: np.ndarray) -> Layers:
    n = len(goal)
    known = evading(Command.of(np.tile([16.0, 0.2, 0.0], (n, 1))), layers, 8.0)
    return Layers(goal, 20.0, layers, 20.0, np.full(n, 2.0), 0.5, 0.3, limits(n), 12.0, known)


def test_long_turns_have_gammas_sense_and_after_the_goal_gamma_is_flown_at_a_height_of_its_own() -> None:
    layers = np.array([-4.0, 4.0, -4.0, 4.0])
    goal = np.array([[-300.0, -250.0, 0.0], [300.0, -250.0, 0.0], [0.0, 0.0, 0.0], [0.0, 10.0, 0.0]])
    law = evading_law(goal, layers)
    at = State(np.zeros(4), np.zeros(4), np.zeros(4), layers)
    wanted = law(0.0, View(at, Command.of(np.zeros((4, 3)))))
    # Behind on the right: the shorter way is to the right. Ahead on the right: there it goes.
    assert wanted.omega[0] > 0.2 and wanted.omega[1] < -0.2
    assert wanted.v[2:].tolist() == [16.0, 16.0] and wanted.omega[2:].tolist() == [0.2, 0.2]
    parked = evading(Command.of(np.tile([16.0, 0.2, 0.0], (4, 1))), layers, 8.0).parking
    assert np.unique(parked).tolist() == [-20.0, -12.0, 12.0, 20.0]
    assert np.array_equal(np.sign(wanted.zeta[2:]), np.sign(parked[2:] - layers[2:]))
    assert np.abs(wanted.zeta[2:]).max() <= 2.0


def test_two_that_wait_in_one_layer_change_to_different_ones() -> None:
    layers = np.tile([-12.0, -4.0, 4.0, 12.0, 20.0], 4)
    known = evading(Command.of(np.tile([16.0, 0.2, 0.0], (20, 1))), layers, 8.0)
    later = np.array([[each[k] for each in known.others] for k in range(6)])
    assert set(np.unique(later)) <= set(layers) and np.all(later[0] != layers)
    # No two that share their layer at the start share each of the next six.
    for first in range(20):
        for other in range(first + 5, 20, 5):
            assert np.any(later[:, first] != later[:, other])
    law = evading_law(np.tile([500.0, 0.0, 0.0], (20, 1)), layers)
    at = State(np.zeros(20), np.zeros(20), np.zeros(20), layers)
    still = Command.of(np.zeros((20, 3)))
    assert np.abs(law(0.0, View(at, still)).zeta).max() < 1e-9
    assert np.abs(law(15.0, View(at, still)).zeta).max() < 1e-9
    changed = law(16.0, View(at, still)).zeta
    assert np.array_equal(np.sign(changed), np.sign(later[0] - layers))


def test_vehicles_make_way_only_by_a_turn() -> None:
    with pytest.raises(UserError, match=r"guidance\.evading: .* barrier\.kind = 'turn' has one"):
        testbed.run(load("paper-2-straight", ["guidance.kind=layers", "guidance.evading=true"]))


def test_a_layer_is_climbed_to_held_and_left_in_time_for_the_goal() -> None:
    goal = np.array([[600.0, 0.0, 5.0], [600.0, 50.0, 5.0]])
    law = Layers(goal, 20.0, np.array([24.0, -16.0]), 20.0, np.full(2, 2.73), 0.5, 0.3, limits(2))
    poses = flown(law, State([0.0, 0.0], [0.0, 50.0], 0.0, [0.0, 0.0]), 60.0)
    z, x = poses[:, :, 3], poses[:, :, 0]
    held = (x > 340) & (x < 400)
    assert np.abs(z[held[:, 0], 0] - 24.0).max() < 0.3 and np.abs(z[held[:, 1], 1] + 16.0).max() < 0.3
    at = np.argmax(x[:, 0] > 580.0)
    assert z[at] == pytest.approx([5.0, 5.0], abs=0.3)  # the descent ends at the goal radius
    assert z[-1] == pytest.approx([24.0, -16.0], abs=0.3)  # and after the goal the layer comes again


def test_twenty_in_layers_arrive_under_the_paper_s_filter_and_keep_its_safe_set() -> None:
    s = load("paper-20-turn", [*COARSE, "guidance.kind=layers", "duration_s=20"])
    run = testbed.run(s)
    assert run.guarantee("safe-set")["value"] > 1.0  # flown: 2.1 m; straight ahead 1.3 m
    assert run.guarantee("goal")["verdict"] == "holds"


def made(table: dict[str, Any], *overrides: str, **fields: Any) -> Scenario:
    data = load(
        "paper-2-turn", ["vehicles=5", "duration_s=24", "filter_dt_s=0.1", "record_dt_s=0.1", *overrides]
    )
    plain = data.model_dump(mode="json") | {"guidance": table, "checks": {"manoeuvre_instants": 0}} | fields
    return parse(plain)


RUNS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "layers": ({"kind": "layers"}, {"spacing_m": 9.5}),
    "layers, set": (
        {"kind": "layers", "layers": 4, "spacing_m": 7.0, "middle_m": 3.0, "climb_mps": 2.0},
        {"climb_mps": 2.5},
    ),
    "roundabout": ({"kind": "roundabout"}, {"radius_m": 150.0}),
    "roundabout, set": (
        {
            "kind": "roundabout",
            "radius_m": 120.0,
            "centre_m": [30, -50],
            "approach_m": 40.0,
            "speed_mps": 18.0,
        },
        {"centre_m": [30, -51]},
    ),
}


@pytest.mark.parametrize("name", RUNS)
def test_a_run_is_verified_and_flown_again(name: str, tmp_path: Path) -> None:
    table, forged = RUNS[name]
    testbed.run(made(table), tmp_path / "r", force=True)
    found = verify(tmp_path / "r")
    assert [f.what for f in found if f.agrees is False] == []
    assert {"nominal", "path-and-time"} <= {f.what for f in found if f.agrees}
    assert [f.what for f in refly(tmp_path / "r") if f.agrees is False] == []
    manifest = json.loads((tmp_path / "r/manifest.json").read_text())
    manifest["scenario"]["guidance"] |= forged
    (tmp_path / "r/manifest.json").write_text(json.dumps(manifest))
    seal(tmp_path / "r")
    assert "nominal" in [f.what for f in verify(tmp_path / "r") if f.agrees is False]


def placed(x: float, course: float, goal: list[float], **layers: Any) -> dict[str, Any]:
    to = dict(zip(("goal_x_m", "goal_y_m", "goal_z_m"), goal, strict=True))
    return {"x_m": x, "y_m": 0.0, "course_deg": course, **to, "guidance": {"kind": "layers", **layers}}


def test_layers_that_know_the_turn_are_verified_from_arrival_to_waiting(tmp_path: Path) -> None:
    vehicles = [
        placed(0, 90, [300, 0, 0], goal_offset_m=12.0, evading=True),  # arrives and parks, as the next two do
        placed(600, 0, [900, -40, 0], evading=True, climb_mps=1.5),
        placed(-400, 180, [-100, 30, 0], goal_offset_m=3.0, evading=True),
        placed(1200, 0, [1200, 100, 0], evading=True),  # flies away first: changes its layer
        placed(1800, 0, [2000, 0, 0], goal_offset_m=6.0),
    ]
    fields: dict[str, Any] = {"vehicle": vehicles, "duration_s": 34.0, "filter": {"kind": "none"}}
    coarse = ["filter_dt_s=0.2", "record_dt_s=0.2"]
    run = testbed.run(made({"kind": "layers"}, *coarse, **fields), tmp_path / "r", force=True)
    assert [f.what for f in verify(tmp_path / "r") if f.agrees is False] == []
    of = {k: each.reset_index() for k, each in run.vehicles.groupby("vehicle")}
    assert [of[k].omega_nominal_radps.nunique() > 1 and abs(of[k].z_m.iloc[-1]) > 6 for k in (1, 2, 3)]
    zeta = of[4].zeta_nominal_mps.to_numpy()
    changed = 1 + int(np.argmin(np.diff(zeta)[40:])) + 40
    assert zeta[changed] < zeta[changed - 1] - 2.0
    # The time alone is at 20 m/s, though gamma is flown at another speed after the goal.
    late = run.guarantee("intervention")["detail"]["time_added_s"]
    parks = of[1].t_s[of[1].v_nominal_mps < 20].iloc[0]
    assert late[0] == pytest.approx(parks - 280.0 / 20.0, abs=0.2)
    for vehicle, name, value in ((0, "goal_offset_m", 11.0), (3, "evading", False)):
        forged = copied(tmp_path / "r", tmp_path / f"{vehicle}")
        manifest = read(forged, "manifest.json")
        manifest["scenario"]["vehicle"][vehicle]["guidance"][name] = value
        write(forged, "manifest.json", manifest)
        seal(forged)
        assert "nominal" in differing(forged)
    for row in (5 * 100, 5 * changed + 3):  # parked, and in another layer
        forged = copied(tmp_path / "r", tmp_path / f"row {row}")
        edit_cell(forged, "vehicles", "zeta_nominal_mps", row, 1e-6)
        seal(forged)
        assert "nominal" in differing(forged)


def test_vehicles_of_one_fleet_share_ring_and_layers_whatever_else_they_say(tmp_path: Path) -> None:
    mixed = [
        {"guidance": {"kind": "layers"}}, {"guidance": {"kind": "layers", "speed_mps": 18.0}},
        {"guidance": {"kind": "layers", "height_m": -20.0}}, {"guidance": {"kind": "roundabout"}},
        {"guidance": {"kind": "roundabout", "speed_mps": 17.0}}, {},
    ]  # fmt: skip
    s = made({"kind": "near-identity", "lookahead_m": 5.0}, vehicles=6, vehicle=mixed, duration_s=15.0)
    run = testbed.run(s, tmp_path / "r")
    assert [f.what for f in verify(tmp_path / "r") if f.agrees is False] == []
    z = run.vehicles[run.vehicles.t_s == 9.0].z_m.to_numpy()
    assert z[2] < -15.0 and abs(z[0] - z[1]) > 4.0 and np.abs(z[3:]).max() < 1.0


BAD = {
    "too slow": (
        {"kind": "layers", "speed_mps": 10},
        r"guidance.speed_mps: 10 m/s is outside the limits 15 to 25",
    ),
    "too near": (
        {"kind": "layers", "spacing_m": 4},
        r"guidance.spacing_m: 4 m is below Ds, d_safe_m = 5 m: .*give more, or leave it out",
    ),
    "too steep": (
        {"kind": "layers", "climb_mps": 5},
        r"guidance.climb_mps: 5 m/s is above the limit 3.9 m/s",
    ),
    "no layers": ({"kind": "layers", "layers": 0}, r"guidance.layers: .*greater than or equal to 1"),
    "a ring's": (
        {"kind": "layers", "room_m": 9},
        r"guidance.room_m: has no effect on guidance in layers of height; kind = 'roundabout' takes it",
    ),
    "too tight": (
        {"kind": "roundabout", "radius_m": 50},
        r"guidance.radius_m: 50 m at 20 m/s takes 22.9 deg/s and the limit is 13 deg/s; give 88.15 m or more",
    ),
    "half a centre": ({"kind": "roundabout", "centre_m": [1]}, r"guidance.centre_m: .*at least 2"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_table_that_cannot_be_flown_is_one_clear_line(name: str) -> None:
    table, said = BAD[name]
    with pytest.raises(UserError, match=said) as error:
        made(table)
    assert "\n" not in str(error.value)


def test_what_the_limits_or_the_manoeuvre_exclude_is_refused() -> None:
    with pytest.raises(UserError, match=r"guidance.kind: with limits.zeta_max_mps = 0 no layer"):
        made({"kind": "layers"}, "zeta_max_mps=0")
    ring = load("paper-2-straight", ["guidance.kind=roundabout"])
    with pytest.raises(UserError, match=r"guidance.kind: a roundabout is flown against the evading turn"):
        testbed.run(ring)
    pairs = "barrier.pairs=[{i=1, j=2, v_mps=16, omega_degps=11}]"
    with pytest.raises(
        UserError, match="'roundabout' need one evading manoeuvre; this barrier has one per pair"
    ):
        testbed.run(load("paper-2-turn", ["guidance.kind=roundabout", "shared=false", pairs]))
