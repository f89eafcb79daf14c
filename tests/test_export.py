"""Exports read back: a Tacview recording by pyacmi, which is not ours, and CSV by pandas."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pyacmi import Acmi
from pyacmi.acmi import AcmiFileReader

import testbed
from aircraft.jsbsim.geodesy import Origin, ecef
from testbed.export import acmi, acmi_text, events
from testbed.records.run import Run
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

NAME = "naïve, <script>alert(1)</script> \\ two\nlines"
# Aircraft without a filter, 80 m apart: they come below Ds within two seconds.
COLLIDING = [
    "plant=jsbsim",
    "filter.kind=none",
    "radius_m=40",
    "duration_s=2.5",
    "filter_dt_s=0.05",
    "record_dt_s=0.05",
    "manoeuvre_instants=0",
]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Run:
    s = load("paper-2-turn", COLLIDING).model_copy(update={"name": NAME})
    return run(s, tmp_path_factory.mktemp("export") / "collision")


@pytest.fixture(scope="module", params=["txt", "zip"])
def recording(flown: Run, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("acmi") / f"collision.{request.param}.acmi"
    acmi.write(flown, path)
    return path


def parsed(path: Path) -> Acmi:
    read = Acmi()
    read.load_acmi(str(path))
    return read


def bookmarks(path: Path) -> list[tuple[float, list[str]]]:
    """Time and fields of every event, lines and fields split by pyacmi, which ignores events itself."""
    found, t = [], 0.0
    with path.open(encoding="utf-8-sig") as file:
        for line in AcmiFileReader(file):
            if line.startswith("#"):
                t = float(line[1:])
            elif line.startswith("0,Event="):
                (text,) = Acmi.split_fields(line.strip())[1:]
                found.append((t, text.removeprefix("Event=").split("|")))
    return found


def test_tacview_positions_times_and_attitudes_are_the_runs(flown: Run, recording: Path) -> None:
    read, origin = parsed(recording), Origin()
    assert read.file_version == 2.2 and read.file_type == "text/acmi/tacview"
    times = np.array(sorted(set(read.timeframes)))
    for vehicle, rows in flown.vehicles.groupby("vehicle"):
        seen = read.objects[f"{acmi.FIRST_ID + vehicle:x}"]
        assert np.abs(times[:, None] - rows.t_s.to_numpy()).min(axis=0).max() < 1e-6
        for row in rows.itertuples():
            t = min(seen.data["Longitude"], key=lambda at: abs(at - row.t_s))
            assert abs(t - row.t_s) < 1e-3
            place = np.radians([seen.latitude(t), seen.longitude(t)])
            found = origin.enu(ecef(*place, seen.altitude(t)), np.array(seen.altitude(t)))
            assert np.abs(found - [row.x_m, row.y_m, row.z_m]).max() < 1e-3
            assert abs(seen.u(t) - row.x_m) < 1e-3 and abs(seen.v(t) - row.y_m) < 1e-3
            assert seen.roll(t) == pytest.approx(np.degrees(row.roll_rad), abs=1e-4)
            assert seen.pitch(t) == pytest.approx(np.degrees(row.pitch_rad), abs=1e-4)
            assert seen.yaw(t) == pytest.approx((90 - np.degrees(row.heading_rad)) % 360, abs=1e-4)


def test_tacview_shows_the_bubble_and_the_critical_pair(flown: Run, recording: Path) -> None:
    read = parsed(recording)
    first, second = read.objects["101"], read.objects["102"]
    for vehicle, other in ((first, "102"), (second, "101")):
        assert vehicle.get_value("EngagementRange") == flown.manifest["scenario"]["d_safe_m"]
        assert vehicle.get_value("EngagementMode") == 1
        assert vehicle.locked_target() == other and vehicle.is_plane and vehicle.name == "x8"
    lost = flown.pairs.t_s[flown.pairs.distance_m < 5]
    assert first.color(float(lost.iloc[0])) == "Red" and first.color(0.0) == "Orange"
    assert float(first.get_value("h_m", 0.0)) == pytest.approx(flown.pairs.h_m[0], abs=1e-3)


def test_tacview_has_a_bookmark_at_every_violation(flown: Run, tmp_path: Path) -> None:
    acmi.write(flown, tmp_path / "r.txt.acmi")
    marks = bookmarks(tmp_path / "r.txt.acmi")
    expected = events.events(flown)
    assert {e.kind for e in expected} >= {"separation", "safe-set", "below-ds", "outside-safe-set"}
    assert len(marks) == len(expected)
    for (t, (kind, *who, text)), event in zip(marks, expected, strict=True):
        assert kind == "Bookmark" and abs(t - event.t_s) < 1e-3
        assert [int(w, 16) - acmi.FIRST_ID for w in who] == list(event.vehicles)
        assert text.replace("\\,", ",").endswith(event.text)
    separation = flown.guarantee("separation")
    assert any(abs(t - separation["t_s"]) < 1e-3 and "separation violated" in f[-1] for t, f in marks)


def test_commas_newlines_and_accents_in_names_survive(flown: Run, recording: Path) -> None:
    title = parsed(recording).title
    assert title is not None
    # pyacmi joins continued lines and leaves the backslash before a comma.
    assert title.replace("\\,", ",") == NAME.replace("\\", "/") + " on jsbsim"
    assert acmi_text.escaped("a,b\r\nc\\") == "a\\,b\\\nc/"


def test_equal_runs_give_equal_recordings(flown: Run, recording: Path, tmp_path: Path) -> None:
    acmi.write(flown, tmp_path / recording.name)
    assert (tmp_path / recording.name).read_bytes() == recording.read_bytes()


def test_the_pair_of_least_h_is_marked_among_several_and_let_go(tmp_path: Path) -> None:
    flying = run(load("paper-20-turn", ["vehicles=4", "duration_s=0.1", "manoeuvre_instants=0"]))
    flying.tables["pairs"]["h_m"][:6] = [9, 9, 1, 9, 9, 9]  # at first vehicles 1 and 4
    flying.tables["pairs"]["h_m"][6:] = np.tile([9, 9, 9, 9, 9, 1], len(flying.pairs) // 6 - 1)
    del flying.__dict__["pairs"]
    acmi.write(flying, tmp_path / "r.txt.acmi")
    frames = (tmp_path / "r.txt.acmi").read_text(encoding="utf-8").partition("\n#0")[2]
    lines = [line for line in frames.splitlines() if line.startswith("101,")]
    assert "LockedTarget=104" in lines[0] and "LockedTargetMode=1" in lines[0] and "h_m=1.0000" in lines[0]
    assert "LockedTargetMode=0" in lines[1] and "Color=Blue" in lines[1]
    assert not re.search("Color|Locked", lines[2])
    assert "||" in lines[0]  # a unicycle has no roll and no pitch


def test_csv_is_read_back_to_the_last_digit(flown: Run, tmp_path: Path, call: Callable[..., int]) -> None:
    out = tmp_path / "tables"
    assert call("export", flown.path, "--format", "csv", "--out", out) == 0
    for name in ("vehicles", "pairs"):
        read = pd.read_csv(out / f"{name}.csv", keep_default_na=name == "pairs")
        pd.testing.assert_frame_equal(read, getattr(flown, name), check_dtype=False, rtol=1e-14)
    marks = pd.read_csv(out / "events.csv")
    assert marks.kind.to_list() == [e.kind for e in events.events(flown)]
    columns = pd.read_csv(out / "columns.csv", keep_default_na=False)
    written = [(n, c) for n in ("vehicles", "pairs", "events") for c in pd.read_csv(out / f"{n}.csv").columns]
    assert list(zip(columns.table, columns.column, strict=True)) == written
    assert columns.meaning.all() and columns.unit[columns.column == "elevon_left_rad"].item() == "rad"


def test_export_names_its_mistakes_and_keeps_what_is_there(
    flown: Run, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    def mistake(*arguments: object) -> str:
        assert call("export", *arguments) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    assert flown.path is not None
    there = tmp_path / "thesis.txt.acmi"
    there.write_text("years of work")
    assert "exists; give another --out" in mistake(flown.path, "--format", "acmi", "--out", there)
    assert there.read_text() == "years of work"
    assert "end in .txt.acmi" in mistake(flown.path, "--format", "acmi", "--out", tmp_path / "run.acmi")
    assert "holds no finished run" in mistake(tmp_path, "--format", "csv")
    assert f"give one: {flown.path}" in mistake(flown.path.parent, "--format", "csv")
    assert list(tmp_path.iterdir()) == [there]


def test_by_default_the_recording_stands_beside_the_run(
    flown: Run, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert flown.path is not None
    before = sorted(p.name for p in flown.path.iterdir())
    assert call("export", flown.path, "--format", "acmi") == 0
    written = flown.path.with_name("collision.txt.acmi")
    assert str(written) in capsys.readouterr().out.replace("\n", "") and written.is_file()
    assert sorted(p.name for p in flown.path.iterdir()) == before
    assert testbed.load(flown.path).guarantees == flown.guarantees
