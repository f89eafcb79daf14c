"""Guidance along waypoints, a circle, a course and a track: closed loops, whole runs, what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import testbed
from filters.model import Command, Limits, State, View, step
from testbed.components.following.course import FIELD_SHARE, approach, wrapped
from testbed.components.following.lines import Hold, Waypoints
from testbed.components.following.loiter import Loiter
from testbed.components.following.track import FollowTrack, Track
from testbed.errors import NoteWarning, UserError
from testbed.records.run import Run
from testbed.scenario.scenario import Scenario, load, parse
from testbed.simulation.refly import refly
from testbed.verification.check import verify
from testbed.verification.guidance_laws import track_at
from tests.forgery import seal

DT = 0.05
OMEGA = np.radians(13.0)


def limits(n: int) -> Limits:
    return Limits.of(np.tile([15.0, 25.0, OMEGA, 3.9], (n, 1)))


def flown(law: Any, state: State, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Poses (S, N, 4) and commands (S, N, 3) of unicycles that fly what the law wants, inside the limits."""
    poses, commands = [], []
    for k in range(round(duration / DT)):
        wanted = limits(len(state)).clip(
            law(k * DT, View(state, Command(np.full(len(state), 20.0), 0.0, 0.0)))
        )
        poses.append(state.array())
        commands.append(wanted.array())
        state = step(state, wanted, DT)
    return np.array(poses), np.array(commands)


anywhere = st.builds(
    lambda x, y, course, z: State([x], [y], [course], [z]),
    st.floats(-400, 400), st.floats(-400, 400), st.floats(-np.pi, np.pi), st.floats(-20, 20),
)  # fmt: skip


@given(state=anywhere, course=st.floats(-np.pi, np.pi))
@settings(max_examples=15, deadline=None)
def test_a_leg_is_reached_from_anywhere_and_not_crossed_again(state: State, course: float) -> None:
    along = np.exp(1j * course)
    far = np.array([[0, 0, 0], [1e4 * along.real, 1e4 * along.imag, 0.0]])
    poses, _ = flown(Waypoints(far, np.full(2, 20.0), False, 0.5, 0.3, limits(1)), state, 90.0)
    across = ((poses[:, 0, 0] + 1j * poses[:, 0, 1]) * np.conj(along)).imag
    # 90 s are 26 of the field's time constants at the line less the turn-round; sampled at 0.05 s.
    assert abs(across[-1]) < 0.01 and np.abs(across[-200:]).max() < 0.1
    assert abs(wrapped(poses[-1, 0, 2] - course)) < 1e-3 and abs(poses[-1, 0, 3]) < 1e-3
    # No limit cycle: from the half-way time on it never leaves again, and never changes its side.
    assert (np.diff(np.abs(across[900:])) <= 1e-9).all()


@given(state=anywhere, radius=st.floats(95, 300), sense=st.sampled_from([1.0, -1.0]))
@settings(max_examples=15, deadline=None)
def test_a_circle_is_reached_from_anywhere(state: State, radius: float, sense: float) -> None:
    law = Loiter(np.array([30.0, -20.0, 5.0]), radius, 20.0, sense, 0.5, 0.3, limits(1))
    poses, commands = flown(law, state, 150.0)
    off = np.hypot(poses[:, 0, 0] - 30, poses[:, 0, 1] + 20) - radius
    # Sampled at 0.05 s the vehicle flies chords' arcs: millimetres.
    assert np.abs(off[-400:]).max() < 0.05
    assert commands[-1, 0, 1] == pytest.approx(sense * 20.0 / radius, abs=2e-3)
    assert poses[-1, 0, 3] == pytest.approx(5.0, abs=1e-3)


def test_the_field_of_a_leg_leaves_the_other_half_of_the_turn_rate() -> None:
    """Steady on the field the turn rate is largest at approach / sqrt(2), and there FIELD_SHARE of it."""
    reach = float(approach(20.0, limits(1))[0])
    e = np.linspace(-5, 5, 4001) * reach
    rate = 20.0 * np.sin(np.arctan(e / reach)) / reach / (1 + (e / reach) ** 2)
    assert np.abs(rate).max() == pytest.approx(FIELD_SHARE * OMEGA, rel=1e-5)


def test_corners_are_cut_so_that_the_turn_ends_near_the_next_leg() -> None:
    places = np.array([[0, 0, 0], [500, 0, 0], [500, 500, 30], [0, 500, 0]], dtype=float)
    law = Waypoints(places, np.full(4, 20.0), True, 0.5, 0.3, limits(1))
    poses, commands = flown(law, State([0.0], [0.0], [0.0], [0.0]), 200.0)
    x, y = poses[:, 0, 0], poses[:, 0, 1]
    sides = [
        np.hypot(x - np.clip(x, 0, 500), y), np.hypot(x - np.clip(x, 0, 500), y - 500),
        np.hypot(x, y - np.clip(y, 0, 500)), np.hypot(x - 500, y - np.clip(y, 0, 500)),
    ]  # fmt: skip
    # A turn of R = v / (0.8 omega_max) = 110 m cuts a right corner by R (sqrt(2) - 1) = 46 m.
    assert np.min(sides, axis=0).max() < 46.0
    middle = (np.abs(x - 250) < 50) | (np.abs(y - 250) < 50)
    assert np.min(sides, axis=0)[middle].max() < 4.0
    assert np.abs(commands[:, 0, 1]).max() <= OMEGA
    # Two laps: the height follows the legs, 30 m at the third waypoint's corner.
    assert 20.0 < poses[:, 0, 3].max() < 30.5
    assert law.leg[0] in range(4) and (np.hypot(x - 500, y - 500) < 60).sum() > 80


def test_each_vehicle_flies_its_own_leg_and_the_last_one_is_flown_on() -> None:
    places = np.array([[0, 0, 0], [300, 0, 0], [300, 600, 0]], dtype=float)
    law = Waypoints(places, np.array([20.0, 18.0, 22.0]), False, 0.5, 0.3, limits(2))
    state = State([-500.0, 200.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    poses, commands = flown(law, state, 15.0)
    assert law.leg.tolist() == [0, 1]
    assert commands[-1, :, 0].tolist() == [18.0, 22.0]  # the speed of the waypoint flown to
    poses, _ = flown(law, State.of(poses[-1]), 60.0)
    assert law.leg.tolist() == [1, 1] and np.abs(poses[-1, :, 0] - 300).max() < 1.0
    assert poses[-1, 1, 1] > 900.0


def test_a_course_is_held_and_half_a_turn_goes_right() -> None:
    law = Hold(np.radians(200.0), 18.0, 5.0, 0.5, 0.3, limits(2))
    poses, commands = flown(law, State([0.0, 0.0], 0.0, [np.radians(20.0), 0.0], 0.0), 40.0)
    assert np.allclose(wrapped(poses[-1, :, 2] - np.radians(200.0)), 0.0, atol=1e-4)
    assert commands[0, 0, 1] == -OMEGA  # exactly opposite
    assert np.allclose(poses[-1, :, 3], 5.0, atol=1e-4) and (commands[:, :, 0] == 18.0).all()
    assert (np.diff(np.abs(wrapped(poses[:, 1, 2] - np.radians(200.0)))) <= 1e-12).all()


def eight(t: np.ndarray) -> np.ndarray:
    """A figure of eight that turns at most at 10 deg/s, with a climb: x, y, z."""
    w = 2 * np.pi / 60
    return np.stack([250 * np.sin(w * t), 110 * np.sin(2 * w * t), 5 * (1 - np.cos(w * t))], axis=-1)


def test_a_track_is_followed_with_its_turns_fed_forward() -> None:
    t = np.arange(0.0, 60.5, 0.5)
    track = Track(np.column_stack([t, eight(t)]))
    place, velocity, _ = track.at(0.0)
    start = State([place[0]], [place[1]], [np.arctan2(velocity[1], velocity[0])], [place[2]])
    wide = Limits.of([[5.0, 60.0, 0.5, 3.9]])
    state, worst = start, 0.0
    law = FollowTrack(track, 0.5, 0.5, wide)
    for k in range(1200):
        wanted = wide.clip(law(k * DT, View(state, Command([20.0], 0.0, 0.0))))
        worst = max(worst, float(np.linalg.norm(state.position[0] - eight(np.array(k * DT)))))
        state = step(state, wanted, DT)
    # A zero-order hold of 0.05 s lags by about half a metre at 30 m/s; without feed-forward it is 8 m.
    assert worst < 1.0


def test_a_vehicle_beside_its_track_comes_onto_it_and_after_its_end_flies_on() -> None:
    t = np.arange(0.0, 31.0)
    track = Track(np.column_stack([t, 20 * t, 0 * t, 10 + 0 * t]))
    poses, commands = flown(
        FollowTrack(track, 0.5, 0.5, limits(1)), State([-10.0], [40.0], [0.0], [0.0]), 60.0
    )
    off = poses[599, 0] - np.array([20 * 599 * DT, 0.0, 0.0, 10.0])
    assert np.abs(off).max() < 0.05
    assert commands[-1, 0] == pytest.approx([20.0, 0.0, 0.0], abs=1e-2)


@given(seed=st.integers(0, 2**31), rows=st.integers(2, 12), heights=st.booleans())
@settings(max_examples=60, deadline=None)
def test_a_track_passes_its_rows_smoothly_and_the_second_opinion_agrees(
    seed: int, rows: int, heights: bool
) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.1, 3.0, rows)) + rng.uniform(-5, 5)
    table = np.column_stack([t, rng.uniform(-100, 100, (rows, 3 if heights else 2))])
    track = Track(table)
    assert track.at(t - t[0])[0] == pytest.approx(table[:, 1:], abs=1e-9)
    when = rng.uniform(0, track.end + 5.0, 40)
    for own, other in zip(track.at(when), track_at(table, when), strict=True):
        assert own == pytest.approx(other, rel=1e-9, abs=1e-7)
    d = 1e-6
    inside = when[(when > d) & (when < track.end - d) & (np.abs(when[:, None] - (t - t[0])).min(axis=1) > d)]
    ahead, behind = track.at(inside + d)[0], track.at(inside - d)[0]
    assert (ahead - behind) / (2 * d) == pytest.approx(track.at(inside)[1], rel=1e-4, abs=1e-3)


# Whole runs.

WAYPOINTS = {
    "kind": "waypoints",
    "waypoints_m": [[0, 0, 5], [200, 0, 5, 18], [200, 300, 0]],
    "speed_mps": 20.0,
}
TABLES: dict[str, dict[str, Any]] = {
    "waypoints": WAYPOINTS,
    "closed": WAYPOINTS | {"closed": True, "approach_m": 50.0},
    "loiter": {"kind": "loiter", "centre_m": [50, 50], "radius_m": 100, "sense": "right", "height_m": 3},
    "hold": {"kind": "hold", "course_deg": 100.0, "height_m": 2.0, "speed_mps": 19.0},
    "track": {"kind": "track", "rows": [
        [5.0, -200, 0, 0], [8.0, -140, 0, 2], [11.0, -80, 25, 2], [12.0, -60, 40, 1],
    ]},
    "level track": {"kind": "track", "rows": [[0.0, -200, 0], [20.0, 200, 20]]},
}  # fmt: skip


def made(table: dict[str, Any], *overrides: str, **fields: Any) -> Scenario:
    data = load("paper-2-turn", ["duration_s=8", "filter_dt_s=0.05", "record_dt_s=0.05", *overrides])
    plain = data.model_dump(mode="json") | {"guidance": table, "checks": {"manoeuvre_instants": 0}} | fields
    return parse(plain)


def disagreeing(folder: Path) -> list[str]:
    return [f.what for f in verify(folder) if f.agrees is False]


@pytest.mark.parametrize("name", TABLES)
def test_a_run_is_verified_and_flown_again(name: str, tmp_path: Path) -> None:
    run = testbed.run(made(TABLES[name]), tmp_path / "r", force=True)
    assert disagreeing(tmp_path / "r") == []
    assert [f.what for f in refly(tmp_path / "r") if f.agrees is False] == []
    assert "nominal" in [f.what for f in verify(tmp_path / "r") if f.agrees]
    goal = run.guarantee("goal")
    assert (goal["verdict"] == "not applicable") == (name != "waypoints"), goal
    forged = json.loads((tmp_path / "r/manifest.json").read_text())
    key = {"waypoints": "speed_mps", "closed": "approach_m", "loiter": "radius_m", "hold": "course_deg"}.get(
        name, "position_gain_per_s"
    )
    forged["scenario"]["guidance"][key] = 21.0
    (tmp_path / "r/manifest.json").write_text(json.dumps(forged))
    seal(tmp_path / "r")
    assert "nominal" in disagreeing(tmp_path / "r")


def test_vehicles_of_one_fleet_have_guidance_of_different_kinds(tmp_path: Path) -> None:
    tables = [
        {"guidance": TABLES["loiter"]}, {}, {"guidance": {"kind": "manoeuvre"}}, {"guidance": TABLES["hold"]},
        {"guidance": WAYPOINTS}, {"guidance": TABLES["loiter"]},
        {"guidance": {"kind": "near-identity", "gain_per_s": 0.2}},
    ]  # fmt: skip
    s = made({"kind": "near-identity", "lookahead_m": 5.0}, vehicles=7, vehicle=tables, duration_s=5.0)
    run = testbed.run(s, tmp_path / "r")
    assert disagreeing(tmp_path / "r") == []
    first = run.vehicles[run.vehicles.t_s == 0.0]
    assert first.v_nominal_mps.to_numpy()[[0, 2, 3, 4]] == pytest.approx([20.0, 16.0, 19.0, 20.0])
    added = run.guarantee("intervention")["detail"]["time_added_s"]
    assert added == [None] * 7  # nobody arrives in 5 s


def test_a_fleet_of_one_kind_is_one_law() -> None:
    from testbed.components import catalogue
    from testbed.components.guidance import Constant, NearIdentity

    s = load("paper-20-turn")
    goal = np.zeros((20, 3))
    assert isinstance(catalogue.guidance(s, goal, catalogue.barrier(s)), NearIdentity)
    turning = load("paper-20-turn", ["guidance.kind=manoeuvre"])
    assert isinstance(catalogue.guidance(turning, goal, catalogue.barrier(turning)), Constant)


def test_how_far_a_vehicle_is_from_its_track_is_measured_and_verified(tmp_path: Path) -> None:
    s = made(TABLES["track"])
    run = testbed.run(s, tmp_path / "r", force=True)
    (first, second) = run.manifest["track_error"]
    assert (first["vehicle"], second["vehicle"]) == (1, 2)
    assert first["rms_m"] < first["largest_m"] < 5.0
    assert second["largest_m"] == pytest.approx(400.0)  # it starts at the far side
    forged = json.loads((tmp_path / "r/manifest.json").read_text())
    forged["track_error"][0]["largest_m"] -= 1e-3
    (tmp_path / "r/manifest.json").write_text(json.dumps(forged))
    seal(tmp_path / "r")
    assert disagreeing(tmp_path / "r") == ["track"]


@pytest.mark.slow
def test_an_x8_follows_as_the_unicycle_does() -> None:
    """X8: on a circle within 0.3 m, on a leg within 0.5 m, on a course within 0.1 deg; healthy a tenth."""

    def late(table: dict[str, Any], duration: float) -> Run:
        s = made(table, "plant=jsbsim", f"duration_s={duration}", "filter.kind=none", "vehicles=1")
        return testbed.run(s, force=True)

    run = late(TABLES["loiter"] | {"radius_m": 110, "centre_m": [-100, 0]}, 60)
    v = run.vehicles[run.vehicles.t_s > 50]
    assert np.abs(np.hypot(v.x_m + 100, v.y_m) - 110).max() < 0.3 and np.abs(v.z_m - 3).max() < 0.1
    run = late({"kind": "waypoints", "waypoints_m": [[-200, 30, 0], [5000, 30, 0]]}, 40)
    v = run.vehicles[run.vehicles.t_s > 35]
    assert np.abs(v.y_m - 30).max() < 0.5
    v = late(TABLES["hold"] | {"course_deg": 30.0}, 30).vehicles
    assert np.abs(np.degrees(v.theta_rad[v.t_s > 25]) - 30.0).max() < 0.1


# What is refused.

BAD = {
    "one waypoint": (
        {"kind": "waypoints", "waypoints_m": [[0, 0, 0]]},
        r"guidance: waypoints_m: 1 waypoint; a leg",
    ),
    "twice the same": (
        {"kind": "waypoints", "waypoints_m": [[0, 0, 0], [1, 2, 0], [1, 2, 9]]},
        r"guidance: waypoints_m: 2 and 3 are at one place, x 1 m and y 2 m",
    ),
    "closed onto itself": (
        {"kind": "waypoints", "waypoints_m": [[0, 0, 0], [1, 2, 0], [0, 0, 9]], "closed": True},
        r"guidance: waypoints_m: 3 and 1 are at one place",
    ),
    "two numbers": (
        {"kind": "waypoints", "waypoints_m": [[0, 0], [1, 2]]},
        r"guidance.waypoints_m.0: .*at least 3",
    ),
    "too fast": (
        {"kind": "waypoints", "waypoints_m": [[0, 0, 0, 30], [1, 2, 0, 30]]},
        r"guidance.speed_mps: 30 m/s is outside the limits 15 to 25 m/s",
    ),
    "too tight": (
        {"kind": "loiter", "centre_m": [0, 0], "radius_m": 40},
        r"guidance.radius_m: 40 m at 20 m/s takes 28.6 deg/s and the limit is 13 deg/s; give 88.15 m or more",
    ),
    "no circle": ({"kind": "loiter", "centre_m": [0, 0]}, r"guidance.radius_m: field required"),
    "no course": ({"kind": "hold"}, r"guidance.course_deg: field required"),
    "of another kind": (
        {"kind": "hold", "course_deg": 0, "centre_m": [0, 0]},
        r"guidance.centre_m: has no effect on guidance that holds a course; kind = 'loiter' or 'roundabout'",
    ),
    "unknown kind": ({"kind": "spiral"}, r"guidance.kind: input should be .* or 'roundabout', got 'spiral'"),
    "unread": ({"kind": "track", "file": "a.csv"}, r"guidance: file: a.csv was not read"),
    "no track": ({"kind": "track"}, r"guidance: file: no track is named"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_table_that_cannot_be_flown_is_one_clear_line(name: str) -> None:
    table, said = BAD[name]
    with pytest.raises(UserError, match=said) as error:
        made(table)
    assert "\n" not in str(error.value)


TRACK = "t_s,x_m,y_m,z_m\n0,-200,0,0\n10,0,0,1\n30,400,0,1\n"
BAD_TRACKS = {
    "back in time": (
        TRACK.replace("30,400", "9,400"),
        r"t_s goes from 10 s in row 2 to 9 s in row 3; times must",
    ),
    "not a number": (TRACK.replace("400", "nan"), r"row 3 has nan"),
    "a word": (TRACK.replace("400", "far"), r"line 4 has 'far' for x_m, not a number"),
    "a short line": (TRACK.replace("30,400,0,1", "30,400"), r"line 4 has nothing for y_m"),
    "no column": (TRACK.replace("y_m", "north"), r"has no column y_m"),
    "one row": ("\n".join(TRACK.split("\n")[:2]), r"a track of 1 row; it needs two or more"),
    "empty": ("", r"is empty"),
    "twice": (TRACK.replace("z_m", "x_m"), r"has two columns x_m"),
    "binary": ("t_s\0,", r"is no text: a NUL"),
}


def filed(folder: Path, track: str | None, file: str = "log.csv") -> Path:
    if track is not None:
        (folder / file).write_text(track)
    scenario = folder / "replay.toml"
    scenario.write_text(
        f'name = "replay"\nvehicles = 2\nduration_s = 20\n[guidance]\nkind = "track"\nfile = "{file}"\n'
    )
    return scenario


@pytest.mark.parametrize("name", BAD_TRACKS)
def test_a_file_that_is_no_track_is_one_clear_line(name: str, tmp_path: Path) -> None:
    text, said = BAD_TRACKS[name]
    with pytest.raises(UserError, match=rf"log.csv: {said}") as error:
        load(filed(tmp_path, text))
    assert "\n" not in str(error.value)
    (tmp_path / "log.csv").unlink()
    with pytest.raises(UserError, match=r"track .*log.csv does not exist"):
        load(filed(tmp_path, None))


def test_a_track_lies_beside_its_scenario_and_its_numbers_are_in_what_a_run_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir("/")
    s = load(filed(tmp_path, TRACK))
    table = s.guidance
    assert table.kind == "track" and table.rows[-1] == [30.0, 400.0, 0.0, 1.0] and len(table.sha256) == 64
    # Layout, line ends and columns that are not used say nothing; a number does.
    other = TRACK.replace("\n", ",x\r\n").replace("-200,0", " -200.0,0.0")
    assert load(filed(tmp_path, other)) == s
    assert load(filed(tmp_path, TRACK.replace("400", "400.1"))) != s
    # What was read is in the manifest: the file is not needed again.
    (tmp_path / "log.csv").unlink()
    assert parse(s.model_dump(mode="json")) == s
    with pytest.raises(UserError, match="sha256: it is not that of the rows"):
        changed = s.model_dump(mode="json")
        changed["guidance"]["rows"][0][1] += 1.0
        parse(changed)


def test_a_track_that_ends_before_the_run_is_noted(tmp_path: Path) -> None:
    with pytest.warns(
        NoteWarning, match=r"guidance: the track ends at 30 s and the run at 40 s; after it the last"
    ):
        load(filed(tmp_path, TRACK), ["duration_s=40"])


def test_names_that_overrides_use_alone_mean_what_they_meant() -> None:
    s = load("paper-2-turn", ["radius_m=150"])
    assert s.start.radius_m == 150.0
    made_ = load(
        "paper-2-turn",
        ["guidance.kind=loiter", "guidance.centre_m=[0, 0]", "guidance.radius_m=120", "lookahead_m=1"],
    )
    assert made_.guidance.kind == "loiter" and made_.guidance.radius_m == 120.0
